"""`import sdt_drake as sdt`: names of daily use; objects in a line, as tables, as figures."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path
from pkgutil import resolve_name

import numpy as np
import pytest
from matplotlib.figure import Figure
from pydrake.systems.primitives import Adder

import sdt_drake as sdt
from sdt_drake.analysis.comparison import Compared, Comparison
from sdt_drake.analysis.frequency_response import frequency_response
from sdt_drake.io.shown import aligned, formatted, rounded
from sdt_drake.machine.drive_files import Fed
from sdt_drake.machine.identify.model import plant_friction
from sdt_drake.robot.device import Friction
from sdt_drake.run.kinds import CONTROLLERS
from sdt_drake.run.simulate import simulate
from sdt_drake.systems.state_space import LinearModel

SOURCE = Path(sdt.__file__)


@pytest.fixture(scope="module")
def short(designed):
    return designed("coupled_pi_ctc", end=0.5)


@pytest.fixture(scope="module")
def run(short):
    return simulate(short)


def test_names_are_what_the_type_checker_takes_them_for():
    tree = ast.parse(SOURCE.read_text(encoding="utf-8"))
    block = next(node for node in tree.body if isinstance(node, ast.If))
    imported = {}
    for line in block.body:
        for name in line.names:
            own = name.asname or name.name
            imported[own] = resolve_name(f"{line.module}.{name.name}")
    assert {name: getattr(sdt, name) for name in sdt.__all__} == imported
    assert set(sdt.__all__) == set(sdt._PLACES)
    assert [name for name in dir(sdt) if not name.startswith("__")] == sorted(sdt.__all__)
    with pytest.raises(AttributeError, match="no attribute 'simulat'"):
        sdt.simulat  # noqa: B018


def test_functions_stay_whoever_imports_the_modules_of_their_names():
    """And nothing is loaded before it is asked for."""
    code = (
        "import sys, sdt_drake as sdt\n"
        "assert [m for m in sys.modules if m.startswith('sdt_drake')] == ['sdt_drake']\n"
        "assert not {'numpy', 'pydrake', 'typing', 'pkgutil'} & {*sys.modules} - BEFORE\n"
        "from sdt_drake.run.simulate import simulate\n"
        "import sdt_drake.run.design\n"
        "from sdt_drake.run.design import make_design\n"
        "assert sdt.simulate is simulate and sdt.design is make_design\n"
        "assert sys.modules['sdt_drake.run.simulate'].simulate is simulate\n"
    )
    code = "import sys; BEFORE = {*sys.modules}\n" + code
    subprocess.run([sys.executable, "-c", code], check=True)


def test_objects_show_themselves_shortly(robot, short, run):
    shown = {
        "Scenario": short.scenario,
        "Design": short,
        "Motion": short.motion,
        "Plan": sdt.plan("leans", robot),
        "Recording": run,
        "Comparison": Comparison([Compared("pi_ctc", short, run)]),
        "LinearModel": short.linear(),
        "Robot": robot,
        "Tracking": sdt.track(run, short.motion),
    }
    for name, thing in shown.items():
        line, text, page = repr(thing), str(thing), thing._repr_html_()
        narrow = aligned(*thing.summary()[1:], width=80)
        assert line.startswith(f"<{name} ") and len(line) <= 100 and "\n" not in line
        assert text.startswith(f"{name} ") and 3 <= len(text.splitlines()) <= 8
        assert max(map(len, narrow)) <= 80
        assert page.count("<tr>") == len(text.splitlines()) - 1 and f"<b>{name}</b>" in page
    # The numbers are those of the arrays.
    largest = np.abs(run.speed_error).max(axis=0)
    assert [line.split()[1] for line in str(run).splitlines()[2:]] == [f"{x:.4f}" for x in largest]
    assert f"{short.gains.ki[2]:.4g}" in str(short).splitlines()[4]
    scenario = sdt.load("package://sdt/scenarios/coupled_pi.yaml")
    scenario.name = "<b>"
    assert "&lt;b&gt;: pi on the coupled plant" in scenario._repr_html_()


def test_numbers_for_people():
    numbers = {-0.04: "0.0", -0.06: "-0.1", np.nan: "–", -np.inf: "-∞"}
    assert [formatted(x, ".1f") for x in numbers] == [*numbers.values()]


@pytest.mark.parametrize(
    "value, std, told",
    [
        (1.426e-19, 0.00061, "0.0000"),
        (-3e-7, 0.00061, "0.0000"),
        (0.01439, 0.035, "0.01"),
        (12.345, 0.0014, "12.3450"),
        (299.6, 12.0, "300"),
        (1234.5, 40.0, "1230"),
        (5.4321, 0.0, "5.432"),
        (5.4321, np.nan, "5.432"),
    ],
)
def test_numbers_are_told_as_far_as_they_are_known(value, std, told):
    assert rounded(value, std) == told


def test_wide_tables_fit_and_lose_nothing():
    header = ["controller", "joint", *(f"some quantity {i} [N m s/rad]" for i in range(9))]
    rows = [[c, k, *(f"{c}{k}{i}" for i in range(9))] for c in "ab" for k in "12"]
    assert len(aligned(header, rows, 2, 400)) == 5
    narrow = aligned(header, rows, 2, 60)
    assert max(map(len, narrow)) <= 60
    blocks = [block.splitlines() for block in "\n".join(narrow).split("\n\n")]
    assert len(blocks) == 3 and all("[N m s/rad]" in block[-5] for block in blocks)
    for k, row in enumerate(rows):
        cells = [block[-4 + k].split() for block in blocks]
        assert {tuple(part[:2]) for part in cells} == {tuple(row[:2])}
        assert [cell for part in cells for cell in part[2:]] == row[2:]


def test_objects_plot_themselves(robot, short, run):
    plan = sdt.plan("leans", robot)
    figures = [
        *(run.plot(short, joint=2), short.plot(), short.motion.plot()),
        *(plan.plot(robot), Comparison([Compared("pi_ctc", short, run)]).plot()),
    ]
    assert all(isinstance(figure, Figure) for figure in figures)
    titles = [figure.get_suptitle() for figure in figures]
    assert titles[1].endswith("effective inertia, motor side")
    assert titles[4].startswith("Comparison of 1 controllers on ")


def test_what_commands_do_is_done_by_functions(short, run, tmp_path):
    """With the numbers of the functions below them; the commands call the same."""
    response = sdt.bode(short, time=0.25)
    np.testing.assert_array_equal(
        response.loop_gain, frequency_response(short, sample=50).loop_gain
    )
    assert isinstance(response.plot(short), Figure) and "phase margin [deg]" in str(response)
    np.testing.assert_array_equal(sdt.tune(short)["i_eff_max"], short.inertia.maximum)

    run.save(tmp_path / "run.csv")
    replayed = sdt.replay(tmp_path / "run.csv", short.scenario)
    assert replayed.explained("speed_error").min() > 0.999999
    assert isinstance(replayed.plot(), Figure) and "speed error [%]" in str(replayed)

    lessons = sdt.learn(short, flights=1)
    np.testing.assert_array_equal(lessons.best.largest, np.abs(run.position_error).max(axis=0))
    assert str(lessons).startswith("Lessons of 1 flight(s), best: 1, stopped: nobody feels")


def test_identify_takes_names_and_files(designed, tmp_path):
    """Friction of a robot whose links are as its file has them."""
    friction = Friction(coulomb=[300.0, 60.0, 10.0, 20.0], viscous=[40.0, 10.0, 8.0, 2.0])
    design = designed("coupled_pi_ctc", {"plant.friction": friction}, end=8.0)
    simulate(design).save(tmp_path / "run.csv")
    found = sdt.identify("sdt", tmp_path / "run.csv", only="friction")
    coulomb = plant_friction(found).friction.coulomb
    np.testing.assert_allclose(coulomb[2:], [10, 20], rtol=1e-3)  # that go both ways
    assert found.nominal.name == "sdt" and "torque not explained" in str(found)


def test_export_takes_a_motion_from_rest_to_rest(tmp_path, robot):
    v = np.sin(np.pi * np.linspace(0, 1, 101))[:, None] ** 2 * [0.01, 0.02, 0.02, 0.05]
    sdt.Motion.from_speeds(0.005, np.zeros(4), v).to_csv(tmp_path / "m.csv")
    scenario = sdt.load("training", {"motion": str(tmp_path / "m.csv")})
    fed = sdt.export(scenario, "drives", tmp_path / "out", cam_points=60)
    assert {x.source for x in fed} == {p.name for p in (tmp_path / "out").iterdir()} - {
        "read_back.csv"
    } | {"motion", "motion, no torque"}
    assert isinstance(fed[0], Fed) and np.all(fed[1].position_error < 1e-3)


@pytest.mark.parametrize(
    ("use", "message"),
    [
        (lambda short: sdt.bode(short, time=0.6), r"time: 0\.6 s, the motion ends at 0\.5 s"),
        (lambda short: sdt.bode(short, time="a"), "time: a, expected a finite number >= 0"),
        (lambda short: sdt.identify(3, "run.csv"), "path: a int, expected a path"),
        (lambda short: sdt.identify("sdt", []), "recordings: none given"),
        (lambda short: sdt.identify("sdt", [short]), "recordings: a Design, expected a path"),
        (lambda short: sdt.identify("sdt", "r", only="x"), "only: 'x', expected one of payload"),
        (lambda short: sdt.identify("sdt", "r", held_out=1), "held_out: 1, expected less than 1"),
        (lambda short: sdt.identify("sdt", "r", side="x"), "side: 'x', expected one of joint"),
        (lambda short: sdt.replay("run.csv", short), "scenario: a Design, expected a Scenario"),
        (lambda short: sdt.learn(short, flights=0), "flights: 0, expected a whole number >= 1"),
        (lambda short: sdt.learn(short, of="x"), "of: 'x', expected one of reference, torque"),
        (lambda short: sdt.export(short, 3, "out"), "drives: a int, expected a path"),
        (lambda short: sdt.export(short, "drives", None), "folder: a NoneType, expected a path"),
    ],
)
def test_arguments_that_are_none(short, use, message):
    with pytest.raises(sdt.InputError, match=f"^{message}"):
        use(short)


def test_tables_of_pandas(short, run):
    pytest.importorskip("pandas")
    table = run.to_pandas()
    assert table.index.name == "time" and np.array_equal(table.index, run.time)
    assert np.array_equal(table["tau_cmd_2"], run.tau_cmd[:, 1])
    assert np.array_equal(short.motion.to_pandas()["vd_ref_4"], short.motion.vd[:, 3])
    compared = Comparison([Compared("pi_ctc", short, run)]).to_pandas()
    assert compared.loc[("pi_ctc", "roll"), "max_abs_speed_error"] == pytest.approx(
        np.abs(run.speed_error[:, 1]).max()
    )


def test_poles_of_the_axis_loop_are_those_of_the_papers_transfer_function(designed):
    """v / v_ref = K_IS / (I s² + K_PS s + K_IS), Section 3.3 with P in the feedback path."""
    pytest.importorskip("control")
    design = designed("axis_pi", end=0.5)
    model = design.linear()
    system = model.to_control()
    for k in range(4):
        kp, ki, inertia = design.gains.kp[k], design.gains.ki[k], design.i_eff[k]
        poles = np.roots([inertia, kp, ki])
        for pole in poles:
            assert np.abs(system.poles() - pole).min() < 1e-9 * abs(pole)
        s = 10j
        gain = system(s)[model.outputs.index(f"v_{k + 1}"), model.inputs.index(f"v_ref_{k + 1}")]
        assert gain == pytest.approx(ki / (inertia * s**2 + kp * s + ki), rel=1e-9)
        # The load torque acts on the motor: v = s / (I s² + ...) tau / r.
        load = system(s)[model.outputs.index(f"v_{k + 1}"), model.inputs.index(f"tau_ff_{k + 1}")]
        r = design.robot.gear_ratio[k]
        assert load == pytest.approx(s / (inertia * s**2 + kp * s + ki) / r, rel=1e-9)
    assert list(system.state_labels) == list(model.states)
    assert np.count_nonzero(np.abs(model.A[:4, 4:8] - np.eye(4)) > 1e-12) == 0  # q' = v


SAMPLED = {"drive.period": 0.001, "drive.encoder_resolution": [1e6] * 4}


@pytest.mark.parametrize("fields", [{}, SAMPLED], ids=["continuous", "sampled"])
@pytest.mark.parametrize("kind", CONTROLLERS)
def test_every_state_has_a_name(designed, kind, fields):
    model = designed("coupled_pi", {"controller.kind": kind, **fields}, end=0.5).linear(20)
    assert isinstance(model, LinearModel)
    assert model.A.shape == (len(model.states),) * 2
    assert model.B.shape[1], model.C.shape[0] == (len(model.inputs), len(model.outputs))
    assert len(set(model.states)) == len(model.states)
    rest = {name.rpartition("_")[0] for name in model.states[8:]}
    assert rest <= {"q_before", "integral"}, rest


@pytest.mark.parametrize("sample", [101, 1.5, None, "a"])
def test_a_sample_that_is_not_there(short, sample):
    expected = f"sample: {sample!r}, expected a whole number from 0 to 100"
    with pytest.raises(sdt.InputError, match=expected):
        short.linear(sample)


def test_a_rate_that_is_no_number(short):
    with pytest.raises(sdt.InputError, match="realtime_rate: fast, expected a finite number >= 0"):
        sdt.simulate(short, realtime_rate="fast")


def test_one_kind_for_another_is_one_line():
    with pytest.raises(sdt.InputError, match=r"^scenario: a str, expected a Scenario, as .*\.load"):
        sdt.design("coupled_pi")
    with pytest.raises(sdt.InputError, match=r"^robot: a str, expected a Robot, as .*load_robot"):
        sdt.plan("leans", "sdt")
    uses = (sdt.loop, sdt.simulate, sdt.linear, sdt.view, lambda it: sdt.compare(it, ["pi"]))
    for use in (*uses, sdt.bode, sdt.tune, sdt.learn, lambda it: sdt.export(it, "drives", "out")):
        with pytest.raises(sdt.InputError, match=r"^design: a str, expected a Design, as "):
            use("coupled_pi")


def test_what_does_not_fit_is_one_line(robot, short, run):
    other = sdt.plan("leans", robot).motion
    for use, line in (
        (
            lambda: sdt.track(run, other),
            r"motion: of 4 joints: 90 s .*, expected .*: 0\.5 s ",
        ),
        (lambda: sdt.track(run, "leans"), "motion: a str, expected a Motion"),
        (lambda: sdt.track(short, other), "recording: a Design, expected a Recording"),
        (lambda: run.plot(short, joint="2"), "joint: '2', expected 1 to 4"),
        (lambda: short.motion.plot(["a"]), r"joint_names: 1 name\(s\), expected 4"),
        (lambda: sdt.load("coupled_pi", ["a=b"]), r"changes: \['a=b'\], expected values by dotted"),
        (lambda: sdt.load("coupled_pi", {1: 2}), r"changes: \{1: 2\}, expected values by dotted"),
    ):
        with pytest.raises(sdt.InputError, match=f"^{line}.*$"):
            use()


def test_labels_and_controllers_are_not_each_other(short):
    with pytest.raises(sdt.InputError, match=r"^controllers: 'pi', expected a list .* \['pi'\]$"):
        sdt.compare(short, "pi")
    with pytest.raises(sdt.InputError, match=r"^controller: a str, expected a System"):
        sdt.loop(short, controller="pi")
    with pytest.raises(sdt.InputError, match=r"^controller: the class Adder, expected a System"):
        sdt.loop(short, controller=Adder)
