"""`init`: files to make one's own, every one of which runs."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import command_line
import numpy as np
import pytest

from sdt_drake.io.resources import models_dir
from sdt_drake.run.design import make_design
from sdt_drake.run.scenario import load_scenario
from sdt_drake.studies.job import make_job
from sdt_drake.studies.study import load_study

call, good, desk, refuse = (getattr(command_line, x) for x in ("call", "good", "desk", "refuse"))


@pytest.fixture
def own(good, desk, monkeypatch):
    """A folder that `init` has filled; what it printed."""
    out = good("init", "own").out
    monkeypatch.chdir(desk / "own")
    return out


def test_what_it_says_to_run_runs(own, good, call, tmp_path):
    lines = re.findall(r"^(sdt-drake .+?)   ", own, re.MULTILINE)
    ran = {line.split()[1]: line.split()[1:] for line in lines}
    assert list(ran) == ["simulate", "view", "tune", "pilot", "plan", "study"]
    for name in ("simulate", "pilot", "plan"):
        good(*ran[name])
    # Motor side, by hand: m a² of what hangs at the end of the arm, m d² of the payload below the
    # axes of roll and pitch, the motor's own.
    arm = 900 + 800 * 0.2**2 + (120 + 90 + 120) * 1.8**2 + 50 + 20 + 10
    largest = [arm / 50**2 + 0.02, 40 + 18 + 4 + 1.2 + 0.15, 18 + 9 + 1.2 + 0.08]
    design = make_design(load_scenario("scenario.yaml"))
    np.testing.assert_allclose(design.inertia.maximum, largest, rtol=1e-6)
    study, base = load_study(ran["study"][1])
    (tmp_path / "rows").mkdir()
    row = make_job(study, base).runner(tmp_path / "rows").run(0)
    assert (len(study), row.status) == (16, "ok")


def test_what_is_commented_out_is_right_too(own):
    text = Path("scenario.yaml").read_text(encoding="utf-8")
    every = re.sub(r"^( *)# (?=[a-z]\w*:)", r"\1", text, flags=re.MULTILINE).replace("#   ", "  ")
    Path("every.yaml").write_text(every, encoding="utf-8")
    before, after = load_scenario("scenario.yaml"), load_scenario("every.yaml")
    assert after.device.motors == ["", "", "T-400"] and not after.plant.elasticity.is_rigid
    assert (after.drive.period, after.plant.deviation.payload_mass) == (0.001, 20)
    assert before.device.motors == [] and before.drive.period is None


def test_editors_find_the_schemas_wherever_the_folder_is(own, tmp_path):
    here = shutil.copytree(".", tmp_path / "elsewhere")
    for name in ("scenario", "motion", "motors", "study"):
        line = (here / f"{name}.yaml").read_text(encoding="utf-8").splitlines()[0]
        schema = Path(line.split("$schema=")[1])
        assert (here / schema).read_text() == (models_dir() / schema).read_text()
        assert not schema.is_absolute()


def test_a_folder_that_is_in_use_is_refused(refuse, desk):
    (desk / "mine").mkdir()
    (desk / "mine" / "notes.txt").touch()
    refuse("init", "mine", saying=["mine: is not empty, expected a new folder"])
    refuse("init", "mine/notes.txt", saying=["notes.txt: is a file, expected a folder"])
    refuse("init", "", saying=["empty, expected a path"])
