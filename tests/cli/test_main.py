"""The process of `sdt-drake`: what it imports; signals at any moment, which leave nothing."""

import signal
import subprocess
import sys

import pytest

# Sends signals to itself at the first event of Python of that kind that names a word; `seen` says
# that it came to that.
DRIVER = """
import os, runpy, sys
numbers, event, word, *sys.argv = sys.argv[1:]
waiting = True
def hook(name, values):
    global waiting
    if waiting and name == event and word in str(values[0]):
        waiting = False
        open("seen", "w").close()
        for number in numbers.split(","):
            number and os.kill(os.getpid(), int(number))
sys.addaudithook(hook)
runpy.run_module("sdt_drake", run_name="__main__", alter_sys=True)
"""
INT, TERM, HUP = signal.SIGINT, signal.SIGTERM, signal.SIGHUP


@pytest.fixture
def stopped(tmp_path):
    """Exit code and stderr of a command that gets signals at an event, and what it left."""

    def run(signals, event, word, *arguments, code="", ignored=()):
        numbers = ",".join(str(int(number)) for number in signals)
        done = subprocess.run(
            [sys.executable, "-c", code + DRIVER, numbers, event, word, "sdt-drake", *arguments],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            preexec_fn=lambda: [
                signal.signal(number, signal.SIG_IGN if number in ignored else signal.SIG_DFL)
                for number in (INT, TERM, HUP)  # whatever we were started with
            ],
        )
        left = {path.name for path in tmp_path.iterdir()}
        assert "seen" in left
        return done.returncode, done.stderr, left - {"seen"}

    return run


def test_ctrl_c_during_import_ends_quietly(stopped):
    line = ("step", "--out", "o.png")
    assert stopped([INT, INT], "import", "matplotlib.figure", *line) == (130, "", set())


# What a command does, instead of its own work.
RUN = """
import threading
from pathlib import Path
import sdt_drake.cli.step as step
from sdt_drake.io.files import replacing, replacing_files
def with_threads(**options):
    from sdt_drake.run.threads import threads
    with threads(1) as pool:
        for _ in range(2):
            pool.submit(threading.Event().wait)
        open("never", "rb")
def writing(**options):
    with replacing(Path("o.csv")) as partial:
        partial.write_text("all of it")
def moving(**options):
    with replacing_files(Path("o")) as new:
        for name in ("a.csv", "b.csv"):
            (new / name).write_text("all of it")
step.run = """


def test_ctrl_c_does_not_wait_for_threads(stopped):
    assert stopped([INT], "open", "never", "step", code=RUN + "with_threads") == (130, "", set())


@pytest.mark.parametrize(
    ("signals", "ignored", "code", "left"),
    [
        ([INT], [], 130, set()),
        ([HUP], [], 129, set()),
        ([TERM, INT, TERM], [], 143, set()),  # further signals do not disturb the tidying up
        ([HUP], [HUP], 0, {"o.csv"}),  # below nohup
    ],
)
def test_signal_leaves_no_partial_file(stopped, signals, ignored, code, left):
    done = stopped(signals, "open", ".partial", "step", ignored=ignored, code=RUN + "writing")
    assert done == (code, "", left)


@pytest.mark.parametrize(
    ("event", "word", "names"),
    [
        ("open", "b.csv", []),
        ("os.rename", ".partial.csv", ["a.csv", "b.csv"]),  # the first of two into the folder
        ("shutil.rmtree", ".partial", ["a.csv", "b.csv"]),
    ],
)
def test_signal_leaves_all_files_of_a_set_or_none(stopped, tmp_path, event, word, names):
    code, err, left = stopped([TERM, INT], event, word, "step", code=RUN + "moving")
    assert (code, err, left) == (143, "", {"o"} if names else set())
    assert sorted(path.name for path in (tmp_path / "o").glob("*")) == names


@pytest.mark.parametrize(
    ("lines", "heavy"),
    [
        (["--help"], {"numpy", "rich.markdown"}),
        (["--version"], {"sdt_drake.cli.common"}),
        (["tune ../given/short.yaml", "simulate ../given/run.yaml"], {"matplotlib", "pandas"}),
    ],
)
def test_commands_import_only_what_they_need(desk, lines, heavy):
    code = (
        f"import sys\nfrom sdt_drake.cli.app import main\n"
        f"codes = [main(line.split()) for line in {lines}]\n"
        f"sys.exit(any(codes) or bool({heavy} & {{*sys.modules}}))"
    )
    assert subprocess.run([sys.executable, "-c", code], stdout=subprocess.DEVNULL).returncode == 0
