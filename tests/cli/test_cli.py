"""`sdt-drake` as a program: help, completion, files, faults, streams."""

import io
import os
import re
import resource
import shlex
import subprocess
import sys
import warnings

import pytest
from helpers.command_line import RUN, SCENARIO, SDF, SHORT_MOTION, is_one_line, program, refused
from helpers.every_command import EVERY
from matplotlib.figure import Figure

import sdt_drake
from sdt_drake.cli import COMMANDS, printing
from sdt_drake.cli import app as cli
from sdt_drake.cli.common import deliver
from sdt_drake.cli.old_forms import modern
from sdt_drake.io.resources import SHIPPED, find_file


def test_help_lists_all_commands_and_version(good):
    out = good("--help").out
    for name in COMMANDS:
        assert re.search(rf"^\s+{name}\b", out, re.M), name
    assert "example: sdt-drake" in out
    assert good("--version").out == f"sdt-drake {sdt_drake.__version__}\n"


@pytest.mark.parametrize("name", EVERY)
def test_help_of_every_command_has_an_example_that_is_accepted(good, name):
    words = name.split()
    out = " ".join(good(*words, "--help").out.split())
    behind = "Arguments|Options|Common|Commands|╭"
    example = re.search(f"example: sdt-drake ({name}.*?) (?:{behind})", out)[1]
    _, bound, _ = cli.commands(words[0]).parse_args(shlex.split(example))
    for argument in ("scenario", "motion", "sizing", "name", "study"):
        given = bound.arguments.get(argument) or "."
        if "." not in given:  # no file of a user
            find_file(given, *SHIPPED)


@pytest.mark.parametrize("columns", ["0", "1", "2", "\u00b2", "9" * 5000, "20000000"])
@pytest.mark.parametrize("line", ["plan --help", "--help", "list"])
def test_help_fits_terminals_of_any_width(call, columns, line, monkeypatch):
    """rich never ends lines of 0 to 2 columns, and fills those of very many."""
    monkeypatch.setenv("COLUMNS", columns)
    monkeypatch.setenv("LINES", columns)
    assert 20 <= printing.line_width() <= 500
    monkeypatch.setattr(cli.console, "width", printing.line_width())
    done = call(*line.split())
    assert done.code == 0 and 1000 < len(done.out) < 100_000


def test_completion_offers_names_files_fields_and_options(desk, tmp_path):
    (desk / "coupled_own.yaml").touch()
    (desk / "c[ou]*").mkdir()
    (desk / "c[ou]*" / "mine.yaml").touch()
    (tmp_path / "sdt-drake").write_text(f'#!/bin/sh\nexec {sys.executable} -m sdt_drake "$@"\n')
    (tmp_path / "sdt-drake").chmod(0o755)
    script = cli.commands().generate_completion(shell="bash")
    lines = {
        "simulate coupled_": {"coupled_pi", "coupled_pi_ctc", "coupled_own.yaml"},
        "plan leans --robot s": {"sdt"},
        "plan c[": {"c[ou]*", "c[ou]*/mine.yaml"},
        "si": {"simulate", "size"},
        "plan --planner l": {"limiter"},
        "bode coupled_pi --set plant.ki": {"plant.kind=axis", "plant.kind=coupled"},
        "bode coupled_pi --set drive.ref": {"drive.reference_delay=0.0"},
        "compare coupled_pi --controllers pi,p_": {"pi,p_pi"},
    }
    code = script
    for line in lines:
        words = shlex.join(["sdt-drake", *line.split(" ")])
        code += f"\nCOMP_WORDS=({words}); COMP_CWORD=$((${{#COMP_WORDS[@]}} - 1)); _sdt_drake"
        code += '\nprintf "%s " "${COMPREPLY[@]}"; echo'
    path = f"{tmp_path}:{os.environ['PATH']}"
    done = subprocess.run(
        ["bash", "-c", code], capture_output=True, text=True, env=os.environ | {"PATH": path}
    )
    assert done.stderr == ""
    assert [set(shlex.split(x)) for x in done.stdout.splitlines()] == [*lines.values()]


