# SPDX-License-Identifier: Apache-2.0
"""The web workbench: one Starlette application on loopback, five pages, every state in the address."""
