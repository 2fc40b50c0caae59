"""Small files for tests of commands, and fixtures that run a command in this process."""

import csv
import itertools
import re
import subprocess
import sys
import warnings
from typing import NamedTuple

import pytest

from sdt_drake.cli.app import main
from sdt_drake.io.resources import models_dir

MODELS = models_dir()
SDF = (MODELS / "sdt.sdf").read_text(encoding="utf-8")
FIGURE = {"png": b"\x89PNG", "svg": b"<?xml", "pdf": b"%PDF"}
AXIS, RUN = "../given/short_axis.yaml", "../given/run.yaml"  # of 0.5 s
SHORT_MOTION = "../given/short.yaml"
WRITERS = {
    "plan": ([SHORT_MOTION], "csv"),
    "tune": ([SHORT_MOTION], "png"),
    "step": ([], "png"),
    "simulate": ([RUN], "csv"),
    "compare": ([RUN, "--controllers", "pi"], "csv"),
    "pilot": ([RUN], "csv"),
    "budget": ([AXIS], "csv"),
    "bode": ([AXIS], "csv"),
    "stability": ([AXIS], "png"),
    "diagram": ([RUN], "dot"),
}
"""Arguments and a suffix of --out, by commands that compute something for --out."""

# 0.5 s of the four joints: joint 2 up to 0.5 rad/s and on, the others at rest.
REST = "  - !Knots {knots: [[0, 0], [0.5, 0]]}\n"
TURN = "  - !Knots {knots: [[0, 0], [0.25, 0.5], [0.5, 0.5]]}\n"
SHORT = "name: short\nduration: 0.5\njoints:\n" + REST + TURN + 2 * REST
# 1.25 s: the same, at constant speed for so long that its error counts.
MOTION = SHORT.replace("0.5], [0.5,", "0.5], [1.25,").replace("[0.5, 0]]", "[1.25, 0]]")
MOTION = MOTION.replace("duration: 0.5", "duration: 1.25")
CONTROLLER = "controller: {kind: pi, omega_r: 65.991, zeta: [0.95, 0.98, 0.99, 0.95]"
SCENARIO = f"motion: motion.yaml\nplant: {{kind: axis}}\n{CONTROLLER}}}\n"
ENDS = {"axis": SCENARIO, "coupled": SCENARIO.replace("kind: axis", "kind: coupled")}

# Two links of 2 kg and 1 m, centre of mass in the middle, I_yy = 0.2 kg m² about it; both turn
# about y (gravity acts), at q = 0 they point along x.
LINK = (
    "<link name='{name}'>{pose}<inertial><pose>0.5 0 0 0 0 0</pose><mass>2</mass><inertia>"
    "<ixx>0.01</ixx><iyy>0.2</iyy><izz>0.2</izz></inertia></inertial></link>"
)
JOINT = (
    "<joint name='{name}' type='revolute'>{pose}<parent>{parent}</parent><child>{child}</child>"
    "<axis><xyz>0 1 0</xyz><limit><effort>100</effort><velocity>5</velocity></limit></axis>"
    "<drake:rotor_inertia>0.001</drake:rotor_inertia><drake:gear_ratio>20</drake:gear_ratio>"
    "</joint>"
)
ELBOW = "<pose relative_to='upper'>1 0 0 0 0 0</pose>"
ARM = (
    "<sdf version='1.9' xmlns:drake='http://drake.mit.edu'><model name='two_links'>"
    + LINK.format(name="upper", pose="")
    + LINK.format(name="lower", pose="<pose relative_to='elbow'/>")
    + JOINT.format(name="shoulder", pose="", parent="world", child="upper")
    + JOINT.format(name="elbow", pose=ELBOW, parent="upper", child="lower")
    + "</model></sdf>"
)
ARM_PROFILE = """\
duration: 0.5
joints:
  - !Knots {knots: [[0, 0], [0.25, 0.2], [0.5, 0]]}
  - !Knots {knots: [[0, 0], [0.25, -0.2], [0.5, 0]]}
"""