def test_drake_error_of_a_robot_is_one_line(tmp_path):
    """Its parser logs by itself, past Python's stderr: only a process of its own shows it."""
    (tmp_path / "bad.sdf").write_text(SDF.replace("<parent>arm</parent>", "<parent>leg</parent>"))
    refused(program("plan", "--robot", "bad.sdf", cwd=tmp_path), "bad.sdf", "leg")


OLD = {
    "identify --judge sdt f.yaml a.csv b.csv --cutoff 8":
        "judge sdt a.csv b.csv --cutoff 8 --friction f.yaml",
    "identify sdt --judge a.csv": "judge sdt a.csv",
    "pilot --validate --robot arm.sdf": "pilot validate --robot arm.sdf",
    "pilot leans --pilots=20 --model slow_yaw": "pilot people leans --pilots=20 --model slow_yaw",
    "export coupled_pi --fmu loop.fmu --fmu-input reference --set a=b":
        "export fmu coupled_pi --out loop.fmu --input reference --set a=b",
    "learn m.yaml --recording a.csv b.csv --state s --of torque":
        "learn update s a.csv b.csv --scenario m.yaml --of torque",
    "learn --state s --motion leans --recording a.csv": "learn update s a.csv --motion leans",
    "step --structure p_in_feedback --zeta 0.95": "step --setpoint-weight 0 --zeta 0.95",
    "scenarios coupled_pi": "list coupled_pi",
    "motions leans --robot arm.sdf": "list motions leans --robot arm.sdf",
    "reference scenario --out s.json": "docs files scenario --out s.json",
    "report out": "reproduce report out",
    "view sdt --record=a.html": "view sdt --out=a.html",
    "excite sdt --payload --out e.yaml": "excite sdt --only payload --out e.yaml",
    "excite --out e.yaml --payload seat": "excite --out e.yaml --only payload --payload seat",
    "excite sdt --payload": "excite sdt --only payload",
    "study mc.yaml --workers 2 --out mc": "study run mc.yaml --workers 2 --out mc",
}  # fmt: skip
"""Command lines of 0.4, and what they are now."""


@pytest.mark.parametrize("old", OLD)
def test_old_form_0_4_works_and_names_the_new_form(old):
    new, line = modern(shlex.split(old))
    assert new == shlex.split(OLD[old])
    named = re.search(" is '(.*?)' now; .* 0.7", line)[1].split()
    assert {x for x in named if x.islower()} <= {word.partition("=")[0] for word in new}
    assert modern(new) == (new, "")


def test_old_form_line_is_printed_once_after_the_work(call, desk):
    done = call("study", "--help")
    assert done.err == ""
    done = call("export", RUN, "--fmu", "a.fmu")
    assert done.code == 0 and "a.fmu written" in done.out and is_one_line(done.err)
    assert "'export fmu SCENARIO --out' now" in done.err


# --- files to write -------------------------------------------------------------------------------


def test_device_or_pipe_is_not_replaced_by_a_file(refuse, desk):
    """`--out /dev/null`, as root, must not turn the device into a file; here with a named pipe."""
    os.mkfifo(desk / "pipe.csv")
    refuse("plan", SHORT_MOTION, "--out", "pipe.csv", saying=["pipe.csv: is a device or pipe"])
    assert (desk / "pipe.csv").is_fifo()


@pytest.mark.parametrize("line", ["step --out o.pdf", f"diagram {RUN} --out o.svg", "init own"])
def test_full_disk_is_one_line_and_leaves_no_file(refuse, line, monkeypatch):
    monkeypatch.setattr(sys, "dont_write_bytecode", True)  # Python would keep what it could write
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (2000, limits[1]))
    try:
        refuse(*line.split(), saying=["o", ": cannot be written (File too large)"], late=True)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)


