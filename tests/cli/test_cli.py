"""`sdt-drake` as a program: usage, exit codes, one line for every mistake, files, streams."""

from __future__ import annotations

import importlib
import io
import os
import re
import resource
import shlex
import subprocess
import sys
import warnings

import pytest
from command_line import (
    AXIS,
    RUN,
    SCENARIO,
    SDF,
    SHORT,
    SHORT_MOTION,
    WRITERS,
    is_one_line,
    program,
    refused,
    snapshot,
)

import sdt_drake
from sdt_drake.cli import COMMANDS
from sdt_drake.cli import app as cli
from sdt_drake.io.resources import SHIPPED, find_file

needs_proc = pytest.mark.skipif(not os.path.isdir("/proc/self"), reason="needs /proc")


@pytest.fixture
def idle(monkeypatch):
    """Nothing may be computed."""

    def computed(*_, **__):
        raise AssertionError("computed in vain")

    for place in (
        "run.design:make_design",
        "motion:load_plan",
        "analysis.reproduction:step_response",
    ):
        module, name = place.split(":")
        monkeypatch.setattr(importlib.import_module(f"sdt_drake.{module}"), name, computed)


# --- help, version, usage -------------------------------------------------------------------------


def test_help_lists_all_commands_and_version(good):
    out = good("--help").out
    for name in COMMANDS:
        assert re.search(rf"^\s+{name}\b", out, re.M), name
    assert "example: sdt-drake" in out
    assert good("--version").out == f"sdt-drake {sdt_drake.__version__}\n"


@pytest.mark.parametrize("name", COMMANDS)
def test_help_of_a_command_has_an_example_that_works(good, name):
    out = " ".join(good(name, "--help").out.split())
    example = re.search(f"example: sdt-drake ({name} .*?) (?:Arguments|Parameters)", out)[1]
    _, bound, _ = cli.commands(name).parse_args(shlex.split(example))
    for argument in ("scenario", "motion", "sizing", "name"):
        if given := bound.arguments.get(argument):
            find_file(given, *SHIPPED)


def test_completion_knows_what_ships_files_fields_and_options(desk, tmp_path):
    (desk / "coupled_own.yaml").touch()
    (tmp_path / "sdt-drake").write_text(f'#!/bin/sh\nexec {sys.executable} -m sdt_drake "$@"\n')
    (tmp_path / "sdt-drake").chmod(0o755)
    script = cli.commands().generate_completion(shell="bash")

    def completed(line):
        words = shlex.join(line.split(" "))
        code = (
            f"{script}\nCOMP_WORDS=({words}); COMP_CWORD=$((${{#COMP_WORDS[@]}} - 1)); _sdt_drake"
        )
        code += '\nprintf "%s\\n" "${COMPREPLY[@]}"'
        path = f"{tmp_path}:{os.environ['PATH']}"
        done = subprocess.run(["bash", "-c", code], capture_output=True, env={"PATH": path})
        assert done.stderr == b""
        return set(shlex.split(done.stdout.decode()))

    coupled = {"coupled_pi", "coupled_pi_ctc", "coupled_own.yaml"}
    assert completed("sdt-drake simulate coupled_") == coupled
    assert completed("sdt-drake plan l") == {"leans"}
    assert completed("sdt-drake plan leans --robot s") == {"sdt"}
    assert completed("sdt-drake study m") == {"monte_carlo"}
    assert completed("sdt-drake size siz") == {"sizing"}
    assert completed("sdt-drake si") == {"simulate", "size"}
    assert completed("sdt-drake plan --pl") == {"--planner"}
    assert completed("sdt-drake plan --planner l") == {"limiter"}
    assert completed("sdt-drake bode coupled_pi --set plant.ki") == {
        "plant.kind=axis", "plant.kind=coupled",
    }  # fmt: skip
    assert completed("sdt-drake bode coupled_pi --set drive.ref") == {"drive.reference_delay=0.0"}
    assert completed("sdt-drake compare coupled_pi --controllers pi,p_") == {"pi,p_pi"}


@pytest.mark.parametrize(
    ("line", "word"),
    [
        ("", "COMMAND"),
        ("explode", "reproduce, report, init"),
        ("plan --wide", "Unknown option: --wide (see sdt-drake plan --help)"),
        ("simulat", 'Did you mean "simulate"?'),
        ("plan --period soon", "soon"),
        ("diagram run.yaml --depth 1.5", "1.5"),
        ("simulate", "SCENARIO"),
    ],
)
def test_wrong_usage(refuse, line, word):
    assert "--help" in refuse(*line.split(), saying=[word])


