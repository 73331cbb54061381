# SPDX-License-Identifier: Apache-2.0
"""driveid record | replay | status | watch | ports."""
COMMANDS = []
