"""`sdt-drake` as a user meets it: every command and option, and one line for every mistake."""

from __future__ import annotations

import json
import os
import re
import resource
import shlex
import shutil
import signal
import subprocess
import sys
import warnings
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import sdt_drake
from sdt_drake.analysis import page, report, study
from sdt_drake.cli import main
from sdt_drake.graphviz import dot_text
from sdt_drake.loops import make_loop
from sdt_drake.motion import Motion
from sdt_drake.resources import models_dir
from sdt_drake.tables import read_table

COMMANDS = ("reproduce", "plan", "tune", "step", "simulate", "diagram")
MODELS = models_dir()
SDF = (MODELS / "sdt.sdf").read_text(encoding="utf-8")
SCENARIOS = sorted(path.stem for path in (MODELS / "scenarios").glob("*.yaml"))
OMEGA_R = 65.991

needs_graphviz = pytest.mark.skipif(shutil.which("dot") is None, reason="needs Graphviz")
needs_proc = pytest.mark.skipif(not os.path.isdir("/proc/self"), reason="needs /proc")

# 0.5 s of the four joints: joint 2 up to 0.5 rad/s and on, the others at rest.
REST = "  - !Knots {knots: [[0, 0], [0.5, 0]]}\n"
SHORT = (
    "name: short\nduration: 0.5\njoints:\n"
    + REST
    + "  - !Knots {knots: [[0, 0], [0.25, 0.5], [0.5, 0.5]]}\n"
    + REST
    + REST
)
SCENARIO = """\
name: {name}
motion: {motion}
plant: {{kind: coupled}}
controller: {{kind: pi, omega_r: 65.991, zeta: [0.95, 0.98, 0.99, 0.95]}}
"""

# Two links of 2 kg and 1 m, centre of mass in the middle, I_yy = 0.2 kg m² about it; both turn
# about y (gravity acts), at q = 0 they point along x.
LINK = (
    "<link name='{name}'>{pose}<inertial><pose>0.5 0 0 0 0 0</pose><mass>2</mass><inertia>"
    "<ixx>0.01</ixx><iyy>0.2</iyy><izz>0.2</izz><ixy>0</ixy><ixz>0</ixz><iyz>0</iyz></inertia>"
    "</inertial></link>"
)
JOINT = (
    "<joint name='{name}' type='revolute'>{pose}<parent>{parent}</parent><child>{child}</child>"
    "<axis><xyz>0 1 0</xyz><limit><effort>100</effort><velocity>5</velocity></limit></axis>"
    "<drake:rotor_inertia>0.001</drake:rotor_inertia><drake:gear_ratio>20</drake:gear_ratio>"
    "</joint>"
)
ARM = (
    "<sdf version='1.9' xmlns:drake='http://drake.mit.edu'><model name='two_links'>"
    + LINK.format(name="upper", pose="")
    + LINK.format(name="lower", pose="<pose relative_to='elbow'/>")
    + JOINT.format(name="shoulder", pose="", parent="world", child="upper")
    + JOINT.format(
        name="elbow",
        pose="<pose relative_to='upper'>1 0 0 0 0 0</pose>",
        parent="upper",
        child="lower",
    )
    + "</model></sdf>"
)
ARM_PROFILE = """\
duration: 0.5
joints:
  - !Knots {knots: [[0, 0], [0.25, 0.2], [0.5, 0]]}
  - !Knots {knots: [[0, 0], [0.25, -0.2], [0.5, 0]]}
"""


# --- running ---------------------------------------------------------------------------------


@dataclass
class Done:
    """What a command returned and printed."""

    code: int
    out: str
    err: str


def read_printed_table(text):
    """Header and rows of the aligned table in `text`."""
    lines = text.splitlines()
    (start,) = [i for i, line in enumerate(lines) if line.startswith("joint  ")]
    rows = []
    for line in lines[start + 1 :]:
        if not re.match(r"\d+ ", line):
            break
        rows.append(re.split(r"\s{2,}", line.strip()))
    return re.split(r"\s{2,}", lines[start].strip()), rows


@pytest.fixture
def call(capfd):
    """Run a command in this process. Warnings are printed, as they are outside of pytest."""

    def run(*arguments):
        capfd.readouterr()
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("default")
            try:
                code = main([str(a) for a in arguments])
            except SystemExit as stop:
                code = stop.code
        out, err = capfd.readouterr()
        return Done(
            code, out, err + "".join(f"{w.category.__name__}: {w.message}\n" for w in caught)
        )

    return run


@pytest.fixture
def good(call):
    """Run a command that must succeed and say nothing on stderr."""

    def run(*arguments):
        done = call(*arguments)
        assert (done.code, done.err) == (0, "")
        return done

    return run


def command(*arguments, cwd, **options):
    """Run the real command in a process of its own."""
    options = {"capture_output": True, "text": True, "timeout": 100} | options
    return subprocess.run(
        [sys.executable, "-m", "sdt_drake", *map(str, arguments)], cwd=cwd, **options
    )


@pytest.fixture(scope="module", autouse=True)
def _reproducing(tmp_path_factory):
    """`sdt-drake reproduce` takes the longest: it runs beside the other tests."""
    folder = tmp_path_factory.mktemp("reproduce")
    process = subprocess.Popen(
        [sys.executable, "-m", "sdt_drake", "reproduce", "--out", "some/results"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=folder,
    )
    yield process, folder
    process.kill()
    process.communicate()


def snapshot(folder):
    """Every file below a folder with its content."""
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file() and not path.is_symlink()
    }


def is_one_line(text):
    return text.endswith("\n") and text.count("\n") == 1 and text.startswith("sdt-drake: ")


@pytest.fixture
def desk(tmp_path, monkeypatch):
    """A working directory with small inputs, good and bad."""
    folder = tmp_path / "desk"
    folder.mkdir()
    monkeypatch.chdir(folder)
    (folder / "short.yaml").write_text(SHORT, encoding="utf-8")
    (folder / "run.yaml").write_text(SCENARIO.format(name="run", motion="short.yaml"))
    (folder / "arm.sdf").write_text(ARM, encoding="utf-8")
    (folder / "arm.yaml").write_text(ARM_PROFILE, encoding="utf-8")
    (folder / "folder").mkdir()
    (folder / "folder.csv").mkdir()
    (folder / "folder.png").mkdir()
    (folder / "file").write_text("a regular file")
    return folder


# --- the program as a whole ------------------------------------------------------------------


def test_version(tmp_path):
    done = command("--version", cwd=tmp_path)

    assert (done.returncode, done.stdout, done.stderr) == (
        0,
        f"sdt-drake {sdt_drake.__version__}\n",
        "",
    )


def test_bad_input_in_a_process_of_its_own(tmp_path):
    done = command("simulate", "nowhere.yaml", cwd=tmp_path)

    assert done.returncode == 2
    assert is_one_line(done.stderr) and "nowhere.yaml" in done.stderr
    assert done.stdout == "" and list(tmp_path.iterdir()) == []


def test_help_lists_all_commands(good):
    out = good("--help").out

    for name in COMMANDS:
        assert re.search(rf"^\s+{name}\b", out, re.M), name
    assert "example: sdt-drake" in out


@pytest.mark.parametrize("name", COMMANDS)
def test_help_of_a_command(good, name):
    out = " ".join(good(name, "--help").out.split())

    assert f"example: sdt-drake {name}" in out
    for option in re.findall(r"(--[a-z-]+)", out):
        assert re.search(rf"{option}\b", out)
    assert "--help" in out


@pytest.mark.parametrize("name", [name for name in COMMANDS if name != "reproduce"])
def test_the_example_of_the_help_works(good, tmp_path, monkeypatch, name):
    out = " ".join(good(name, "--help").out.split())
    arguments = shlex.split(out.partition(f"example: sdt-drake {name}")[2])
    if "svg" in arguments and shutil.which("dot") is None:
        pytest.skip("needs Graphviz")
    monkeypatch.chdir(tmp_path)

    good(name, *arguments)
    written = [path.name for path in tmp_path.iterdir()]
    assert written == (arguments[-1:] if "--out" in arguments else [])


# --- plan ------------------------------------------------------------------------------------


def test_plan_of_the_reference_motion(good):
    done = good("plan")
    _, rows = read_printed_table(done.out)

    assert "30 s" in done.out and "6001 samples" in done.out
    # reference_design.md: peak use 0.82, 0.93, 0.30, 0.23 of the motors; limiter idle;
    # pitch -9.9 to 1.6 deg, yaw -10.5 to 18.0 deg.
    assert [row[0] for row in rows] == ["1 planetary", "2 roll", "3 pitch", "4 yaw"]
    assert [float(row[2]) for row in rows] == pytest.approx([82, 93, 30, 23], abs=0.5)
    assert [float(row[4]) for row in rows] == [0, 0, 0, 0]
    assert [float(row[5]) for row in rows] == pytest.approx([2.4, 1.5, 0.1257, 0.2093], abs=6e-4)
    assert rows[2][7:9] == ["-9.9", "1.6"] and rows[3][7:9] == ["-10.5", "18.0"]
    assert "smallest margin: 7.2 %, torque of joint 2 'roll' at 9.000 s" in done.out


