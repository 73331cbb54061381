# SPDX-License-Identifier: Apache-2.0
"""driveid: identify electric drives, compare the model with measurements, learn which effect is missing."""
from .records import Record, read, read_all
