# SPDX-License-Identifier: Apache-2.0
"""How long the gateway took to be itself again after each fault, printed at the end of the fault tests: tools/faults makes docs/faults.md of it."""
import contextlib
import os
import time

TOLD = []


@contextlib.contextmanager
def recovery(fault, what):
    """The block ends once the daemon is well again; it begins when the fault ends."""
    began = time.monotonic()
    yield
    test = os.environ.get("PYTEST_CURRENT_TEST", "").rsplit(" (", 1)[0]
    TOLD.append(f"fault: {fault} | {what} | {time.monotonic() - began:.2f} | {test}")


def pytest_terminal_summary(terminalreporter):
    for line in TOLD:
        terminalreporter.write_line(line)