def test_plan_retimes_what_the_limiter_refuses(good, call, desk):
    text = (MODELS / "motions" / "reference.yaml").read_text(encoding="utf-8")
    assert text.count("2.4]") == 2
    (desk / "fast.yaml").write_text(text.replace("2.4]", "2.95]"), encoding="utf-8")
    done = call("plan", "fast.yaml")
    assert done.code == 2 and "joint 2 'roll' at 6.355 s needs torque 3956.91 N m" in done.err
    done = good(
        "plan", "fast.yaml", "--planner", "retiming", "--out", "fast.png",
        "--drive-table", "drives.csv", "--envelope", "package://sdt/scenarios/real_device.yaml",
    )  # fmt: skip
    assert "s longer than commanded" in done.out
    assert (desk / "fast.png").stat().st_size > 20_000
    _, columns = read_table(desk / "drives.csv")
    limits = np.array([203.2, 3950, 2150, 2150])
    assert np.all(np.abs(columns["tau_motor"]) <= limits + 1e-6)
    assert np.abs(columns["v_motor"][:, 0]).max() == pytest.approx(2.95 * 67.2, rel=1e-4)


def test_plan_takes_a_csv_of_any_period_and_says_what_it_lost(good, desk):
    rows = [f"{0.04 * i:g},{0.02 * min(i, 5, 25 - i):g},0,0,0" for i in range(26)]
    text = "\n".join(["time,v_ref_1,v_ref_2,v_ref_3,v_ref_4", *rows])
    (desk / "in.csv").write_text(text, encoding="utf-8")
    done = good("plan", "in.csv", "--out", "out.csv")
    assert "resampled at 0.005 s: at most" in done.out
    assert Motion.from_csv(desk / "out.csv").period == 0.005


@pytest.mark.parametrize(
    "options, words",
    [
        (("--drive-table", "t.txt"), ("--drive-table: t.txt", ".csv")),
        (("--drive-table", "a.csv", "--out", "a.csv"), ("--drive-table: a.csv", "--out")),
        # The other one would be good: neither is written.
        (("--drive-table", "t.csv", "--out", "file/o.csv"), ("file", "expected a folder")),
        (("--drive-table", "file/t.csv", "--out", "o.csv"), ("file", "expected a folder")),
        (
            ("--drive-table", "t.csv", "--out", "o.csv"),
            ("t.csv: joint 2 'roll' ends at 0.5 rad/s",),
        ),
        (("--envelope", "run.yaml"), ("run.yaml: drive.n1 and drive.n0 missing",)),
    ],
)
def test_plan_refuses_outputs_and_envelopes_that_cannot_be(call, desk, options, words):
    before = set(desk.iterdir())
    done = call("plan", "short.yaml", *options)
    assert (done.code, done.out) == (2, "") and len(done.err.splitlines()) == 1, done.err
    assert all(word in done.err for word in words), done.err
    assert set(desk.iterdir()) == before


def test_plan_writes_a_motion_that_every_command_takes(good, desk):
    first = good("plan", "short.yaml", "--out", "sub/motion.csv")
    motion = Motion.from_csv(desk / "sub" / "motion.csv")

    assert (motion.period, motion.n, len(motion.time)) == (0.005, 4, 101)
    np.testing.assert_allclose(motion.v[[25, 50, 100], 1], [0.25, 0.5, 0.5], atol=1e-12)
    assert motion.q[-1, 1] == pytest.approx(0.5 * 0.25 * 0.5 + 0.25 * 0.5)
    assert first.out.splitlines()[-1] == "sub/motion.csv written"
    again = good("plan", "sub/motion.csv", "--out", "again.csv")
    assert read_printed_table(again.out) == read_printed_table(first.out)
    assert (desk / "again.csv").read_bytes() == (desk / "sub" / "motion.csv").read_bytes()
    assert good("tune", "sub/motion.csv").out == good("tune", "short.yaml").out
    (desk / "csv.yaml").write_text(SCENARIO.format(name="run", motion="sub/motion.csv"))
    assert good("simulate", "csv.yaml").out == good("simulate", "run.yaml").out


def test_plan_at_another_period(good, desk):
    done = good("plan", "short.yaml", "--period", "0.01", "--out", "motion.csv")

    assert "51 samples" in done.out
    assert Motion.from_csv(desk / "motion.csv").period == 0.01
    good("plan", "motion.csv", "--period", "0.01")


def test_plan_with_a_margin_limits_the_accelerations(good, desk):
    rest = "  - !Knots {knots: [[0, 0], [1.5, 0]]}\n"
    (desk / "arm_only.yaml").write_text(
        "duration: 1.5\njoints:\n  - !Knots {knots: [[0, 0], [0.5, 0.1], [1.5, 0.1]]}\n" + 3 * rest
    )
    inertia = 4.0424 * 67.2**2  # of the arm at q = 0, motor side 4.0424 kg m²
    free = read_printed_table(good("plan", "arm_only.yaml").out)[1][0]
    assert float(free[1]) == pytest.approx(0.2 * inertia, rel=1e-3) and float(free[4]) == 0
    done = good("plan", "arm_only.yaml", "--torque-margin", "0.1")
    limited = read_printed_table(done.out)[1][0]

    torque = 0.1 * 203.2 * 67.2  # published
    assert float(limited[1]) == pytest.approx(torque, abs=0.1)
    assert float(limited[2]) == pytest.approx(10.0, abs=0.05)
    assert float(limited[4]) == pytest.approx(0.1 * inertia / torque, abs=0.01)  # later at speed
    assert float(limited[5]) == pytest.approx(0.1)


# --- tune ------------------------------------------------------------------------------------


def test_tune_reproduces_table_1(good):
    header, rows = read_printed_table(good("tune").out)

    assert header[0] == "joint" and len(header) == len(rows[0])
    columns = list(zip(*rows, strict=True))
    assert [float(x) for x in columns[1]] == pytest.approx([4.26, 98.01, 796.3, 250.28], rel=1e-4)
    assert [float(x) for x in columns[2]] == pytest.approx([4.004, 77.61, 792.1, 250.28], rel=2e-4)
    assert [float(x) for x in columns[3]] == pytest.approx([3.830, 66.82, 774.84, 250.28], rel=2e-4)
    assert [float(x) for x in columns[4]] == pytest.approx([10.09, 31.82, 2.69, 0], abs=0.006)
    assert [float(x) for x in columns[5]] == pytest.approx([267.1, 6340, 52000, 15700], rel=1e-3)
    assert [float(x) for x in columns[6]] == pytest.approx([4640, 107000, 867000, 272480], rel=3e-3)
    assert [float(x) for x in columns[7]] == [0.95, 0.98, 0.99, 0.95]


def test_tune_says_where_the_bandwidth_rule_breaks(good, desk):
    (note,) = [line for line in good("tune").out.splitlines() if line.startswith("note")]

    # omega_n / omega_r at the smallest inertia: 0.5 sqrt(max / min).
    assert "1, 2, 3" in note and "4" not in note
    (desk / "rest.yaml").write_text(f"duration: 0.5\njoints:\n{REST * 4}")
    assert "note" not in good("tune", "rest.yaml").out


def test_tune_says_what_is_published(call, good, desk):
    """Of the shipped device alone: another robot has to say its own frequency."""
    both = "omega_r = 65.991 rad/s (published for the shipped device), zeta at the largest inertia "
    assert f"{both}(published" in good("tune", "short.yaml").out
    own = good("tune", "short.yaml", "--omega-r", "30", "--zeta", "1", "1", "1", "1").out
    assert "omega_r = 30 rad/s (--omega-r), zeta at the largest inertia (--zeta)" in own

    done = call("tune", "arm.yaml", "--robot", "arm.sdf", "--out", "x.png")
    assert (done.code, done.out) == (2, "") and is_one_line(done.err)
    assert "--omega-r: missing" in done.err and "65.991" in done.err
    assert not (desk / "x.png").exists()
    other = good("tune", "arm.yaml", "--robot", "arm.sdf", "--omega-r", "30").out
    assert "omega_r = 30 rad/s (--omega-r), zeta at the largest inertia (default)" in other


def test_step_says_what_is_published(good):
    first = "p_in_feedback: inertia 4.26 kg m², omega_r = 65.991 rad/s, zeta 1"
    assert good("step").out.startswith(f"{first} (inertia and omega_r published for the shipped")
    own = good("step", "--inertia", "3").out
    assert "inertia 3 kg m²" in own and "(omega_r published" in own
    assert "published" not in good("step", "--inertia", "3", "--omega-r", "20").out


def test_tune_options(good, desk):
    base = read_printed_table(good("tune", "short.yaml").out)[1]
    doubled = read_printed_table(
        good("tune", "short.yaml", "--omega-r", 2 * OMEGA_R, "--zeta", 1, 1.5, 2, 0.5).out
    )[1]
    for k, (before, after, zeta) in enumerate(zip(base, doubled, (1, 1.5, 2, 0.5), strict=True)):
        i_eff = float(before[1])
        assert float(after[6]) == pytest.approx(OMEGA_R**2 * i_eff, rel=1e-3), k
        assert float(after[5]) == pytest.approx(2 * zeta * OMEGA_R * i_eff, rel=1e-3), k
        assert float(after[7]) == zeta


# --- step ------------------------------------------------------------------------------------


def printed_numbers(out):
    return {m[1]: float(m[2]) for m in re.finditer(r"^([a-z ]+?)\s{2,}(\S+)", out, re.M)}