# --- what is refused ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("line", "words"),
    [
        (f"plan {SHORT_MOTION} --period nan", ["period", "nan"]),
        (f"plan {SHORT_MOTION} --period 0.007", ["0.007", "0.5"]),
        (f"plan {SHORT_MOTION} --torque-margin 1.01", ["margin", "1.01"]),
        (f"tune {SHORT_MOTION} --omega-r 0", ["--omega-r", "> 0"]),
        (f"tune {SHORT_MOTION} --zeta 1 1 0 1", ["--zeta", "> 0"]),
        ("step --inertia 0", ["--inertia", "> 0"]),
        ("step --omega-r -1", ["--omega-r", "> 0"]),
        ("step --zeta 1e9", ["zeta", "0.01 to 100"]),
        ("step --omega-r 1e-20", ["omega_r: 1e-20", ">= 1e-06"]),
        ("step --structure pid", ["--structure", "pid", "p_in_feedback"]),
        (f"diagram {RUN} --format gif", ["--format", "pdf", "svg"]),
        (f"diagram {RUN} --depth 3000000000", ["--depth"]),
        (f"bode {AXIS} --time 0.51", ["--time: 0.51 s", "0.5"]),
        (f"stability {AXIS} --omega-r 0.05", ["--omega-r"]),
        (f"stability {AXIS} --damping=-0.1", ["--damping"]),
        (f"compare {AXIS} --controllers pi,pid", ["--controllers: 'pid'", "inverse_dynamics"]),
        (f"compare {AXIS} --controllers pi,inverse_dynamics", ["plant.kind coupled"]),
        ("budget ../given/coupled.yaml", ["coupled.yaml", "plant.kind: coupled", "expected axis"]),
        ("plan package://sdt/motions/nowhere.yaml", ["nowhere.yaml", "reference.yaml"]),
        ("plan ../given/arm.sdf", ["arm.sdf", ".yaml", ".csv"]),
        (f"plan {SHORT_MOTION} --robot {SHORT_MOTION}", ["short.yaml", ".sdf"]),
        (f"plan {SHORT_MOTION} --envelope {RUN}", ["run.yaml: no torque-speed envelope, expected"]),
        ("plan --robot ../given/arm.sdf", ["reference.yaml: joints: 4 value(s)", "2", "--robot"]),
        ("plan ../given/two.csv", ["2 joints, robot 'sdt' has 4; --robot names"]),
        ("tune ../given/arm.yaml", ["joints: 2 value(s), expected 4", "; --robot names"]),
        (
            "plan leans --robot ../given/arm.sdf",
            ["expected a joint of 'two_links'", "; --robot names"],
        ),
        ("plan inversion --robot ../given/arm.sdf", ["start_deg: 4 value(s)", "; --robot names"]),
        ("motions ../given/elbow.yaml", ["expected a joint of 'sdt'", "; --robot names"]),
        ("export ../given/two.csv --drive drives", ["robot 'sdt' has 4; --scenario names"]),
        (
            f"export {RUN} --scenario training --drive drives",
            ["--scenario", "run.yaml is a scenario"],
        ),
        ("tune ../given/arm.yaml --robot ../given/arm.sdf", ["--omega-r: missing", "65.991"]),
        (f"simulate {SHORT_MOTION}", ["short.yaml: is a motion, expected a scenario"]),
        (f"simulate {RUN} --joint 5 --out x.png", ["--joint: 5, expected 1 to 4"]),
        (f"simulate {RUN} --joint 2 --out x.csv", ["--joint: has no effect without a figure"]),
    ],
)
def test_wrong_numbers_choices_and_files(refuse, given, line, words):
    given("two.csv", "time,v_ref_1,v_ref_2\n0,0,0\n0.5,0,0\n")
    given("elbow.yaml", "duration: 1\ntracks: [{joint: elbow, segments: [!Hold {duration: 1}]}]\n")
    refuse(*line.split(), saying=words)


def test_odd_names(refuse):
    refuse("plan", "")
    refuse("plan", "x" * 5000 + ".yaml", saying=["no such file"])
    refuse("plan", "no\nwhere.yaml", saying=["no where.yaml: control characters"])


@pytest.mark.parametrize("name", [name for name, (about, _) in WRITERS.items() if about])
def test_every_command_names_a_file_that_cannot_be_used(refuse, desk, given, name):
    refuse(name, "nowhere.yaml", saying=["nowhere.yaml"])
    (desk / "binary.yaml").write_bytes(bytes(range(256)) * 20)
    refuse(name, "binary.yaml", saying=["binary.yaml"])
    if SHORT_MOTION not in WRITERS[name][0]:
        bad = given("bad.yaml", f"{SCENARIO}drive: {{period: 0.002}}\n")
        refuse(name, bad, saying=["bad.yaml", "drive.period", "does not divide"])


