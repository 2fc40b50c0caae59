"""Controllers of one's own, from the Python file that a scenario names."""

import re
import shutil
from pathlib import Path

import numpy as np
import pytest

import sdt_drake as sdt
from sdt_drake.cli.app import main
from sdt_drake.io.trust import trusting
from sdt_drake.run import options
from sdt_drake.run.options import CONTROLLERS, load_controllers

OWN = Path(__file__).parents[1] / "helpers" / "own_controllers.py"
SCENARIO = """
motion: short.yaml
plant: {kind: coupled}
controller: {kind: proportional, file: own.py, omega_r: 66}
"""
MOTION = "duration: 0.5\njoints:\n" + 4 * "- !Knots {knots: [[0, 0], [0.5, 0.2]]}\n"
STUDY = """
scenario: run.yaml
draws: 2
variables:
- fields: [controller]
  distribution: !Choice {values: [proportional, pi]}
- fields: [plant.deviation.payload_mass]
  distribution: !Uniform {low: 0, high: 9}
"""
CLASS = r"controller 'proportional' \(class Proportional\)"


@pytest.fixture
def desk(tmp_path, monkeypatch):
    """A folder with a scenario that names its controller's file; the user is in another."""
    folder, elsewhere = tmp_path / "desk", tmp_path / "elsewhere"
    folder.mkdir()
    elsewhere.mkdir()
    shutil.copy(OWN, folder / "own.py")
    for name, text in {"run": SCENARIO, "short": MOTION, "study": STUDY}.items():
        (folder / f"{name}.yaml").write_text(text)
    monkeypatch.chdir(elsewhere)
    return folder


def test_comparisons_and_studies_carry_the_controller_file(desk, capsys):
    """Into processes that have not seen it, and into the folder, where rows are repeated."""
    labels = ["--controllers", "pi,proportional"]
    assert main(["compare", str(desk / "run.yaml"), *labels, "--trust"]) == 0
    study = ["study", str(desk / "study.yaml"), "--out", "out", "--workers", "1", "--trust"]
    assert main(study) == 0 and "failed" not in capsys.readouterr().out
    shutil.rmtree(desk)
    CONTROLLERS.pop("proportional")
    options._loaded.clear()  # as in a new process
    assert main(["study", "repeat", "out", "--row", "0", "--trust"]) == 0
    assert "proportional" in capsys.readouterr().out


def test_linear_analysis_refuses_nonlinear_controllers(desk, capsys):
    assert main(["bode", str(desk / "run.yaml"), "--trust"]) == 2
    assert "controller.kind proportional: has no linear feedback" in capsys.readouterr().err


def test_controller_file_is_run_once(desk, tmp_path):
    @trusting(True)
    def load_trusted(file):
        load_controllers(file)

    text = OWN.read_text() + "\nopen('ran', 'a').write('x')\n"
    for name in ("a.py", "b.py"):
        (tmp_path / name).write_text(text)
        load_trusted(tmp_path / name)
    assert Path("ran").read_text() == "x"
    first = CONTROLLERS["proportional"]
    (tmp_path / "c.py").write_text(OWN.read_text())
    load_trusted(tmp_path / "c.py")
    assert CONTROLLERS["proportional"] is not first
    load_trusted(tmp_path / "a.py")  # the name is what this file says again
    assert CONTROLLERS["proportional"] is first and Path("ran").read_text() == "x"


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("2 * n)\n", "n)\n", rf"{CLASS}: input 'sampled_state' .*4, expected 8"),
        ("super().__init__()", "pass", rf"{CLASS}: __init__ of Proportional declares ports first"),
        ("self._gain * (", "sys.exit(0) * (", rf"{CLASS}: fails \(SystemExit: 0\)"),
        (
            "    def _calc(self, context, output):\n",
            "    def _calc(self, context, output):\n"
            "        self._gain = self._gain if context.get_time() < 0.2 else np.inf\n",
            rf"{CLASS}: tau_cmd of joint 1 is -?inf at 0\.2 s",
        ),
        (
            "inputs = {",
            "inputs = {self.DeclareVectorInputPort('tau_limited', n).ticket(), ",
            rf"{CLASS}: its torque depends on tau_limited at once, .*an algebraic loop",
        ),
    ],
)
def test_faulty_controller_is_one_line(desk, capsys, old, new, message):
    text = "import sys\nimport numpy as np\n" + OWN.read_text()
    assert old in text
    (desk / "own.py").write_text(text.replace(old, new))
    assert main(["simulate", str(desk / "run.yaml"), "--out", "run.csv", "--trust"]) == 2
    error = capsys.readouterr().err
    assert re.search(message, error) and error.count("\n") == 1
    assert not Path("run.csv").exists()


# --- names up to 0.4 -------------------------------------------------------------------------

ON_TIME = OWN.read_text().replace("sampled_state", "measured")
RESTS = "    def rest(self, context, tau, start=None):\n        self.rested = [tau, start]\n\n"


@pytest.mark.parametrize(
    ("new", "old", "warning"),
    [
        (
            '"measured"',
            '"state"',
            rf"{CLASS}: its input 'state' is 'measured' now, and goes in 0\.7",
        ),
        (
            "    def _calc",
            f"{RESTS}    def _calc",
            r"Proportional\.rest is set_steady_state now, and goes in 0\.7",
        ),
    ],
    ids=["state", "rest"],
)
def test_controller_with_names_of_0_4_works_and_warns(desk, new, old, warning):
    def run(text):
        (desk / "own.py").write_text(text)
        design = sdt.design(sdt.load(desk / "run.yaml", trust=True))
        return sdt.simulate(design)

    today = run(ON_TIME)
    with pytest.warns(DeprecationWarning, match=warning) as warned:
        before = run(ON_TIME.replace(new, old))
    assert len(warned) == 1
    np.testing.assert_array_equal(before.v, today.v)