def test_step_of_both_structures(good):
    # Closed form of the loop with zeta 1: the zero of "pi" gives an overshoot of exp(-2).
    pi = printed_numbers(good("step", "--structure", "pi", "--zeta", "1").out)
    assert pi["overshoot"] == pytest.approx(100 * np.exp(-2), rel=1e-3)
    assert pi["peak"] == pytest.approx(1 + np.exp(-2), rel=1e-4)
    assert pi["peak time"] == pytest.approx(2 / (OMEGA_R / 2), rel=0.01)
    assert pi["rise time"] == pytest.approx(0.022, abs=5e-4)
    p = printed_numbers(good("step", "--zeta", "0.95").out)
    assert p["rise time"] == pytest.approx(0.0944, rel=0.01)
    assert p["settling time"] == pytest.approx(0.1594, rel=0.01)
    # exp(-pi zeta / sqrt(1 - zeta²))
    assert p["overshoot"] == pytest.approx(0.00706, abs=2e-4)


def test_step_does_not_depend_on_the_inertia_it_is_tuned_for(good):
    small = printed_numbers(good("step", "--inertia", "0.01").out)
    large = printed_numbers(good("step", "--inertia", "800").out)

    assert small == pytest.approx(large, rel=1e-3, abs=1e-6)


def test_step_scales_with_the_structural_frequency(good):
    base = printed_numbers(good("step").out)
    fast = printed_numbers(good("step", "--omega-r", 2 * OMEGA_R).out)

    assert fast["rise time"] == pytest.approx(base["rise time"] / 2, rel=0.01)
    assert fast["settling time"] == pytest.approx(base["settling time"] / 2, rel=0.01)


def test_step_of_a_soft_structure_settles(good):
    """omega_r = 10 rad/s: zeta 1 rises in 3.36 / omega_n = 0.67 s and settles in 1.17 s."""
    slow = printed_numbers(good("step", "--omega-r", "10").out)

    assert slow["rise time"] == pytest.approx(3.358 / 5, rel=0.01)
    assert slow["settling time"] == pytest.approx(5.834 / 5, rel=0.01)


@pytest.mark.parametrize(
    ("suffix", "magic"), [("png", b"\x89PNG"), ("svg", b"<?xml"), ("pdf", b"%PDF")]
)
def test_step_writes_a_figure(good, desk, suffix, magic):
    done = good("step", "--out", f"a/b/step.{suffix}")

    assert (desk / "a" / "b" / f"step.{suffix}").read_bytes().startswith(magic)
    assert done.out.splitlines()[-1] == f"a/b/step.{suffix} written"


@pytest.mark.parametrize(
    "arguments", [("--zeta", "1e9"), ("--omega-r", "1e9")], ids=["zeta", "omega_r"]
)
def test_step_of_an_absurdly_stiff_loop_ends(tmp_path, arguments):
    """Answer or refuse, but do not hang."""
    done = command("step", *arguments, cwd=tmp_path, timeout=20)

    assert done.returncode in (0, 2)
    assert done.stderr == "" or is_one_line(done.stderr)


# --- simulate --------------------------------------------------------------------------------


def test_simulate_prints_and_writes_the_same_run(good, desk):
    done = good("simulate", "run.yaml", "--out", "out.csv")
    time, columns = read_table(desk / "out.csv")

    assert "pi on the coupled plant" in done.out and done.out.startswith("run:")
    np.testing.assert_allclose(time, 0.005 * np.arange(101), atol=1e-12)
    assert list(columns) == [
        "v_ref", "v", "tau_cmd", "tau", "load_torque", "speed_error", "q_ref", "q", "tau_limited",
        "tau_peak", "tau_rms", "saturated", "beyond_stop",
    ]  # fmt: skip
    _, rows = read_printed_table(done.out)
    error = columns["speed_error"]
    assert [float(row[1]) for row in rows] == pytest.approx(np.abs(error).max(axis=0), abs=6e-5)
    rms = np.sqrt(np.mean(error**2, axis=0))
    assert [float(row[2]) for row in rows] == pytest.approx(rms, abs=6e-5)
    assert np.abs(error[:, 1]).max() > 0.03  # the lag: 2 zeta / omega_n * 2 rad/s²


@pytest.mark.parametrize("suffix", ["png", "svg"])
def test_simulate_writes_a_figure(good, desk, suffix):
    good("simulate", "run.yaml", "--out", f"run.{suffix}")

    assert (desk / f"run.{suffix}").stat().st_size > 5_000


def test_simulate_a_shipped_scenario(good):
    done = good("simulate", "package://sdt/scenarios/coupled_pi_ctc.yaml")
    _, rows = read_printed_table(done.out)

    largest = (0.0273, 0.1865, 0.0112, 0.0523)  # reference_design.md
    assert [float(row[1]) for row in rows] == pytest.approx(largest, rel=0.02)


def test_simulate_starts_at_speed_without_a_jolt(good, desk):
    """A motion at constant speed throughout, without gravity or coupling, has no error to show."""
    profile = f"duration: 0.5\njoints:\n{REST * 3}  - !Knots {{knots: [[0, 0.2], [0.5, 0.2]]}}\n"
    (desk / "spin.yaml").write_text(profile)
    (desk / "spinning.yaml").write_text(SCENARIO.format(name="spin", motion="spin.yaml"))
    _, rows = read_printed_table(good("simulate", "spinning.yaml").out)

    assert float(rows[3][1]) < 1e-3


def test_simulate_a_motion_of_one_period(good, desk):
    one = SHORT.replace("[0.25, 0.5], ", "").replace("0.5", "0.005")
    (desk / "short.yaml").write_text(one)
    done = good("simulate", "run.yaml", "--out", "one.csv")

    assert len(read_printed_table(done.out)[1]) == 4
    assert len(read_table(desk / "one.csv")[0]) == 2
    good("simulate", "run.yaml", "--out", "one.png")


def test_simulate_a_motion_without_motion(good, desk):
    (desk / "short.yaml").write_text(f"duration: 0.5\njoints:\n{REST * 4}")
    _, rows = read_printed_table(good("simulate", "run.yaml", "--out", "rest.png").out)

    assert [float(row[1]) for row in rows] == [0, 0, 0, 0]


# --- diagram ---------------------------------------------------------------------------------


@pytest.mark.parametrize("name", SCENARIOS)
def test_diagram_of_every_scenario(good, desk, make_variant, name):
    good("diagram", f"package://sdt/scenarios/{name}.yaml")

    expected = dot_text(make_loop(make_variant(name)))
    assert (desk / f"{name}.dot").read_text(encoding="utf-8") == expected


def test_diagram_is_named_after_the_scenario(good, desk):
    (desk / "plain.yaml").write_text((desk / "run.yaml").read_text().replace("name: run\n", ""))

    assert good("diagram", "plain.yaml").out == "plain.dot written\n"
    assert good("diagram", "run.yaml", "--out", "x/y.dot").out == "x/y.dot written\n"
    assert (desk / "plain.dot").read_bytes() == (desk / "x" / "y.dot").read_bytes()


def test_diagram_depth(good, desk):
    for depth in (0, 2, 7):
        good("diagram", "run.yaml", "--depth", depth, "--out", f"{depth}.dot")

    assert "K_PS" not in (desk / "0.dot").read_text()
    assert "K_PS" in (desk / "2.dot").read_text()
    assert len((desk / "7.dot").read_text()) >= len((desk / "2.dot").read_text())


def test_diagram_as_drake_draws_it(good, desk, make_variant):
    good("diagram", "run.yaml", "--drake", "--depth", 0)

    assert (desk / "run.dot").read_text(encoding="utf-8").count("PORT=") > 10


@needs_graphviz
@pytest.mark.parametrize(("format_", "magic"), [("svg", b"<?xml"), ("png", b"\x89PNG")])
def test_diagram_as_a_picture(good, desk, format_, magic):
    good("diagram", "run.yaml", "--format", format_)

    assert (desk / f"run.{format_}").read_bytes().startswith(magic)


def test_diagram_without_graphviz(call, desk, tmp_path, monkeypatch):
    empty = tmp_path / "empty"
    empty.mkdir()
    monkeypatch.setenv("PATH", str(empty))
    before = snapshot(desk)

    done = call("diagram", "run.yaml", "--format", "svg")
    assert done.code == 2 and is_one_line(done.err)
    assert "Graphviz" in done.err and "install" in done.err
    assert snapshot(desk) == before
    assert call("diagram", "run.yaml").code == 0


@needs_graphviz
def test_a_suffix_never_holds_another_format(call, desk):
    """`--out loop.svg` without --format: an SVG file or a refusal, but no .dot text in it."""
    done = call("diagram", "run.yaml", "--out", "loop.svg")

    if done.code == 0:
        assert "<svg" in (desk / "loop.svg").read_text(encoding="utf-8")
    else:
        assert done.code == 2 and is_one_line(done.err)
        assert not (desk / "loop.svg").exists()


# --- what nobody foresaw ---------------------------------------------------------------------


@pytest.fixture
def faulty(monkeypatch):
    def run(options):
        warnings.warn("overflow", RuntimeWarning, stacklevel=1)
        raise ZeroDivisionError("x" * 100_000 + "\n\x1b[31m\ud800")

    monkeypatch.setattr("sdt_drake.commands.step.run", run)


def test_a_fault_is_one_short_line_that_says_in_what(call, faulty):
    done = call("step", "--zeta", "2")
    assert (done.code, done.out) == (70, "") and is_one_line(done.err) and len(done.err) < 1100
    assert done.err.startswith("sdt-drake: fault of the program, ZeroDivisionError (xxx")
    assert done.err.endswith(
        "x \\x1b[31m\\ud800), in: sdt-drake step --zeta 2; --traceback shows where\n"
    )


