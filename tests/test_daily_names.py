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
from sdt_drake.analysis.linear import LinearModel
from sdt_drake.io.shown import aligned, formatted, rounded
from sdt_drake.run.kinds import CONTROLLERS
from sdt_drake.run.simulate import simulate

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
    assert set(sdt.__all__) == set(sdt._PLACES) <= set(dir(sdt))
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
    scenario = sdt.load("coupled_pi")
    for use in (sdt.loop, sdt.simulate, sdt.linear, sdt.view, lambda it: sdt.compare(it, ["pi"])):
        with pytest.raises(sdt.InputError, match=r"^design: a Scenario, expected a Design, as "):
            use(scenario)


def test_what_does_not_fit_is_one_line(robot, short, run):
    other = sdt.plan("leans", robot).motion
    for use, line in (
        (
            lambda: sdt.track(run, other),
            r"motion: of 4 joints: 65 s .*, expected .*: 0\.5 s ",
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
