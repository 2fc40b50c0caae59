"""Fixtures for all tests; heavy imports are within them, as pytest's first process needs none."""

import contextlib
import fcntl
import gc
import hashlib
import io
import os
import pickle
import shutil
import signal
from concurrent.futures import Future
from copy import copy
from functools import partial
from types import SimpleNamespace

import pytest
from hypothesis import settings

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # idle threads of it would fight for the cores

pytest.register_assert_rewrite("helpers", "oracles")

settings.register_profile("suite", derandomize=True, deadline=None, database=None, max_examples=30)
settings.load_profile("suite")


def pytest_configure(config):
    if config.getoption("numprocesses", None):  # its workers, and all they start, compile code once
        os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
    else:
        for name in ("helpers.browser", "helpers.command_line"):
            config.pluginmanager.import_plugin(name)


def pytest_collection_finish():
    """What is loaded now stays until the end: the garbage collector need not look through it."""
    gc.freeze()


def pytest_collection_modifyitems(items):
    """Put first what the slowest fixtures are for: one worker makes them, beside the others."""
    slow = {"reproduced", "reproduction", "on_wrong_model"}
    items.sort(key=lambda item: slow.isdisjoint(item.fixturenames))


# --- every test ------------------------------------------------------------------------------


@pytest.fixture(scope="session", autouse=True)
def _ctrl_c_is_heard():
    """Shells that start pytest by `&` ignore SIGINT, and every process below would inherit that."""
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(scope="session", autouse=True)
def _no_screen():
    import matplotlib

    matplotlib.use("agg")


@pytest.fixture(autouse=True)
def _only_shipped_controllers(monkeypatch):
    """Forget controllers that a test registers: schemas and messages list all of them."""
    from sdt_drake.io.schema import schema_of
    from sdt_drake.run import options
    from sdt_drake.run.controllers import SHIPPED

    monkeypatch.setattr(options, "_loaded", {})
    yield
    if options.CONTROLLERS != SHIPPED:
        options.CONTROLLERS.clear()
        options.CONTROLLERS.update(SHIPPED)
        schema_of.cache_clear()


@pytest.fixture(autouse=True)
def _clean_figures_and_seed():
    import matplotlib.pyplot as plt
    import numpy as np

    np.random.seed(0)
    yield
    plt.close("all")


@pytest.fixture(autouse=True)
def _wide_terminal(monkeypatch):
    """Print tables in one piece, so that tests can read them."""
    monkeypatch.setenv("COLUMNS", "1000")


@pytest.fixture(scope="session")
def _no_home(tmp_path_factory):
    return tmp_path_factory.mktemp("home")


@pytest.fixture(autouse=True)
def _nothing_is_trusted(_no_home, monkeypatch):
    """Forget the files that the user, or the test before, trusts."""
    from sdt_drake.io import trust

    monkeypatch.setenv("XDG_CONFIG_HOME", str(_no_home))
    monkeypatch.setattr(trust, "_accepted", set())
    yield
    shutil.rmtree(_no_home / "sdt_drake", ignore_errors=True)


# --- made once -------------------------------------------------------------------------------


@pytest.fixture(scope="session")
def once(tmp_path_factory, worker_id):
    """`once(name, make)`: the result of `make(folder)`, made by the first of pytest's processes.

    The folder is new, and for all processes; nothing in it may be changed later.
    """
    own = tmp_path_factory.getbasetemp()
    shared = (own if worker_id == "master" else own.parent) / "shared"

    def get(name, make):
        folder = shared / name
        folder.mkdir(parents=True, exist_ok=True)
        with (shared / f"{name}.pickle").open("a+b") as file:
            fcntl.flock(file, fcntl.LOCK_EX)
            file.seek(0)
            if content := file.read():
                return pickle.loads(content)
            made, content = make(folder), io.BytesIO()
            _Pickler(content).dump(made)
            file.write(content.getvalue())
            return made

    return get


class _Pickler(pickle.Pickler):
    """Pickles robots by their files, as Drake's plants cannot be pickled, and waits for futures."""

    def reducer_override(self, thing):
        from sdt_drake.robot.robot import Robot, load_robot

        if isinstance(thing, Robot):
            return load_robot, (thing.path,)
        if isinstance(thing, Future):
            return partial(SimpleNamespace, result=partial(copy, thing.result())), ()
        return NotImplemented


@pytest.fixture
def undrawn(monkeypatch):
    """Figures as files of few bytes: drawing takes most of the time of a report."""
    _draw_less(monkeypatch)