def test_a_fault_with_its_trace(call, faulty):
    done = call("step", "--traceback")
    assert done.code == 70 and "Traceback" in done.err and "in run\n" in done.err


def test_warnings_come_last_a_line_each(call, monkeypatch):
    def run(options):
        warnings.warn("two\nlines", RuntimeWarning, stacklevel=1)
        print("done")

    monkeypatch.setattr("sdt_drake.commands.step.run", run)
    assert call("step") == Done(0, "done\n", "sdt-drake: warning: two lines\n")


def test_the_folder_that_we_are_in_is_gone(call, desk):
    (desk / "gone").mkdir()
    os.chdir(desk / "gone")
    (desk / "gone").rmdir()
    done = call("step")
    assert (done.code, done.err) == (
        2, "sdt-drake: the current folder is gone, expected one that is there\n",
    )  # fmt: skip


@pytest.mark.parametrize("backend", ["module://no.such.one", "nonsense"])
def test_a_backend_that_is_not_there(tmp_path, backend):
    """Of a notebook, for one; only --show needs it."""
    environment = os.environ | {"MPLBACKEND": backend}
    done = command("step", "--out", "step.png", cwd=tmp_path, env=environment)
    assert (done.returncode, done.stderr) == (0, "")
    done = command("step", "--show", cwd=tmp_path, env=environment)
    assert done.returncode == 2 and is_one_line(done.stderr) and backend in done.stderr


@pytest.mark.parametrize("to", ["2>&-", "2>/dev/full", ">/dev/full 2>/dev/full"])
def test_nowhere_to_say_what_is_wrong(tmp_path, to):
    run = f"exec {shlex.quote(sys.executable)} -m sdt_drake simulate nowhere.yaml {to}"
    assert subprocess.run(["/bin/sh", "-c", run], cwd=tmp_path).returncode == 2


def _small_files():
    resource.setrlimit(resource.RLIMIT_FSIZE, (2000, 2000))


@pytest.mark.parametrize(
    ("name", "arguments"),
    [
        ("step.pdf", ["step", "--out", "step.pdf"]),
        pytest.param(
            "loop.svg", ["diagram", "run.yaml", "--out", "loop.svg"], marks=needs_graphviz
        ),
    ],
)
def test_a_disk_that_is_full_on_the_way(desk, name, arguments):
    """Neither matplotlib nor Graphviz says so in a way that could be passed on."""
    before = snapshot(desk)
    done = command(*arguments, cwd=desk, preexec_fn=_small_files)
    assert (done.returncode, done.stderr) == (
        2, f"sdt-drake: {name}: cannot be written (File too large)\n",
    )  # fmt: skip
    assert snapshot(desk) == before


def test_home_of_a_user(call, desk, monkeypatch):
    """As the shell has it in `--out ~/x`, but not in `--out=~/x`."""
    monkeypatch.setenv("HOME", str(desk / "folder"))
    assert call("step", "--out=~/step.png").code == 0
    assert (desk / "folder" / "step.png").is_file() and not (desk / "~").exists()
    done = call("step", "--out=~nobody_of_that_name/step.png")
    assert done.code == 2 and "~nobody_of_that_name/step.png: " in done.err


# --- pipes, interrupts, encodings ------------------------------------------------------------

PIPE = """
import sys
from types import SimpleNamespace
from sdt_drake.analysis import page, report, study
def run_study(watch):
    for name in ("first", "second", "third"):
        with watch.stage(name):
            pass
def write_study(_, folder, watch):
    (folder / "report.md").write_text("report")
    return [SimpleNamespace(id="a_claim", verdict="reproduced")]
study.run_study, report.write_study = run_study, write_study
page.write_study_page = lambda _, folder, *rest: folder / "report.html"
from sdt_drake.cli import main
sys.exit(main(sys.argv[1:]))
"""


