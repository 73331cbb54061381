# SPDX-License-Identifier: Apache-2.0
import sys
from pathlib import Path

import pytest

sys.path[:0] = [str(Path(__file__).parent), str(Path(__file__).parents[1])]
from gateway import Gateway  # noqa: E402
from faults import pytest_terminal_summary  # noqa: E402, F401


@pytest.fixture
def gateway(tmp_path):
    g = Gateway(tmp_path)
    yield g
    ended = g.process is None or g.process.poll() is None or g.process.returncode in (0, 2, -9, 137)
    text = g.text() if g.log.exists() else ""
    g.close()
    assert ended, f"the daemon ended by itself with {g.process.returncode}:\n{text[-3000:]}"
    assert "Sanitizer" not in text, text[-6000:]