class Done(NamedTuple):
    """The result of a command: exit code, stdout, stderr."""

    code: int
    out: str
    err: str


def program(*arguments: str, **options) -> Done:
    """Run a command in a process of its own."""
    command = [sys.executable, "-m", "sdt_drake", *arguments]
    done = subprocess.run(command, capture_output=True, text=True, **options)
    return Done(done.returncode, done.stdout, done.stderr)


@pytest.fixture
def call(capfd):
    """Run a command in this process. Warnings are printed, as they are outside of pytest."""

    def run(*arguments) -> Done:
        capfd.readouterr()
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("default")
            code = main([str(argument) for argument in arguments])
        out, err = capfd.readouterr()
        return Done(code, out, err + "".join(f"{warning.message}\n" for warning in caught))

    return run


@pytest.fixture
def good(call):
    """Run a command that must succeed and print nothing on stderr."""

    def run(*arguments) -> Done:
        done = call(*arguments)
        assert (done.code, done.err) == (0, "")
        return done

    return run


@pytest.fixture
def desk(tmp_path, monkeypatch):
    """An empty working directory; scenarios and motions lie in another one, `../given`."""
    given, folder = tmp_path / "given", tmp_path / "desk"
    given.mkdir()
    folder.mkdir()
    files = {"short.yaml": SHORT, "motion.yaml": MOTION, "arm.sdf": ARM, "arm.yaml": ARM_PROFILE}
    files |= {f"{name}.yaml": text for name, text in ENDS.items()}
    files["run.yaml"] = ENDS["coupled"].replace("motion.yaml", "short.yaml")
    files["cascade.yaml"] = files["run.yaml"].replace("kind: pi,", "kind: p_pi,")
    files["short_axis.yaml"] = SCENARIO.replace("motion.yaml", "short.yaml")
    for name, text in files.items():
        (given / name).write_text(text, encoding="utf-8")
    monkeypatch.chdir(folder)
    return folder


@pytest.fixture
def given(desk):
    """Write a file into `../given` and return its path."""

    def write(name: str, text: str) -> str:
        (desk.parent / "given" / name).write_text(text, encoding="utf-8")
        return f"../given/{name}"

    return write


@pytest.fixture
def refuse(call, desk):
    """Run a command that must fail with one line and write nothing, and return that line.

    If `late`, it may print something before.
    """

    def run(*arguments, saying=(), late=False) -> str:
        before = snapshot(desk.parent)
        done = call(*arguments)
        refused(done._replace(out="") if late else done, *saying)
        assert snapshot(desk.parent) == before
        return done.err

    return run


def refused(done: Done, *parts: str) -> None:
    """Exit code 2, nothing printed, one line on stderr with all `parts` in it."""
    assert (done.code, done.out) == (2, ""), done
    assert is_one_line(done.err), done.err
    for part in parts:
        assert part in done.err, done.err


def is_one_line(text: str) -> bool:
    return text.endswith("\n") and text.count("\n") == 1 and text.startswith("sdt-drake: ")


def snapshot(folder) -> dict:
    """Every file below a folder with its content, and every other folder with None."""
    every = (path for path in folder.rglob("*") if path.exists() and not path.is_symlink())
    return {str(x.relative_to(folder)): x.read_bytes() if x.is_file() else None for x in every}


def columns_of(out: str) -> dict[str, list[str]]:
    """Return the columns of the first table in `out`; the second of a name is `name 2`."""
    rows = [re.split(r"\s{2,}", line.strip()) for line in out.splitlines()]
    first = next(k for k, cells in enumerate(rows) if len(cells) > 2)
    table = itertools.takewhile(lambda cells: len(cells) > 2, rows[first:])
    columns = {}
    for header, *cells in zip(*table, strict=True):
        columns[header if header not in columns else f"{header} 2"] = cells
    return columns


def numbers(cells: list[str]) -> list[float]:
    return [float(cell) for cell in cells]


def read_csv(path) -> list[list[str]]:
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.reader(file))