def test_a_reader_that_has_enough_is_no_error(tmp_path):
    process = subprocess.Popen(
        [sys.executable, "-m", "sdt_drake", "tune"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=tmp_path,
    )
    process.stdout.close()  # like `| head -0`
    err = process.stderr.read()
    process.stderr.close()

    assert process.wait(60) == 0 and err == ""


def test_a_reader_that_has_enough_does_not_cost_the_results(tmp_path):
    """`reproduce | head -1` must write its files, or say that it did not."""
    process = subprocess.Popen(
        [sys.executable, "-c", PIPE, "reproduce", "--out", "out"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=tmp_path,
    )
    process.stdout.close()
    process.stderr.read()
    process.stderr.close()
    code = process.wait(60)

    assert (tmp_path / "out" / "report.md").is_file() or code != 0


def test_a_full_disk_behind_stdout_is_told(tmp_path):
    if not os.path.exists("/dev/full"):
        pytest.skip("needs /dev/full")
    with open("/dev/full", "w") as full:
        done = command(
            "step", cwd=tmp_path, stdout=full, stderr=subprocess.PIPE, capture_output=False
        )

    assert done.returncode == 2 and is_one_line(done.stderr)


def test_a_closed_stdout_is_no_crash(tmp_path):
    run = f"exec {shlex.quote(sys.executable)} -m sdt_drake step >&-"
    done = subprocess.run(["/bin/sh", "-c", run], cwd=tmp_path, stderr=subprocess.PIPE, text=True)

    assert done.returncode in (0, 2) and "Traceback" not in done.stderr


def test_ctrl_c_ends_quietly_and_leaves_nothing_half_written(tmp_path):
    process = subprocess.Popen(
        [sys.executable, "-m", "sdt_drake", "reproduce", "--out", "out"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=tmp_path,
    )
    first = process.stdout.readline()  # now it computes
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=60)

    assert "robot" in first
    assert process.returncode == 130 and err == ""
    assert not [path for path in tmp_path.rglob("*") if "partial" in path.name]


@pytest.mark.parametrize("arguments", [("tune",), ("step", "--help")], ids=["tune", "help"])
def test_a_terminal_that_knows_ascii_only(tmp_path, arguments):
    environment = os.environ | {"PYTHONIOENCODING": "ascii"}
    done = command(*arguments, cwd=tmp_path, env=environment)

    assert done.returncode == 0 and done.stderr == ""
    assert "kg m" in done.stdout


# --- other places, other robots --------------------------------------------------------------


def test_paths_in_a_scenario_start_from_its_folder(good, desk, tmp_path, monkeypatch):
    deep = desk / "päth with ☃" / "scenarios"
    deep.mkdir(parents=True)
    (desk / "päth with ☃" / "motion.yaml").write_text(SHORT, encoding="utf-8")
    text = SCENARIO.format(name="far", motion="../motion.yaml")
    (deep / "far.yaml").write_text(text, encoding="utf-8")
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    relative = os.path.relpath(deep / "far.yaml", elsewhere)
    monkeypatch.chdir(elsewhere)

    here = good("simulate", relative, "--out", "ergebnis ü.csv").out
    assert (elsewhere / "ergebnis ü.csv").is_file()
    monkeypatch.chdir(deep)
    assert good("simulate", "far.yaml").out == here.replace("ergebnis ü.csv written\n", "")


def test_plan_of_another_robot(good, desk):
    (desk / "still.yaml").write_text(
        "duration: 0.5\njoints:\n" + 2 * "  - !Knots {knots: [[0, 0], [0.5, 0]]}\n"
    )
    _, rows = read_printed_table(good("plan", "still.yaml", "--robot", "arm.sdf").out)

    # Held against gravity: 2 kg at 0.5 m, and 2 kg at 0.5 m and at 1.5 m.
    assert [row[0] for row in rows] == ["1 shoulder", "2 elbow"]
    assert [float(row[1]) for row in rows] == pytest.approx([39.24, 9.81], abs=0.06)
    assert [float(row[2]) for row in rows] == pytest.approx([39.2, 9.8], abs=0.06)


def test_tune_of_another_robot(good, desk):
    arguments = ("tune", "arm.yaml", "--robot", "arm.sdf", "--omega-r", OMEGA_R)
    _, rows = read_printed_table(good(*arguments).out)

    # Stretched at the start: I_m + d_kk / r², d_22 = 0.2 + 2 * 0.5², d_11 = d_22 + 0.2 + 2 * 1.5².
    i_eff = np.array([0.001 + 5.4 / 400, 0.001 + 0.7 / 400])
    assert [float(row[1]) for row in rows] == pytest.approx(i_eff, rel=1e-4)
    assert [float(row[6]) for row in rows] == pytest.approx(OMEGA_R**2 / 4 * i_eff, rel=1e-3)
    assert [float(row[7]) for row in rows] == [1, 1]


@pytest.mark.parametrize("plant", ["axis", "coupled"])
@pytest.mark.parametrize("controller", ["pi", "pi_ctc"])
def test_simulate_another_robot(good, desk, plant, controller):
    (desk / "arm_run.yaml").write_text(
        f"robot: arm.sdf\nmotion: arm.yaml\nplant: {{kind: {plant}}}\n"
        f"controller: {{kind: {controller}, omega_r: 60}}\n"
    )
    done = good("simulate", "arm_run.yaml", "--out", "arm.csv")

    _, columns = read_table(desk / "arm.csv")
    assert columns["v"].shape == (101, 2)
    assert [row[0] for row in read_printed_table(done.out)[1]] == ["1 shoulder", "2 elbow"]
    # Lag of the reference, 2 zeta / omega_n * 0.8 rad/s², and what gravity adds without CTC.
    largest = np.abs(columns["speed_error"]).max(axis=0)
    assert np.all((largest > 0.03) & (largest < 0.5))
    good("simulate", "arm_run.yaml", "--out", "arm.png")
    good("diagram", "arm_run.yaml")
    assert "elbow" not in (desk / "arm_run.dot").read_text()  # blocks, not joints


def test_a_robot_of_one_joint_with_an_odd_name(good, desk):
    text = (
        "<sdf version='1.9' xmlns:drake='http://drake.mit.edu'><model name='ö dd/%'>"
        + LINK.format(name="l", pose="")
        + JOINT.format(name="_j $x^{$ &lt;ü&gt;", pose="", parent="world", child="l")
        + "</model></sdf>"
    )
    (desk / "odd.sdf").write_text(text, encoding="utf-8")
    (desk / "one.yaml").write_text("duration: 0.5\njoints:\n" + REST.replace("0]]", "0.1]]"))
    (desk / "odd.yaml").write_text(
        "robot: odd.sdf\nmotion: one.yaml\ncontroller: {omega_r: 60}\nname: 'a_b $y^{$'\n"
    )

    assert "_j $x^{$ <ü>" in good("simulate", "odd.yaml").out
    good("simulate", "odd.yaml", "--out", "odd.png")
    good("diagram", "odd.yaml", "--out", "odd.dot")


def test_what_spreadsheets_and_editors_do_to_files(good, desk):
    """Windows line ends, a byte-order mark, blank lines at the end."""
    expected = read_printed_table(good("plan", "short.yaml", "--out", "motion.csv").out)
    text = (desk / "motion.csv").read_text(encoding="utf-8")
    (desk / "crlf.csv").write_bytes(text.replace("\n", "\r\n").encode())
    (desk / "bom.csv").write_text(text, encoding="utf-8-sig")
    (desk / "blank.csv").write_text(text + "\n\n", encoding="utf-8")
    (desk / "crlf.yaml").write_bytes(SHORT.replace("\n", "\r\n").encode())
    (desk / "bom.yaml").write_text(SHORT, encoding="utf-8-sig")

    for name in ("crlf.csv", "bom.csv", "blank.csv", "crlf.yaml", "bom.yaml"):
        assert read_printed_table(good("plan", name).out) == expected, name


def test_plan_tells_the_angle_that_the_limiter_loses(good):
    out = good("plan", "inversion", "--torque-margin", "0.5").out
    told = re.search(
        r"^joint 1 'planetary' ends (\d+\.\d) deg from where it is commanded: .*$", out, re.M
    )
    assert told and "--planner retiming keeps the path" in told[0]
    # Both ends: of the table, and of the command, which the retiming keeps.
    kept = good("plan", "inversion", "--torque-margin", "0.5", "--planner", "retiming").out
    assert "commanded:" not in kept
    ends = [float(read_printed_table(text)[1][0][8]) for text in (out, kept)]
    assert abs(ends[1] - ends[0]) == pytest.approx(float(told[1]), abs=0.15)
    assert "commanded:" not in good("plan", "inversion").out


def test_plan_tells_what_starts_or_ends_in_motion(good, desk):
    out = good("plan", "short.yaml").out
    assert "\nnot at rest: joint 2 'roll' ends at 0.5 rad/s\n" in out
    assert "not at rest" not in good("plan", "leans").out


def test_plan_names_the_share_of_the_torque_that_it_may_use(good):
    out = good("plan", "leans", "--torque-margin", "0.75").out
    assert out.splitlines()[0].endswith("samples, feasible with 75 % of the motors' torque")
    assert re.search(r"^smallest margin: .*, held against the whole limit$", out, re.M)
    assert good("plan", "leans").out.splitlines()[0].endswith("feasible")


def test_no_margin_of_minus_0(good, desk):
    # At full torque for a while; the torque then is that of the motor but for the round-off.
    (desk / "full.yaml").write_text(
        "duration: 6\njoints:\n  - !Knots {knots: [[0, 0], [1, 0], [3, 1.6], [6, 1.6]]}\n"
        + 3 * "  - !Knots {knots: [[0, 0], [6, 0]]}\n"
    )
    out = good("plan", "full.yaml").out
    assert "smallest margin: 0.0 %, torque of joint 1" in out and "-0.0" not in out


# --- mistakes --------------------------------------------------------------------------------


@pytest.fixture
def refuse(call, desk, tmp_path):
    """Run a command that must be refused; returns its one line."""

    def run(*arguments, saying):
        before = snapshot(tmp_path)
        done = call(*arguments)
        assert "Traceback" not in done.err
        assert done.code == 2, done.err or done.out
        assert is_one_line(done.err), done.err
        for words in saying:
            assert words in done.err
        assert snapshot(tmp_path) == before
        return done.err

    return run


def arguments_and_words(*cases):
    return pytest.mark.parametrize(("arguments", "saying"), cases, ids=lambda a: " ".join(a))


@arguments_and_words(
    ([], ["COMMAND"]),
    (["explode"], ["explode", "simulate"]),
    (["Plan"], ["Plan"]),
    (["plan", "--fast"], ["--fast"]),
    (["plan", "a.yaml", "b.yaml"], ["b.yaml"]),
    (["plan", "--period"], ["--period"]),
    (["plan", "--period", "soon"], ["--period", "soon"]),
    (["step", "--inertia", "4,26"], ["--inertia", "4,26"]),
    (["diagram", "run.yaml", "--depth", "1.5"], ["--depth", "1.5"]),
    (["simulate"], ["SCENARIO"]),
    (["tune", "--zeta"], ["--zeta"]),
    (["reproduce", "now"], ["now"]),
)
def test_wrong_usage(refuse, arguments, saying):
    assert "--help" in refuse(*arguments, saying=saying)


@arguments_and_words(
    (["plan", "short.yaml", "--period", "nan"], ["period", "nan"]),
    (["plan", "short.yaml", "--period", "0"], ["period"]),
    (["plan", "short.yaml", "--period", "-0.005"], ["period"]),
    (["plan", "short.yaml", "--period", "inf"], ["period", "inf"]),
    (["plan", "short.yaml", "--period", "1e-12"], ["period"]),
    (["plan", "short.yaml", "--period", "0.007"], ["0.007", "0.5"]),
    (["plan", "short.yaml", "--torque-margin", "0"], ["margin"]),
    (["plan", "short.yaml", "--torque-margin", "1.01"], ["margin", "1.01"]),
    (["plan", "short.yaml", "--torque-margin", "nan"], ["margin", "nan"]),
    (["tune", "short.yaml", "--omega-r", "0"], ["omega", "> 0"]),
    (["tune", "short.yaml", "--omega-r", "nan"], ["omega", "nan"]),
    (["tune", "short.yaml", "--omega-r", "1e300"], ["omega"]),
    (["tune", "short.yaml", "--zeta", "1", "1"], ["zeta", "4"]),
    (["tune", "short.yaml", "--zeta", "1", "1", "0", "1"], ["zeta", "> 0"]),
    (["tune", "short.yaml", "--zeta", "1", "1", "1", "inf"], ["zeta", "inf"]),
    (["step", "--inertia", "-1"], ["--inertia", "-1"]),
    (["step", "--inertia", "0"], ["--inertia", "> 0"]),
    (["step", "--inertia", "nan"], ["--inertia", "nan"]),
    (["step", "--inertia", "inf"], ["--inertia", "inf"]),
    (["step", "--inertia", "1e308"], ["inertia"]),
    (["step", "--zeta", "0"], ["zeta", "> 0"]),
    (["step", "--zeta", "-1"], ["zeta", "> 0"]),
    (["step", "--zeta", "nan"], ["zeta", "nan"]),
    (["step", "--omega-r", "0"], ["omega", "> 0"]),
    (["step", "--omega-r", "inf"], ["omega", "inf"]),
    (["step", "--structure", "pid"], ["structure", "pid", "p_in_feedback"]),
    (["diagram", "run.yaml", "--format", "pdf"], ["--format", "pdf", "svg"]),
    (["diagram", "run.yaml", "--depth", "-3"], ["--depth", "-3"]),
    (["diagram", "run.yaml", "--depth", "3000000000"], ["--depth"]),
    (["diagram", "run.yaml", "--depth", "99999999999999999999"], ["--depth"]),
)
def test_wrong_numbers_and_choices(refuse, arguments, saying):
    refuse(*arguments, saying=saying)


@arguments_and_words(
    (["plan", "nowhere.yaml"], ["nowhere.yaml", "no such file"]),
    (["plan", "nowhere.csv"], ["nowhere.csv"]),
    (["plan", "package://sdt/motions/nowhere.yaml"], ["nowhere.yaml", "reference.yaml"]),
    (["plan", "package://other/motion.yaml"], ["package://other/motion.yaml"]),
    (["plan", "folder"], ["folder"]),
    (["plan", "folder.csv"], ["folder.csv"]),
    (["plan", ""], ["no such file"]),
    (["plan", "file"], ["file", ".yaml", ".csv"]),
    (["plan", "arm.sdf"], ["arm.sdf", ".yaml"]),
    (["plan", "short.yaml", "--robot", "nowhere.sdf"], ["nowhere.sdf"]),
    (["plan", "short.yaml", "--robot", "short.yaml"], ["short.yaml", ".sdf"]),
    (["plan", "short.yaml", "--robot", "folder"], ["folder"]),
    (["plan", "x" * 5000 + ".yaml"], ["no such file"]),
    (["tune", "nowhere.yaml"], ["nowhere.yaml"]),
    (["simulate", "nowhere.yaml"], ["nowhere.yaml"]),
    (["simulate", "folder"], ["folder"]),
    (["simulate", "arm.sdf"], ["arm.sdf"]),
    (["simulate", "package://sdt/scenarios/axis.yaml"], ["axis.yaml", "axis_pi.yaml"]),
    (["diagram", "nowhere.yaml"], ["nowhere.yaml"]),
)
def test_files_that_are_not_there_or_not_files(refuse, arguments, saying):
    refuse(*arguments, saying=saying)


BELOW_A_FILE = "file/below.{suffix}"
IN_PROC = "/proc/nothing/here.{suffix}"
WRITERS = {
    "plan": (["plan", "short.yaml"], "csv"),
    "step": (["step"], "png"),
    "simulate": (["simulate", "run.yaml"], "csv"),
    "simulate figure": (["simulate", "run.yaml"], "png"),
    "diagram": (["diagram", "run.yaml"], "dot"),
}


@pytest.mark.parametrize("writer", WRITERS)
@pytest.mark.parametrize(
    "out",
    [
        BELOW_A_FILE,
        pytest.param(IN_PROC, marks=needs_proc),
        pytest.param("/proc/here.{suffix}", marks=needs_proc),
        "folder.{suffix}",
        ".",
        "..",
        "",
        "/",
        "n" * 300 + ".{suffix}",
    ],
    ids=["below_a_file", "proc", "proc_root", "folder", "dot", "dotdot", "empty", "root", "long"],
)
def test_places_that_cannot_be_written(refuse, desk, writer, out):
    arguments, suffix = WRITERS[writer]
    (desk / f"folder.{suffix}").mkdir(exist_ok=True)
    out = out.format(suffix=suffix)

    line = refuse(*arguments, "--out", out, saying=[])
    if out.strip("./") and len(out) < 100:
        assert Path(out).name in line or Path(out).parent.name in line
    if out.startswith("file/"):
        assert line == "sdt-drake: file: is a file, expected a folder\n"
    if not out:
        assert "argument --out: empty, expected a path" in line


@pytest.mark.parametrize(
    "out",
    [
        "folder.csv",
        pytest.param("/proc/here.csv", marks=needs_proc),
        "n" * 300 + ".csv",
        "..",
    ],
    ids=["folder", "proc_root", "long", "dotdot"],
)
def test_a_place_is_named_as_it_was_given(call, desk, out):
    """Not by the hidden file that is written first."""
    done = call("plan", "short.yaml", "--out", out)

    assert out in done.err and "partial" not in done.err


@pytest.mark.parametrize(
    "out",
    ["", "file", BELOW_A_FILE.format(suffix="d"), pytest.param("/proc/x", marks=needs_proc)],
)
def test_places_where_a_study_cannot_go(refuse, monkeypatch, out):
    """Noticed before ten seconds of computing."""

    def run_study(watch):
        raise AssertionError("computed in vain")

    monkeypatch.setattr(study, "run_study", run_study)
    saying = {"": "--out: empty", "/proc/x": "x"}.get(out, "file: is a file, expected a folder")
    refuse("reproduce", "--out", out, saying=[saying])


@arguments_and_words(
    (["step", "--out", "step.xyz"], ["step.xyz", ".png"]),
    (["step", "--out", "step"], ["step", ".png"]),
    (["step", "--out", "step.csv"], ["step.csv", ".png"]),
    (["step", "--out", "step.txt/"], [".png"]),
    (["simulate", "run.yaml", "--out", "run.xyz"], ["run.xyz", ".png"]),
    (["simulate", "run.yaml", "--out", "run"], ["run", ".png"]),
)
def test_unknown_kinds_of_figures(refuse, arguments, saying):
    refuse(*arguments, saying=saying)


@pytest.mark.parametrize("arguments", [["simulate", "run.yaml"], ["step"]], ids=lambda a: a[0])
def test_an_unknown_kind_of_figure_is_noticed_before_the_simulation(call, desk, arguments):
    assert call(*arguments, "--out", "figure.xyz").out == ""


@pytest.mark.skipif(shutil.which("xelatex") is not None, reason="needs a machine without LaTeX")
def test_a_kind_of_figure_that_cannot_be_made_here_is_refused(refuse):
    """matplotlib knows .pgf, and needs LaTeX for it."""
    refuse("step", "--out", "step.pgf", saying=["step.pgf"])


# Scenarios: what is wrong, and what the line must say beside the file.
BAD_SCENARIOS = {
    "empty": ("", ["mapping"]),
    "a_list": ("- 1\n- 2\n", ["mapping"]),
    "a_text": ("hello\n", ["mapping"]),
    "not_yaml": ("controller: [1, 2\n", ["YAML"]),
    "tabs": ("controller:\n\tkind: pi\n", ["YAML"]),
    "two_documents": ("name: a\n---\nname: b\n", ["YAML"]),
    "python_object": ("name: !!python/object/apply:os.system [ls]\n", []),
    "unknown_key": ("algoritm: printed\n{rest}", ["algoritm", "algorithm"]),
    "unknown_nested_key": ("controller: {{omega_r: 60, zetta: [1, 1]}}\n", ["controller", "zeta"]),
    "unknown_key_like_none": ("weather: nice\n{rest}", ["weather", "robot"]),
    "number_as_key": ("{rest}1: 2\n", []),
    "repeated_key": ("{rest}period: 0.005\nperiod: 0.01\n", ["period", "twice"]),
    "text_for_a_number": ("{rest}period: soon\n", ["period", "soon"]),
    "truth_for_a_number": ("{rest}period: true\n", ["period"]),
    "number_for_a_text": ("{rest}algorithm: 3\n", ["algorithm", "3"]),
    "number_for_a_list": ("controller: {{omega_r: 60, zeta: 1}}\n", ["controller.zeta", "list"]),
    "nothing_for_a_mapping": ("{rest}plant:\n", ["plant"]),
    "list_for_a_text": ("controller: {{omega_r: 60, structure: [pi, p_in_feedback]}}\n",
                        ["controller.structure"]),
    "nan": ("{rest}period: .nan\n", ["period", "nan"]),
    "infinite": ("{rest}period: .inf\n", ["period", "inf"]),
    "tiny_period": ("{rest}period: 1e-12\n", ["period"]),
    "period_zero": ("{rest}period: 0\n", ["period", "> 0"]),
    "period_that_does_not_divide": ("{rest}period: 0.007\n", ["0.007"]),
    "margin": ("{rest}torque_margin: 1.5\n", ["torque_margin", "1.5"]),
    "algorithm": ("{rest}algorithm: both\n", ["algorithm", "both", "consistent", "printed"]),
    "inverse_dynamics": ("{rest}inverse_dynamics: offline\n", ["offline", "table", "online"]),
    "plant": ("{rest}plant: {{kind: real}}\n", ["plant.kind", "real", "axis", "coupled"]),
    "controller": ("controller: {{kind: lqr, omega_r: 60}}\n", ["controller.kind", "lqr"]),
    "structure": ("controller: {{omega_r: 60, structure: pid}}\n", ["pid", "p_in_feedback"]),
    "no_gains": ("controller: {{kind: pi}}\n", ["omega_r", "kp"]),
    "half_of_the_gains": ("controller: {{kp: [1, 1]}}\n", ["kp", "ki"]),
    "both_ways_to_gains": ("controller: {{omega_r: 60, kp: [1, 1], ki: [1, 1]}}\n", ["either"]),
    "negative_gain": ("controller: {{kp: [1, -1], ki: [1, 1]}}\n", ["controller.kp", "> 0"]),
    "nan_gain": ("controller: {{kp: [1, .nan], ki: [1, 1]}}\n", ["controller.kp", "finite"]),
    "huge_omega_r": ("controller: {{omega_r: 1e300}}\n", ["omega_r"]),
    "zeta_zero": ("controller: {{omega_r: 60, zeta: [1, 0]}}\n", ["zeta", "> 0"]),
    "zeta_of_four": ("controller: {{omega_r: 60, zeta: [1, 1, 1, 1]}}\n", ["zeta", "4", "2"]),
    "zeta_huge": ("controller: {{omega_r: 60, zeta: [1, 1e308]}}\n", ["zeta"]),
    "inertia_negative": ("{rest}plant: {{i_eff: [0.01, -0.01]}}\n", ["plant.i_eff", "> 0"]),
    "inertia_of_one": ("{rest}plant: {{i_eff: [0.01]}}\n", ["plant.i_eff", "1", "2"]),
    "inertia_vanishing": ("{rest}plant: {{i_eff: [1e-300, 1]}}\n", []),
    "inertia_of_coupled": ("{rest}plant: {{kind: coupled, i_eff: [1, 1]}}\n", ["plant.i_eff"]),
    "amplitude": ("{rest}disturbance: {{amplitude: -0.1}}\n", ["disturbance.amplitude"]),
    "omega_d": ("{rest}disturbance: {{amplitude: 0.1, omega_d: .nan}}\n", ["disturbance.omega_d"]),
    "no_such_robot": ("{rest}robot: nowhere.sdf\n", ["nowhere.sdf"]),
    "robot_is_a_folder": ("{rest}robot: folder\n", ["folder"]),
    "no_such_motion": ("{rest}motion: nowhere.yaml\n", ["nowhere.yaml"]),
    "motion_of_another_robot": (
        "robot: arm.sdf\nmotion: short.yaml\ncontroller: {{omega_r: 60}}\n",
        ["short.yaml", "4", "2", "two_links"],
    ),
    "robot_of_another_motion": (
        "robot: package://sdt/sdt.sdf\nmotion: arm.yaml\ncontroller: {{omega_r: 60}}\n",
        ["arm.yaml", "2", "4", "sdt"],
    ),
}  # fmt: skip
# Faults of a file that the scenario names: the line names that file.
ELSEWHERE = {
    "no_such_robot",
    "robot_is_a_folder",
    "no_such_motion",
    "motion_of_another_robot",
    "robot_of_another_motion",
    "period_that_does_not_divide",
    "tiny_period",
}


def write_scenario(path, text):
    """A scenario of the arm, with what `text` lacks put in for {rest} or in front."""
    lines = [] if "robot:" in text else ["robot: arm.sdf\n"]
    lines += [] if "motion:" in text else ["motion: arm.yaml\n"]
    controller = "" if "controller:" in text else "controller: {omega_r: 60}\n"
    if "{rest}" in text:
        path.write_text("".join(lines) + text.format(rest=controller), encoding="utf-8")
    elif text.startswith("controller: {{") or "motion:" in text:
        path.write_text("".join(lines) + text.format(), encoding="utf-8")
    else:
        path.write_text(text, encoding="utf-8")


@pytest.mark.parametrize("fault", BAD_SCENARIOS)
def test_bad_scenarios(refuse, desk, fault):
    text, saying = BAD_SCENARIOS[fault]
    write_scenario(desk / "bad.yaml", text)

    refuse("simulate", "bad.yaml", saying=saying)


@pytest.mark.parametrize("fault", sorted(BAD_SCENARIOS.keys() - ELSEWHERE - {"inertia_vanishing"}))
def test_bad_scenarios_are_named(call, desk, fault):
    """A line about a scenario says which."""
    write_scenario(desk / "bad.yaml", BAD_SCENARIOS[fault][0])

    assert re.search(r"bad\.yaml|scenario 'bad'", call("simulate", "bad.yaml").err)


def test_the_scenario_of_the_bad_ones_is_good(good, desk):
    write_scenario(desk / "bad.yaml", "{rest}")

    good("simulate", "bad.yaml")


def test_a_vanishing_inertia_does_not_hang(desk):
    write_scenario(desk / "bad.yaml", "{rest}plant: {{i_eff: [1e-9, 1e-9]}}\n")
    done = command("simulate", "bad.yaml", cwd=desk, timeout=20)

    assert done.returncode in (0, 2)
    assert done.stderr == "" or is_one_line(done.stderr)


def test_a_name_does_not_lead_out_of_the_folder(call, desk, tmp_path):
    """A scenario from somebody else must not choose where `diagram` writes."""
    write_scenario(desk / "evil.yaml", "{rest}name: ../escaped\n")
    call("diagram", "evil.yaml")

    assert not (tmp_path / "escaped.dot").exists()


BAD_PROFILES = {
    "empty": ("", ["empty", "mapping"]),
    "misspelt_tracks": ("duration: 1\ntrack: []\n", ["track: ", "did you mean tracks"]),
    "misspelt_joints": ("duration: 1\njoint: []\n", ["joint: ", "did you mean joints"]),
    "no_joints": ("duration: 1\n", ["joints"]),
    "no_duration": ("joints:\n  - !Knots {knots: [[0, 0], [1, 0]]}\n", ["duration"]),
    "nan_duration": ("duration: .nan\njoints:\n  - !Knots {knots: [[0, 0], [1, 0]]}\n", ["nan"]),
    "unknown_kind": ("duration: 1\njoints:\n  - !Knot {knots: [[0, 0], [1, 0]]}\n", ["Knot"]),
    "unknown_key": ("duraton: 1\n", ["duraton", "duration"]),
    "three_joints": (SHORT.replace(REST, "", 1), ["3", "4"]),
    "nan_speed": (SHORT.replace("[0.25, 0.5]", "[0.25, .nan]"), ["joints[2]", "finite"]),
    "text_speed": (SHORT.replace("[0.25, 0.5]", "[0.25, fast]"), ["joints[2]", "fast"]),
    "times_backwards": (SHORT.replace("[0.25, 0.5]", "[0.75, 0.5]"), ["joints[2]", "0.75"]),
    "too_short": (SHORT.replace("duration: 0.5", "duration: 1"), ["joints[1]", "0.5", "1"]),
    "three_in_a_knot": (SHORT.replace("[0.25, 0.5]", "[0.25, 0.5, 1]"), ["joints[2]", "pairs"]),
    "beyond_the_speed_limit": (SHORT.replace("[0.25, 0.5], [0.5, 0.5]", "[0.5, 5]"), ["roll"]),
    "start_of_three": (SHORT + "q0: [0, 0, 0]\n", ["q0", "3", "4"]),
}


@pytest.mark.parametrize("fault", BAD_PROFILES)
def test_bad_profiles(refuse, desk, fault):
    text, saying = BAD_PROFILES[fault]
    (desk / "bad.yaml").write_text(text, encoding="utf-8")

    refuse("plan", "bad.yaml", "--out", "motion.csv", saying=["bad.yaml", *saying])


def test_a_motion_that_the_motors_cannot_do(refuse, desk):
    """At 2.95 rad/s of the arm the coupling is more than the roll motor can hold."""
    (desk / "fast.yaml").write_text(
        "duration: 10\njoints:\n  - !Knots {knots: [[0, 0], [5, 2.95], [10, 2.95]]}\n"
        + 3 * "  - !Knots {knots: [[0, 0], [10, 0]]}\n"
    )

    saying = ["fast.yaml", "joint 2", "roll", "3950 N m"]
    line = refuse("plan", "fast.yaml", "--out", "motion.csv", saying=saying)
    assert re.search(r"at \d+\.\d+ s", line)


@pytest.mark.parametrize("name", ["plan", "tune", "simulate"])
def test_binary_files(refuse, desk, name):
    for suffix in ("yaml", "csv"):
        (desk / f"binary.{suffix}").write_bytes(bytes(range(256)) * 20)
        if name != "simulate" or suffix == "yaml":
            refuse(name, f"binary.{suffix}", saying=[f"binary.{suffix}"])
    if name != "simulate":
        (desk / "binary.sdf").write_bytes(bytes(range(256)) * 20)
        refuse(name, "short.yaml", "--robot", "binary.sdf", saying=["binary.sdf"])


def change(row, column, text):
    """Put `text` into a cell; rows and columns count from 0, row 0 is the header."""

    def edit(lines):
        cells = lines[row].split(",")
        cells[column] = text
        lines[row] = ",".join(cells)

    return edit


def drop(row):
    return lambda lines: lines.pop(row)


def only(count):
    return lambda lines: lines.__delitem__(slice(count, None))


BAD_MOTIONS = {
    "empty": (only(0), []),
    "header_only": (only(1), ["two rows"]),
    "one_row": (only(2), ["two rows"]),
    "time_goes_back": (change(10, 0, "0.03"), ["line 11", "time"]),
    "nan": (change(7, 6, "nan"), ["line 8", "v_ref_2", "nan"]),
    "infinite": (change(7, 6, "inf"), ["line 8", "v_ref_2", "inf"]),
    "text": (change(7, 6, "fast"), ["line 8", "fast"]),
    "missing_cell": (lambda lines: lines.__setitem__(7, lines[7].rpartition(",")[0]), ["line 8"]),
    "cut_off": (lambda lines: lines.__setitem__(-1, lines[-1][:20]), ["line 102"]),
    "late_start": (drop(1), ["time"]),
    "no_time": (change(0, 0, "t"), ["time"]),
    "no_speeds": (change(0, 5, "speed_1"), ["v_ref"]),
    "speed_that_does_not_fit": (change(30, 6, "0.9"), ["line", "_2"]),
    "comment": (lambda lines: lines.insert(5, "# a remark"), ["line 6"]),
}


@pytest.mark.parametrize("fault", BAD_MOTIONS)
def test_bad_motions(refuse, call, desk, fault):
    edit, saying = BAD_MOTIONS[fault]
    assert call("plan", "short.yaml", "--out", "motion.csv").code == 0
    lines = (desk / "motion.csv").read_text(encoding="utf-8").splitlines()
    edit(lines)
    (desk / "bad.csv").write_text("".join(f"{line}\n" for line in lines), encoding="utf-8")

    refuse("plan", "bad.csv", "--out", "again.csv", saying=["bad.csv", *saying])


BAD_ROBOTS = {
    "negative_mass": ("<mass>300</mass>", "<mass>-300</mass>", ["roll_frame", "-300"]),
    "no_mass": ("<mass>300</mass>", "", ["roll_frame", "mass"]),
    "nan_mass": ("<mass>300</mass>", "<mass>nan</mass>", ["roll_frame", "nan"]),
    "impossible_inertia": ("<ixx>95</ixx>", "<ixx>1</ixx>", ["roll_frame", "triangle"]),
    "not_xml": ("</model>", "", ["XML"]),
    "prismatic": ('type="revolute"', 'type="prismatic"', ["planetary", "prismatic"]),
    "no_effort": ("<effort>3950</effort>", "", ["roll", "effort"]),
    "negative_gear": ("<drake:gear_ratio>67.2", "<drake:gear_ratio>-1", ["planetary", "gear"]),
    "nan_gear": ("<drake:gear_ratio>67.2", "<drake:gear_ratio>nan", ["planetary", "gear"]),
    "infinite_rotor": ("<drake:rotor_inertia>1.73", "<drake:rotor_inertia>inf", ["roll", "rotor"]),
    "negative_rotor": ("<drake:rotor_inertia>1.73", "<drake:rotor_inertia>-1", ["roll", "rotor"]),
    "nan_speed_limit": ("<velocity>4.7124", "<velocity>nan", ["roll", "nan"]),
    "unknown_parent": ("<parent>arm</parent>", "<parent>leg</parent>", ["leg"]),
    "no_axis": ("<xyz>0 1 0</xyz>", "<xyz>0 0 0</xyz>", []),
    "two_of_a_name": ('joint name="roll"', 'joint name="planetary"', ["planetary"]),
}


@pytest.mark.parametrize("fault", BAD_ROBOTS)
def test_bad_robots(refuse, desk, fault):
    old, new, saying = BAD_ROBOTS[fault]
    assert old in SDF
    (desk / "bad.sdf").write_text(SDF.replace(old, new, 1), encoding="utf-8")

    refuse("plan", "short.yaml", "--robot", "bad.sdf", saying=["bad.sdf", *saying])


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("<effort>3950", "<effort>strong"),
        ('relative_to="arm">2.6', 'relative_to="arm">nan'),
    ],
    ids=["effort", "pose"],
)
def test_errors_of_the_sdf_parser_are_one_line_too(desk, old, new):
    """The parser logs by itself, past Python's stderr: only a process of its own shows it."""
    assert old in SDF
    (desk / "bad.sdf").write_text(SDF.replace(old, new, 1), encoding="utf-8")
    done = command("plan", "short.yaml", "--robot", "bad.sdf", cwd=desk)

    assert done.returncode == 2 and done.stdout == ""
    assert is_one_line(done.stderr), done.stderr
    assert "bad.sdf" in done.stderr


