# SPDX-License-Identifier: Apache-2.0
"""The program's own answers: check, manual, maps, unit file, exit codes."""
import shutil
import subprocess
from pathlib import Path

import pytest
from gateway import DAEMON, ROOT, SOCKETPAIR, drive


def run(*arguments, cwd=None):
    return subprocess.run([DAEMON, *arguments], cwd=cwd, capture_output=True, text=True, timeout=60, stdin=subprocess.DEVNULL)


def test_check_says_what_is_wrong_and_where(tmp_path):
    (tmp_path / "a.toml").write_text(SOCKETPAIR + drive())
    done = run("--check", "a.toml", cwd=tmp_path)
    assert done.returncode == 0 and "fine" in done.stdout
    (tmp_path / "b.toml").write_text(SOCKETPAIR + drive().replace("scale", "scal", 1) + "colour = 3\n")
    done = run("--check", "b.toml", cwd=tmp_path)
    assert done.returncode == 2
    assert 'b.toml:19: drive "axis1".signal "i_q_A".scal: unknown key; did you mean "scale"?' in done.stderr
    assert "colour" in done.stderr
    for bad in ("none.toml", "."):
        done = run("--check", bad, cwd=tmp_path)
        assert done.returncode == 2 and bad in done.stderr


def test_what_cannot_be_identified_is_refused_with_a_reason(tmp_path):
    (tmp_path / "a.toml").write_text(SOCKETPAIR + drive().replace('structure = "rigid_axis"', 'structure = "pmsm_drive"'))
    done = run("--check", "a.toml", cwd=tmp_path)
    assert done.returncode == 2 and 'drive "axis1"' in done.stderr and len(done.stderr.strip()) > 60
    (tmp_path / "b.toml").write_text(SOCKETPAIR + drive(keys='method = "magic"'))
    assert run("--check", "b.toml", cwd=tmp_path).returncode == 2
    (tmp_path / "c.toml").write_text(SOCKETPAIR + drive().replace("K_t_Nm_A", "K_x"))
    assert "K_x" in run("--check", "c.toml", cwd=tmp_path).stderr
    (tmp_path / "d.toml").write_text(SOCKETPAIR + drive().replace('structure = "rigid_axis"', 'model = "none.toml"'))
    assert "none.toml" in run("--check", "d.toml", cwd=tmp_path).stderr


def test_fixed_point_names_the_signals_whose_range_it_lacks(tmp_path):
    """Also the speed, which a PMSM's equations contain and no signal gives."""
    config = tmp_path / "a.toml"
    config.write_text(SOCKETPAIR + drive(type="q31"))
    done = run("--check", config)
    assert done.returncode == 2 and "`range` of the signals i_q_A theta_rad" in done.stderr, done.stderr
    folder = ROOT / "tests/golden/pmsm-fd"
    text = (folder / "driveidd.toml").read_text().replace('type = "f64"', 'type = "q31"').replace('hold = "', 'range = 10\n  hold = "')
    config.write_text(text)
    done = run("--check", config)
    assert done.returncode == 2 and "`speed_range`" in done.stderr, done.stderr
    config.write_text(text.replace("dt_s =", "speed_range = 500\ndt_s ="))
    assert run("--check", config).returncode == 0


def test_a_model_file_is_taken(tmp_path):
    (tmp_path / "m.toml").write_text('format = 1\nstructure = "rigid_axis"\n[parameters.K_t_Nm_A]\nvalue = 0.05\nunit = "N m/A"\nstate = "given"\n')
    (tmp_path / "a.toml").write_text(SOCKETPAIR + drive().replace('structure = "rigid_axis"', 'model = "m.toml"').replace("given = { K_t_Nm_A = 0.05 }", ""))
    done = run("--check", "a.toml", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    (tmp_path / "m.toml").write_text("structure = 3")
    assert "m.toml" in run("--check", "a.toml", cwd=tmp_path).stderr
    for model, words in (("/dev/zero", "is no model file"), (".", "is no model file"), ("nosuch.toml", "cannot be read")):
        (tmp_path / "b.toml").write_text((tmp_path / "a.toml").read_text().replace("m.toml", model))
        done = run("--check", "b.toml", cwd=tmp_path)
        assert done.returncode == 2 and words in done.stderr, done.stderr


def test_the_manual_page_is_the_one_that_is_committed():
    assert run("--manual").stdout == (ROOT / "docs/manual/configuration.md").read_text(), "driveidd --manual > docs/manual/configuration.md"


@pytest.mark.parametrize("name", ["driveidd", "ripple"])
def test_the_example_configuration_is_fine(name):
    done = run("--check", ROOT / f"daemon/dist/{name}.toml")
    assert done.returncode == 0, done.stderr


def test_usage():
    assert run().returncode == 2
    assert run("--nonsense").returncode == 2
    assert "driveidd" in run("--version").stdout
    assert run("--help").returncode == 0


@pytest.mark.skipif(not shutil.which("systemd-analyze"), reason="systemd-analyze is not installed")
def test_the_unit_is_hardened(tmp_path):
    unit = tmp_path / "driveidd.service"
    unit.write_text((ROOT / "daemon/dist/driveidd.service").read_text().replace("/usr/bin/driveidd", "/bin/true"))
    done = subprocess.run(["systemd-analyze", "security", "--offline=yes", "--no-pager", "--threshold=20", unit], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout[-2000:]
    print(done.stdout.splitlines()[-1])


def test_texts_of_the_repository_name_the_program():
    assert (Path(ROOT) / "docs/security.md").exists()