BAD = {
    "profile.yaml": (SHORT, "[0.25, 0.5]", "[0.25, .nan]", ["joints[2]", "finite"]),
    "robot.sdf": (SDF, "<mass>300</mass>", "<mass>-300</mass>", ["roll_frame", "-300"]),
    "motion.csv": ("time,v_ref_1\n0,0\n0.005,fast\n", "", "", ["line 3", "fast"]),
}


@pytest.mark.parametrize("file", BAD)
def test_a_bad_file_is_refused_with_its_name(refuse, given, file):
    text, old, new, words = BAD[file]
    assert old in text
    given(file, text.replace(old, new, 1))
    robot = ["--robot", "../given/robot.sdf"] if file == "robot.sdf" else []
    motion = SHORT_MOTION if robot else f"../given/{file}"
    refuse("plan", motion, *robot, "--out", "o.csv", saying=[file, *words])


def test_what_drake_says_of_a_robot_is_one_line(tmp_path):
    """Its parser logs by itself, past Python's stderr: only a process of its own shows it."""
    (tmp_path / "bad.sdf").write_text(SDF.replace("<parent>arm</parent>", "<parent>leg</parent>"))
    refused(program("plan", "--robot", "bad.sdf", cwd=tmp_path), "bad.sdf", "leg")


# --- where results go -----------------------------------------------------------------------------


@pytest.mark.parametrize("name", WRITERS)
def test_a_place_that_cannot_be_is_refused_before_anything_is_computed(refuse, desk, idle, name):
    about, suffix = WRITERS[name]
    (desk / f"folder.{suffix}").mkdir()
    (desk / "file").write_text("a regular file")
    for out, words in (
        ("x.xyz", ["x.xyz: unknown kind of file", f".{suffix}"]),
        ("x", ["x: unknown kind of file"]),
        (f"folder.{suffix}", [f"folder.{suffix}: is a folder"]),
        (f"file/below.{suffix}", ["sdt-drake: file: is a file, expected a folder\n"]),
    ):
        refuse(name, *about, "--out", out, saying=words)


@pytest.mark.parametrize(
    "out",
    [
        *("", ".", "..", "/", "n" * 300 + ".csv", "step.txt/"),
        *(pytest.param(f"/proc/{x}here.csv", marks=needs_proc) for x in ("", "nothing/")),
    ],
)
def test_odd_places(refuse, out):
    """Named as they were given, not by the hidden file that is written first."""
    line = refuse(
        "plan", SHORT_MOTION, "--out", out, saying=[out.strip("./")[:300]], late="/proc" in out
    )
    assert "partial" not in line
    assert out or "Invalid value for --out: empty, expected a path" in line


def test_places_of_the_drive_table(refuse, desk):
    (desk / "file").write_text("a regular file")
    for options, words in (
        ("--drive-table t.txt", ["--drive-table: t.txt", ".csv"]),
        ("--drive-table a.csv --out a.csv", ["--drive-table: a.csv", "--out"]),
        # The other one would be good: neither is written.
        ("--drive-table t.csv --out file/o.csv", ["file", "expected a folder"]),
        ("--drive-table file/t.csv --out o.csv", ["file", "expected a folder"]),
        ("--drive-table t.csv --out o.csv", ["t.csv: joint 2 'roll' ends at 0.5 rad/s"]),
    ):
        refuse("plan", SHORT_MOTION, *options.split(), saying=words)


@pytest.mark.parametrize(
    "line",
    [
        f"diagram {RUN} --format dot --out {RUN}",
        f"diagram {RUN} --out file",
        "plan given.csv --period 0.01 --out given.csv",
        "plan given.csv --drive-table given.csv",
        "simulate csv.yaml --out given.csv",
        "pilot recorded.csv --out recorded.csv",
        f"plan {SHORT_MOTION} --out other.csv",
        f"view {SHORT_MOTION} --record other.html",
    ],
)
def test_no_command_replaces_what_it_reads_or_another_kind(call, desk, line):
    assert call("plan", SHORT_MOTION, "--out", "given.csv").code == 0
    assert "recorded" not in line or call("simulate", RUN, "--out", "recorded.csv").code == 0
    (desk / "csv.yaml").write_text(SCENARIO.replace("motion.yaml", "given.csv"))
    (desk / "other.csv").write_text("date,amount\n")
    (desk / "other.html").write_text("<p>mine</p>")
    (desk / "file").write_text("a regular file")
    before = snapshot(desk.parent)
    done = call(*line.split())
    assert done.code == 2 and is_one_line(done.err), done
    assert re.search("is read by this|holds something else|unknown kind of file", done.err)
    assert snapshot(desk.parent) == before