def test_home_of_a_user_is_found_after_an_equals_sign(good, refuse, desk, monkeypatch):
    """As the shell has it in `--out ~/x`, but not in `--out=~/x`."""
    monkeypatch.setenv("HOME", str(desk / "home"))
    good("diagram", RUN, "--out=~/loop.dot")
    assert (desk / "home" / "loop.dot").is_file() and not (desk / "~").exists()
    refuse("step", "--out=~nobody_of_that_name/o.png", saying=["~nobody_of_that_name/o.png: "])


def test_names_do_not_lead_out_of_the_folder(good, desk, given):
    """A scenario from somebody else must not choose where `diagram` writes."""
    good("diagram", given("evil.yaml", f"{SCENARIO}name: ../escaped\n"))
    assert [path.suffix for path in desk.iterdir()] == [".dot"]


# --- faults and warnings --------------------------------------------------------------------------


def test_internal_error_and_warning_are_one_line_each(call, monkeypatch):
    def run(*, zeta, **options):
        warnings.warn("two\nlines", RuntimeWarning, stacklevel=1)
        if "2" in str(zeta):
            raise ZeroDivisionError("x" * 100_000 + "\n\x1b[31m\ud800")
        print("done")
        return 1  # as of a study with failed runs

    monkeypatch.setattr("sdt_drake.cli.step.run", run)
    done = call("step", "--zeta", "2")
    assert (done.code, done.out) == (70, "") and is_one_line(done.err) and len(done.err) < 1100
    assert "internal error, ZeroDivisionError (xxx" in done.err
    assert "x \\x1b[31m\\ud800), in: sdt-drake step --zeta 2; " in done.err
    done = call("step", "--zeta", "2", "--traceback")
    assert done.code == 70 and "Traceback" in done.err and "in run\n" in done.err
    assert call("step", "--zeta", "1") == (1, "done\n", "sdt-drake: warning: two lines\n")


def test_exit_of_a_library_is_an_internal_error(call, monkeypatch):
    monkeypatch.setattr("sdt_drake.cli.step.run", lambda: sys.exit(0))
    done = call("step")
    assert done.code == 70 and "internal error, SystemExit (0)" in done.err


def test_figure_written_and_shown_is_drawn_once(desk, monkeypatch):
    drawn, shown = [], []
    monkeypatch.setattr("sdt_drake.show.style.show", shown.append)
    deliver(desk / "a.svg", True, lambda: drawn.append(Figure()) or drawn[-1], None)
    assert shown == drawn and len(drawn) == 1 and (desk / "a.svg").exists()


# --- streams --------------------------------------------------------------------------------------


@pytest.mark.parametrize("line, word", [("step --help", b"kg m"), ("step", b"settling")])
def test_terminal_of_ascii_alone_gets_all_words(monkeypatch, line, word):
    terminal = io.TextIOWrapper(io.BytesIO(), "ascii")
    monkeypatch.setattr(sys, "stdout", terminal)
    assert cli.main(line.split()) == 0
    terminal.flush()
    assert word in terminal.buffer.getvalue()


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="needs /dev/full")
def test_full_disk_behind_stdout_is_one_line(capfd, monkeypatch):
    with open("/dev/full", "w") as full:
        monkeypatch.setattr(sys, "stdout", full)
        assert cli.main(["step"]) == 2
        assert is_one_line(capfd.readouterr().err)
        monkeypatch.setattr(sys, "stderr", full)
        assert cli.main(["simulate", "nowhere.yaml"]) == 2


@pytest.mark.parametrize(
    ("line", "closed", "code"),
    [("--help", "2>&-", 0), ("simulate nowhere.yaml", "<&- >&- 2>&-", 2)],
)
def test_closed_streams_do_not_crash(line, code, closed):
    command = f"{sys.executable} -m sdt_drake {line} {closed}"
    assert subprocess.run(["sh", "-c", command], capture_output=True).returncode == code


def test_closed_pipe_still_writes_results(desk, monkeypatch):
    read, write = os.pipe()
    os.close(read)  # like `| head -0`
    monkeypatch.setattr(sys, "stdout", os.fdopen(write, "w"))
    assert cli.main(["step", "--out", "step.csv"]) == 0
    assert (desk / "step.csv").is_file()
