"""Shared fixtures: the reference device and its designs, made once."""

from __future__ import annotations

import contextlib
import gc
import io
import shutil
import signal
from pathlib import Path

import matplotlib
import numpy as np
import pytest
import sharing  # before anybody imports what it replaces
from matplotlib.figure import Figure
from pydrake.geometry import Meshcat

matplotlib.use("Agg")

from sdt_drake.analysis.reproduction import Reproduction, Stopwatch, reproduce
from sdt_drake.cli.app import main
from sdt_drake.io import shown, trust
from sdt_drake.motion import Motion
from sdt_drake.robot.robot import Robot, load_robot
from sdt_drake.run import kinds
from sdt_drake.run.design import Design, make_design
from sdt_drake.run.scenario import load_scenario, with_fields
from sdt_drake.show import style
from sdt_drake.show.view3d.viewer import open_meshcat

gc.disable()  # until all tests are collected
style._STYLE["savefig.dpi"] = 65  # half of what users get: nobody looks at these


def pytest_collection_finish():
    """Garbage is looked for seldom, and not in what is imported and collected by now."""
    gc.freeze()
    gc.set_threshold(50_000)
    gc.enable()


@pytest.fixture(scope="module", autouse=True)
def _garbage_ends_with_its_tests():
    """What tests have left to others is not looked through again and again; it takes seconds."""
    yield
    gc.collect()
    gc.freeze()


@pytest.hookimpl(tryfirst=True)
def pytest_sessionfinish():
    """Nor in what is left at the end, by pytest ten times and once by Python."""
    gc.freeze()


@pytest.fixture(autouse=True)
def _clean_figures_and_seed():
    np.random.seed(0)
    yield
    import matplotlib.pyplot as plt

    plt.close("all")


@pytest.fixture(autouse=True)
def _wide_terminal(monkeypatch):
    """Tables are printed in one piece, so that tests can read them."""
    monkeypatch.setattr(shown, "terminal_width", lambda: 1000)


@pytest.fixture(scope="session")
def _no_home(tmp_path_factory):
    return tmp_path_factory.mktemp("home")


@pytest.fixture(autouse=True)
def _nothing_is_trusted(_no_home, monkeypatch):
    """Neither by whoever runs the tests, nor by the test before."""
    monkeypatch.setenv("XDG_CONFIG_HOME", str(_no_home))
    monkeypatch.setattr(trust, "_accepted", set())
    yield
    shutil.rmtree(_no_home / "sdt_drake", ignore_errors=True)


@pytest.fixture(autouse=True)
def _own_controllers_end_with_their_test(monkeypatch):
    monkeypatch.setattr(kinds, "_loaded", {})
    before = dict(kinds.CONTROLLERS)
    yield
    kinds.CONTROLLERS.clear()
    kinds.CONTROLLERS.update(before)


@pytest.fixture(scope="session", autouse=True)
def _ctrl_c_is_heard() -> None:
    """A script that starts us by `&` has it ignored, and all that we start would inherit that."""
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(scope="session", autouse=True)
def _shared_runs(tmp_path_factory, worker_id):
    """One folder for all processes of this run."""
    own = tmp_path_factory.getbasetemp()
    sharing.folder = (own if worker_id == "master" else own.parent) / "shared"
    sharing.folder.mkdir(exist_ok=True)


@pytest.fixture
def undrawn(monkeypatch):
    """Figures cost most of the time of a report: write few bytes instead."""
    svg = b'<svg xmlns="http://www.w3.org/2000/svg"/>'
    monkeypatch.setattr(Figure, "savefig", lambda self, path, **options: path.write(svg))


@pytest.fixture(scope="session")
def robot() -> Robot:
    """The reference device."""
    return load_robot()


@pytest.fixture(scope="session")
def _meshcat() -> Meshcat:
    """Kept to the end: one that is freed by another thread than its own ends the process."""
    return open_meshcat()


@pytest.fixture
def meshcat(_meshcat: Meshcat) -> Meshcat:
    """One that is empty."""
    _meshcat.Delete()
    return _meshcat


@pytest.fixture(scope="session")
def _reference_design() -> Design:
    return make_design(load_scenario("package://sdt/scenarios/coupled_pi_ctc.yaml"))


@pytest.fixture
def design(_reference_design: Design) -> Design:
    """The shipped coupled PI + CTC run; do not change it."""
    return _reference_design


@pytest.fixture(scope="session")
def designed(_reference_design: Design):
    """A design from a shipped scenario and fields by dotted name, along the reference motion.

    `start` and `end` [s] cut it; `rest` is how many samples it rests before that; another `motion`
    is taken instead.
    """
    base = _reference_design

    def cut(start, end, rest) -> Motion:
        period = base.motion.period
        v = base.motion.v[round(start / period) : round(end / period) + 1]
        v = np.vstack([np.zeros((rest, base.robot.n)), v])
        return Motion.from_speeds(period, base.motion.q[0], v)

    def make(name, fields=None, *, start=0.0, end=None, rest=0, motion=None) -> Design:
        along = motion or (base.motion if end is None else cut(start, end, rest))
        scenario = with_fields(load_scenario(name), fields or {})
        return make_design(scenario, robot=base.robot, motion=along)

    return make


@pytest.fixture(scope="session")
def reproduced(_shared_runs) -> Path:
    """The folder that one run of `sdt-drake reproduce` has written; do not change it."""

    def make():
        folder = sharing.folder / "reproduced"
        with contextlib.redirect_stdout(io.StringIO()):
            assert main(["reproduce", "--out", str(folder)]) == 0
        return folder

    return sharing.once("reproduced", make)


@pytest.fixture(scope="session")
def reproduction(_shared_runs) -> Reproduction:
    """The paper recomputed, in memory; do not change it."""
    return reproduce(Stopwatch(lambda line: None))