def _draw_less(monkeypatch):
    """Write files that differ as soon as a line, a text or what is in a figure does."""
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D
    from matplotlib.text import Text

    svg = "<svg xmlns='http://www.w3.org/2000/svg' width='600' height='400'><!-- {} -->{}</svg>"
    formats, draw = {"svg": svg, "png": "\x89PNG\r\n\x1a\n {} {}"}, Figure.savefig

    def savefig(self, file, *, format, **options):
        if format not in formats:
            return draw(self, file, format=format, **options)
        drawn = [*_drawn(self)]
        content = [type(x).__name__ for x in drawn]
        content += [x.get_text() for x in drawn if isinstance(x, Text)]
        content += [x.get_xydata().tobytes() for x in drawn if isinstance(x, Line2D)]
        digest = hashlib.sha256(repr(content).encode()).hexdigest()
        axes = "".join(f'<g id="axes_{k + 1}"/>' for k in range(len(self.axes)))
        return file.write(formats[format].format(digest, axes).encode("latin-1"))

    monkeypatch.setattr(Figure, "savefig", savefig)


def _drawn(artist):
    """An artist and all in it but ticks, which matplotlib would make for that."""
    from matplotlib.axis import Axis

    yield artist
    for child in [artist.label] if isinstance(artist, Axis) else artist.get_children():
        yield from _drawn(child)


@pytest.fixture(scope="session")
def _meshcat():
    """A Meshcat until the end: freed by another thread than its own, it ends the process."""
    from sdt_drake.show.view3d.viewer import open_meshcat

    return open_meshcat()


@pytest.fixture
def meshcat(_meshcat):
    """An empty Meshcat."""
    _meshcat.Delete()
    return _meshcat


@pytest.fixture(scope="session")
def robot():
    """The reference device."""
    from sdt_drake.robot.robot import load_robot

    return load_robot()


@pytest.fixture(scope="session")
def _reference_design(robot):
    from sdt_drake.run.design import make_design
    from sdt_drake.run.scenario import load_scenario

    return make_design(load_scenario("coupled_pi_ctc"), robot=robot)


@pytest.fixture
def design(_reference_design):
    """The design of the shipped scenario coupled_pi_ctc; do not change it."""
    return _reference_design


@pytest.fixture(scope="session")
def designed(_reference_design):
    """A design from a shipped scenario and fields by dotted name, along the reference motion.

    `start` and `end` [s] cut the motion; the robot rests for `rest` samples before it. `motion`
    replaces it.
    """
    import numpy as np

    from sdt_drake.motion import Motion
    from sdt_drake.run.design import make_design
    from sdt_drake.run.scenario import load_scenario

    base = _reference_design

    def cut(start, end, rest):
        period = base.reference.tracked.period
        v = base.reference.tracked.v[round(start / period) : round(end / period) + 1]
        v = np.vstack([np.zeros((rest, base.device.simulated.n)), v])
        return Motion.from_speeds(period, base.reference.tracked.q[0], v)

    def make(name, fields=None, *, start=0.0, end=None, rest=0, motion=None):
        along = motion or (base.reference.tracked if end is None else cut(start, end, rest))
        scenario = load_scenario(name).changed(fields or {})
        return make_design(scenario, robot=base.nominal, motion=along)

    return make


@pytest.fixture(scope="session")
def _reproduced(once):
    """What one run of `sdt-drake reproduce` has written and computed, `undrawn`."""

    from sdt_drake.cli.app import main
    from sdt_drake.paper import reproduction as module

    def make(folder):
        computed, reproduce = [], module.reproduce

        def keep(watch):
            computed.append(reproduce(watch))
            return computed[0]

        with pytest.MonkeyPatch.context() as patch, contextlib.redirect_stdout(io.StringIO()):
            patch.setattr(module, "reproduce", keep)
            _draw_less(patch)
            assert main(["reproduce", "--out", str(folder)]) == 0
        return folder, computed[0]

    return once("reproduced", make)


@pytest.fixture(scope="session")
def reproduced(_reproduced):
    """The folder that one run of `sdt-drake reproduce` has written; do not change it."""
    return _reproduced[0]


@pytest.fixture(scope="session")
def reproduction(_reproduced):
    """The paper recomputed, in memory; do not change it."""
    return _reproduced[1]


@pytest.fixture(scope="session")
def on_wrong_model(once):
    """Runs of the scenario wrong_model by label of the controller; do not change them."""
    from sdt_drake.analysis.comparison import compare
    from sdt_drake.run.scenario import load_scenario

    labels = ["pi", "pi_ctc", "pi_dob", "pi_id", "p_pi", "p_pi+id", "pi_scheduled"]
    labels += ["inverse_dynamics"]

    def make(_):
        return {run.label: run for run in compare(load_scenario("wrong_model"), labels)}

    return once("wrong_model", make)


@pytest.fixture(scope="session")
def on_exact_model(reproduction):
    """Runs of the scenario coupled_pi by label of the controller; do not change them."""
    from sdt_drake.analysis.comparison import compare
    from sdt_drake.run.scenario import load_scenario

    (observed,) = compare(load_scenario("coupled_pi"), ["pi_dob"])
    return {run.label: run for run in reproduction.beyond} | {"pi_dob": observed}
