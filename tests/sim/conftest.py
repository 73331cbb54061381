# SPDX-License-Identifier: Apache-2.0
import os
from pathlib import Path

import pytest

TOP = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="session")
def sim():
    program = Path(os.environ.get("DRIVEID_BUILD", TOP / "build")) / "tools/sim/driveid-sim"
    if not program.exists():
        pytest.skip(f"SKIPPED BECAUSE {program} is not built")
    return str(program)