def test_the_reference_motion_does_not_fit_another_robot(refuse, desk):
    for command in (["plan"], ["tune", "--omega-r", "60"]):
        refuse(*command, "--robot", "arm.sdf", saying=["4 joints", "two_links", "2"])


def test_a_refused_result_leaves_the_old_one(call, desk):
    (desk / "motion.csv").write_text("old")
    assert call("plan", "nowhere.yaml", "--out", "motion.csv").code == 2
    (desk / "bad.yaml").write_text(SHORT.replace("[0.25, 0.5]", "[0.25, .nan]"))
    assert call("plan", "bad.yaml", "--out", "motion.csv").code == 2

    assert (desk / "motion.csv").read_text() == "old"


def test_a_line_break_in_a_path_stays_one_line(refuse, desk):
    refuse("plan", "no\nwhere.yaml", saying=["no where.yaml: control characters"])


READ_AND_WRITTEN = {
    "diagram over its scenario": ["diagram", "run.yaml", "--format", "dot", "--out", "run.yaml"],
    "diagram over a robot": ["diagram", "run.yaml", "--format", "dot", "--out", "arm.sdf"],
    "diagram without a suffix": ["diagram", "run.yaml", "--out", "file"],
    "plan over its motion": ["plan", "given.csv", "--period", "0.01", "--out", "given.csv"],
    "drive table over its motion": ["plan", "given.csv", "--drive-table", "given.csv"],
    "simulate over its motion": ["simulate", "csv.yaml", "--out", "given.csv"],
    "pilot over its recording": ["pilot", "given.csv", "--out", "given.csv"],
    "plan over another table": ["plan", "short.yaml", "--out", "other.csv"],
    "a page over another one": ["view", "short.yaml", "--record", "other.html"],
}


