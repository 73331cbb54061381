# SPDX-License-Identifier: Apache-2.0
"""The layer checker finds each kind of breach, and nothing in a clean tree."""
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
CHECKER = ROOT / "tools" / "check_layers.py"

CLEAN = {
    "lib/base/solve.h": "#include <driveid/status.h>\n",
    "lib/effect/coulomb.c": '#include "base/solve.h"\n#include <driveid/effect.h>\n#include <math.h>\n',
    "lib/batch/fit.cpp": '#include "fit.hpp"\n#include <driveid/model.h>\n#include <Eigen/Dense>\n',
    "lib/batch/fit.hpp": "#include <vector>\n",
    "lib/diagnose/explain.cpp": '#include "batch/fit.hpp"\n#include <driveid/model_file.h>\n',
    "daemon/main.cpp": "#include <driveid/estimate.h>\n",
    "tools/sim/main.cpp": "#include <driveid/time.h>\n",
    "bindings/python/src/driveid/cli.py": "import driveid.fit\n",
}

BREACHES = [
    ("lib/base/bad.c", '#include "effect/coulomb.h"\n', "base may not use effect"),
    ("lib/base/bad.c", "#include <driveid/effect.h>\n", "base may not use effect"),
    ("lib/effect/bad.c", "#include <driveid/model.h>\n", "effect may not use model"),
    ("lib/batch/bad.cpp", '#include "estimate/fsm.h"\n', "batch may not use estimate"),
    ("lib/batch/bad.cpp", "#include <driveid/fsm.h>\n", "batch may not use estimate"),
    ("lib/batch/bad.cpp", '#include "../diagnose/floor.hpp"\n', "batch may not use diagnose"),
    ("daemon/source/bad.cpp", '#include "../../lib/base/solve.h"\n', "daemon may not use base"),
    ("bindings/python/ext/bad.cpp", '#include "batch/fit.hpp"\n', "bindings may not use batch"),
    ("tools/sim/bad.cpp", "#include <driveid/effect.h>\n", "simulator may include only"),
    ("tools/sim/bad.cpp", "#include <driveid/model.h>\n", "simulator may include only"),
    ("lib/include/driveid/bad.h", '#include "base/solve.h"\n', "a public header includes"),
    ("lib/CMakeLists.txt", "target_link_libraries(driveid PUBLIC m driveid_batch)\n", "driveid may not link driveid_batch"),
    ("tools/sim/CMakeLists.txt", "target_link_libraries(driveid-sim PRIVATE driveid::batch)\n", "driveid-sim may not link driveid_batch"),
    ("tests/hidden/bad.py", "from driveid import fit\n", "imports driveid"),
    ("bindings/python/src/driveid/bad.py", "import os, tools.sim\n", "imports tools.sim"),
]


def plant(root, files):
    for path, text in files.items():
        file = root / path
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)
    for header in ("lib/effect/coulomb.h", "lib/estimate/fsm.h", "lib/diagnose/floor.hpp"):
        (root / header).parent.mkdir(parents=True, exist_ok=True)
        (root / header).write_text("")


def check(root):
    return subprocess.run([sys.executable, CHECKER, root], capture_output=True, text=True)


def test_this_tree_keeps_its_arrows():
    done = check(ROOT)
    assert done.returncode == 0, done.stdout


def test_clean_tree_passes(tmp_path):
    plant(tmp_path, CLEAN)
    done = check(tmp_path)
    assert done.returncode == 0, done.stdout


@pytest.mark.parametrize(("path", "text", "why"), BREACHES)
def test_breach_is_found(tmp_path, path, text, why):
    plant(tmp_path, {**CLEAN, path: "\n" + text})
    done = check(tmp_path)
    assert done.returncode == 1
    lines = done.stdout.splitlines()
    assert len(lines) == 2 and lines[0].startswith(f"{path}:2: ") and why in lines[0], done.stdout
