"""Signals at any moment of `sdt-drake`: an exit code, no trace, and nothing left behind."""

from __future__ import annotations

import signal
import subprocess
import sys

import pytest
from test_cli import SCENARIO, SHORT

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
            os.kill(os.getpid(), int(number))
sys.addaudithook(hook)
runpy.run_module("sdt_drake", run_name="__main__", alter_sys=True)
"""


@pytest.fixture
def stopped(tmp_path):
    """Exit code and stderr of a command that gets signals at an event, and what it left."""

    def run(numbers, event, word, *arguments, code=DRIVER):
        (tmp_path / "short.yaml").write_text(SHORT)
        (tmp_path / "run.yaml").write_text(SCENARIO.format(name="run", motion="short.yaml"))
        before = {path.name for path in tmp_path.iterdir()}
        text = ",".join(str(int(number)) for number in numbers)
        done = subprocess.run(
            [sys.executable, "-c", code, text, event, word, "sdt-drake", *arguments],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            timeout=100,
        )
        left = {path.name for path in tmp_path.iterdir()} - before
        assert "seen" in left
        return done.returncode, done.stderr, left - {"seen"}

    return run


MODULES = (
    "argparse", "numpy.linalg", "pydrake.common", "pydrake.multibody.plant", "matplotlib.figure",
    "matplotlib.backends._backend_agg",
)  # fmt: skip


@pytest.mark.parametrize("module", MODULES)
def test_ctrl_c_while_a_module_is_imported(stopped, module):
    two = [signal.SIGINT, signal.SIGINT]
    assert stopped(two, "import", module, "simulate", "run.yaml", "--out", "o.png") == (
        130, "", set(),
    )  # fmt: skip


@pytest.mark.parametrize(
    ("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143), (signal.SIGHUP, 129)]
)
def test_a_file_that_is_begun_is_not_left(stopped, number, code):
    options = ("simulate", "run.yaml", "--out", "o.csv")
    assert stopped([number], "open", ".partial", *options) == (code, "", set())


def test_a_second_signal_does_not_disturb_the_tidying_up(stopped):
    signals = [signal.SIGTERM, signal.SIGINT, signal.SIGTERM]
    options = ("simulate", "run.yaml", "--out", "o.csv")
    assert stopped(signals, "open", ".partial", *options) == (143, "", set())


def test_ctrl_c_in_a_destructor_is_not_lost(stopped):
    """Python prints what is raised there, and goes on."""
    code = (
        """
class Dying:
    def __del__(self):
        open("never", "rb")
import sdt_drake.commands.step as step
def run(options):
    Dying()
    while True:
        pass
step.run = run
"""
        + DRIVER
    )
    assert stopped([signal.SIGINT], "open", "never", "step", code=code) == (130, "", set())


def test_ctrl_c_does_not_wait_for_what_runs_in_threads(stopped):
    code = (
        """
import threading
import sdt_drake.commands.step as step
from sdt_drake.analysis.threads import threads
def run(options):
    with threads(1) as pool:
        for _ in range(2):
            pool.submit(threading.Event().wait)
        open("never", "rb")
step.run = run
"""
        + DRIVER
    )
    assert stopped([signal.SIGINT], "open", "never", "step", code=code) == (130, "", set())


def test_what_is_ignored_stays_ignored(tmp_path):
    """Below nohup a closed terminal is no reason to end."""
    process = subprocess.Popen(
        [sys.executable, "-c", DRIVER, str(int(signal.SIGHUP)), "open", ".partial",
         "sdt-drake", "step", "--out", "o.png"],
        cwd=tmp_path,
        preexec_fn=lambda: signal.signal(signal.SIGHUP, signal.SIG_IGN),
    )  # fmt: skip
    assert process.wait(100) == 0
    assert {path.name for path in tmp_path.iterdir()} == {"seen", "o.png"}
