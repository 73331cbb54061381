# SPDX-License-Identifier: Apache-2.0
"""driveid config new | check | import-dbc."""
COMMANDS = []