@pytest.mark.parametrize("case", READ_AND_WRITTEN)
def test_no_command_replaces_what_it_reads_or_another_kind(call, desk, case):
    assert call("plan", "short.yaml", "--out", "given.csv").code == 0
    (desk / "csv.yaml").write_text(SCENARIO.format(name="run", motion="given.csv"))
    (desk / "other.csv").write_text("date,amount\n")
    (desk / "other.html").write_text("<p>mine</p>")
    before = snapshot(desk)
    done = call(*READ_AND_WRITTEN[case])
    assert done.code == 2 and is_one_line(done.err), done
    assert re.search("is read by this|holds something else|unknown kind of file", done.err)
    assert snapshot(desk) == before


def test_a_device_or_pipe_is_not_replaced_by_a_file(desk):
    """`--out /dev/null`, as root, must not turn the device into a file; here with a named pipe."""
    os.mkfifo(desk / "pipe.csv")
    reader = os.open(desk / "pipe.csv", os.O_RDWR | os.O_NONBLOCK)  # so that writing cannot block
    try:
        done = command("plan", "short.yaml", "--out", "pipe.csv", cwd=desk)
    finally:
        os.close(reader)

    assert (desk / "pipe.csv").is_fifo()
    assert done.returncode in (0, 2) and "Traceback" not in done.stderr