def test_a_refused_result_leaves_the_old_one(refuse, desk):
    (desk / "motion.csv").write_text("old")
    refuse("plan", "nowhere.yaml", "--out", "motion.csv")
    refuse("plan", SHORT_MOTION, "--torque-margin", "1e-9", "--out", "motion.csv")


def test_a_device_or_pipe_is_not_replaced_by_a_file(refuse, desk):
    """`--out /dev/null`, as root, must not turn the device into a file; here with a named pipe."""
    os.mkfifo(desk / "pipe.csv")
    refuse("plan", SHORT_MOTION, "--out", "pipe.csv", saying=["pipe.csv: is a device or pipe"])
    assert (desk / "pipe.csv").is_fifo()


@pytest.mark.parametrize("line", ["step --out o.pdf", f"diagram {RUN} --out o.svg"])
def test_a_disk_that_is_full_on_the_way(refuse, line, monkeypatch):
    """matplotlib does not say so in a way that could be passed on."""
    monkeypatch.setattr(sys, "dont_write_bytecode", True)  # Python would keep what it could write
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (2000, limits[1]))
    try:
        refuse(*line.split(), saying=[line[-5:], ": cannot be written (File too large)"], late=True)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)


def test_home_of_a_user(good, refuse, desk, monkeypatch):
    """As the shell has it in `--out ~/x`, but not in `--out=~/x`."""
    monkeypatch.setenv("HOME", str(desk / "home"))
    good("diagram", RUN, "--out=~/loop.dot")
    assert (desk / "home" / "loop.dot").is_file() and not (desk / "~").exists()
    refuse("step", "--out=~nobody_of_that_name/o.png", saying=["~nobody_of_that_name/o.png: "])


def test_a_name_does_not_lead_out_of_the_folder(good, desk, given):
    """A scenario from somebody else must not choose where `diagram` writes."""
    good("diagram", given("evil.yaml", f"{SCENARIO}name: ../escaped\n"))
    assert [path.suffix for path in desk.iterdir()] == [".dot"]


# --- what nobody foresaw --------------------------------------------------------------------------


def test_a_fault_is_one_short_line_that_says_in_what(call, monkeypatch):
    def run(**options):
        warnings.warn("overflow", RuntimeWarning, stacklevel=1)
        raise ZeroDivisionError("x" * 100_000 + "\n\x1b[31m\ud800")

    monkeypatch.setattr("sdt_drake.cli.step.run", run)
    done = call("step", "--zeta", "2")
    assert (done.code, done.out) == (70, "") and is_one_line(done.err) and len(done.err) < 1100
    assert done.err.startswith("sdt-drake: fault of the program, ZeroDivisionError (xxx")
    assert done.err.endswith(
        "x \\x1b[31m\\ud800), in: sdt-drake step --zeta 2; --traceback shows where\n"
    )
    done = call("step", "--traceback")
    assert done.code == 70 and "Traceback" in done.err and "in run\n" in done.err


def test_warnings_come_last_a_line_each(call, monkeypatch):
    def run(**options):
        warnings.warn("two\nlines", RuntimeWarning, stacklevel=1)
        print("done")

    monkeypatch.setattr("sdt_drake.cli.step.run", run)
    assert call("step") == (0, "done\n", "sdt-drake: warning: two lines\n")


def test_the_folder_that_we_are_in_is_gone(call, desk):
    (desk / "gone").mkdir()
    os.chdir(desk / "gone")
    (desk / "gone").rmdir()
    refused(call("step"), "sdt-drake: the current folder is gone, expected one that is there\n")


# --- streams --------------------------------------------------------------------------------------


def test_a_terminal_that_knows_ascii_only(monkeypatch):
    terminal = io.TextIOWrapper(io.BytesIO(), "ascii")
    monkeypatch.setattr(sys, "stdout", terminal)
    assert cli.main(["step", "--help"]) == 0
    assert b"kg m" in terminal.buffer.getvalue()


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="needs /dev/full")
def test_a_full_disk_behind_stdout_is_told(capfd, monkeypatch):
    with open("/dev/full", "w") as full:
        monkeypatch.setattr(sys, "stdout", full)
        assert cli.main(["step"]) == 2
        assert is_one_line(capfd.readouterr().err)
        monkeypatch.setattr(sys, "stderr", full)
        assert cli.main(["simulate", "nowhere.yaml"]) == 2


@pytest.mark.parametrize(("line", "code"), [("--help", 0), ("simulate nowhere.yaml", 2)])
@pytest.mark.parametrize("closed", ["2>&-", "<&- >&- 2>&-"])
def test_closed_streams_are_no_crash(line, code, closed):
    command = f"{sys.executable} -m sdt_drake {line} {closed}"
    assert subprocess.run(["sh", "-c", command], capture_output=True).returncode == code