@pytest.mark.parametrize("out", ["short.yaml", "motion.yaml", "motion.txt", "motion"])
def test_a_motion_goes_into_a_csv_file_or_a_figure(refuse, out):
    """No command could read it under another suffix; and a profile is not overwritten by it."""
    refuse("plan", "short.yaml", "--out", out, saying=[out, ".csv"])


def test_a_line_about_an_option_does_not_speak_of_a_scenario(call, desk):
    """`tune` makes a scenario inside; the user gave none."""
    for arguments in (("--zeta", "1"), ("--zeta", "1", "1", "1", "0"), ("--omega-r", "0")):
        err = call("tune", "short.yaml", *arguments).err
        assert is_one_line(err) and "scenario" not in err, err


# --- reproduce -------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def reproduced(_reproducing):
    """The real command, from a folder of its own."""
    process, folder = _reproducing
    out, err = process.communicate(timeout=200)
    return subprocess.CompletedProcess(process.args, process.returncode, out, err), folder


def test_reproduce(reproduced):
    done, folder = reproduced
    out = folder / "some" / "results"

    assert (done.returncode, done.stderr) == (0, "")
    assert [path.name for path in folder.iterdir()] == ["some"]
    summary = json.loads((out / "summary.json").read_text(encoding="utf-8"))
    names = ("report.md", "report.html", "table1.md", "reference.csv", "figure8.png")
    for name in (*names, "diagrams/figure6.dot"):
        assert (out / name).is_file(), name
    for claim in summary["claims"]:
        assert re.search(rf"^\s+{claim['id']}\s+{claim['verdict']}$", done.stdout, re.M)
    assert "some/results/report.md" in done.stdout


def test_reproduce_says_how_long_each_stage_took(reproduced):
    done, folder = reproduced
    summary = json.loads((folder / "some/results/summary.json").read_text(encoding="utf-8"))

    for stage in summary["wall_time_s"]:
        assert re.search(rf"^\s+{re.escape(stage)}\s+\d+\.\d\d s$", done.stdout, re.M), stage
    assert re.search(r"\d+\.\d s in all", done.stdout)


@pytest.fixture
def quick_study(monkeypatch):
    """A study that is computed and written at once: two stages, one claim, one file."""

    def run_study(watch):
        with watch.stage("first"):
            pass
        with watch.stage("second"):
            return SimpleNamespace()

    def write_study(_, folder, watch):
        with watch.stage("files"):
            (folder / "report.md").write_text("report")
        return [SimpleNamespace(id="a_claim", verdict="reproduced")]

    monkeypatch.setattr(study, "run_study", run_study)
    monkeypatch.setattr(report, "write_study", write_study)
    monkeypatch.setattr(page, "write_study_page", lambda _, folder, *rest: folder / "report.html")


def test_reproduce_into_the_default_folder(good, desk, quick_study):
    good("reproduce")

    assert (desk / "out" / "report.md").is_file()


def test_reproduce_without_graphviz_says_so_in_one_line(
    good, desk, quick_study, tmp_path, monkeypatch
):
    empty = tmp_path / "empty"
    empty.mkdir()
    monkeypatch.setenv("PATH", str(empty))

    (line,) = [line for line in good("reproduce").out.splitlines() if "Graphviz" in line]
    assert ".svg" in line and "install" in line


@needs_graphviz
def test_reproduce_with_graphviz_does_not_speak_of_it(good, desk, quick_study):
    assert "Graphviz" not in good("reproduce").out


# --- what nobody should see ------------------------------------------------------------------


def test_help_does_not_load_drake(tmp_path):
    code = (
        "import sys\nfrom sdt_drake.cli import main\n"
        "try:\n    main(['plan', '--help'])\nexcept SystemExit:\n    pass\n"
        "sys.exit('pydrake' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True)

    assert done.returncode == 0


def test_tables_are_aligned(good):
    for arguments in (("plan",), ("tune",)):
        lines = good(*arguments).out.splitlines()
        (start,) = [i for i, line in enumerate(lines) if line.startswith("joint  ")]
        table = lines[start : start + 5]
        assert len({len(line) for line in table}) == 1
        assert max(map(len, table)) <= 140
