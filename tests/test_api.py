"""`import sdt_drake as sdt`: names; objects in a line, as tables, as figures; wrong arguments."""

import ast
import base64
import copy
import dataclasses
import inspect
import json
import re
import subprocess
import sys
from collections import Counter
from pathlib import Path
from pkgutil import resolve_name

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.figure import Figure
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import Adder, Sine

import sdt_drake as sdt
from sdt_drake.analysis.comparison import Compared, Comparison
from sdt_drake.analysis.frequency_response import frequency_response
from sdt_drake.io.errors import InputError
from sdt_drake.io.shown import aligned, formatted, rounded
from sdt_drake.motion import Motion
from sdt_drake.run.simulate import simulate

STILL = Motion.from_speeds(0.005, np.zeros(4), np.zeros((21, 4)))


@pytest.fixture(scope="module")
def short(designed):
    return designed("coupled_pi_ctc", end=0.5)


@pytest.fixture(scope="module")
def run(short):
    return simulate(short)


# --- names ----------------------------------------------------------------------------------------


def test_names_are_what_a_type_checker_takes_them_for():
    tree = ast.parse(Path(sdt.__file__).read_text(encoding="utf-8"))
    block = next(node for node in tree.body if isinstance(node, ast.If))
    named = [(line.module, name) for line in block.body for name in line.names]
    imported = {x.asname or x.name: resolve_name(f"{module}.{x.name}") for module, x in named}
    assert {name: getattr(sdt, name) for name in sdt.__all__} == imported
    assert [name for name in dir(sdt) if not name.startswith("__")] == sorted(sdt.__all__)
    with pytest.raises(AttributeError, match="no attribute 'simulat'"):
        sdt.simulat  # noqa: B018


def test_import_loads_nothing_and_functions_stay_after_that_of_their_modules():
    code = (
        "import sys; BEFORE = {*sys.modules}\n"
        "import sdt_drake as sdt\n"
        "assert [m for m in sys.modules if m.startswith('sdt_drake')] == ['sdt_drake']\n"
        "assert not {'numpy', 'pydrake', 'typing', 'pkgutil'} & {*sys.modules} - BEFORE\n"
        "import sdt_drake.run.design\n"
        "from sdt_drake.run.simulate import simulate\n"
        "assert sdt.simulate is simulate and sdt.design is sdt_drake.run.design.make_design\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


# --- objects --------------------------------------------------------------------------------------


def test_objects_have_short_reprs(robot, short, run):
    compared = Comparison([Compared("pi_ctc", short, run)])
    plan = sdt.plan("leans", robot)
    shown = [short.scenario, short, short.reference.tracked, plan, run, compared]
    for thing in [*shown, short.linear(), robot, sdt.track(run)]:
        name, line, text, page = type(thing).__name__, repr(thing), str(thing), thing._repr_html_()
        assert line.startswith(f"<{name} ") and len(line) <= 100 and "\n" not in line
        assert text.startswith(f"{name} ") and 3 <= len(text.splitlines()) <= 8
        assert max(map(len, aligned(*thing.summary()[1:], width=80))) <= 80
        assert page.count("<tr>") == len(text.splitlines()) - 1 and f"<b>{name}</b>" in page
    largest = np.abs(run.speed_error).max(axis=0)
    assert [line.split()[1] for line in str(run).splitlines()[2:]] == [f"{x:.4f}" for x in largest]
    scenario = dataclasses.replace(short.scenario, name="<b>")
    assert "&lt;b&gt;: PI + CTC on the coupled plant" in scenario._repr_html_()


def test_comparison_over_time_and_its_page_show_the_errors_of_each_joint(short, run, tmp_path):
    compared = Comparison([Compared("pi_ctc", short, run)])
    for ax, error in zip(compared.plot(over_time=True).axes, run.speed_error.T, strict=True):
        np.testing.assert_array_equal(ax.lines[0].get_ydata(), error)
    compared.page(tmp_path / "a.html")
    page = (tmp_path / "a.html").read_text(encoding="utf-8")
    plots = [json.loads(x) for x in re.findall(r'application/json">(.*?)</script>', page)]
    units = ["rad/s", "deg", "N m"]
    errors = (run.speed_error, np.degrees(run.position_error), run.tau)
    for own, unit, values in zip(plots, units, errors, strict=True):
        for panel, expected in zip(own["panels"], values.T, strict=True):
            assert f"[{unit}]" in panel["y_label"]
            shown = base64.b64decode(own["arrays"][panel["lines"][0]["values"]])
            np.testing.assert_allclose(np.frombuffer(shown, "<f4"), expected, rtol=1e-6)
    with pytest.raises(InputError, match="html"):
        compared.page(tmp_path / "a.png")


@given(st.lists(st.lists(st.text("abc", min_size=1, max_size=9), max_size=9), min_size=1))
def test_table_keeps_all_words_of_headers(headers):
    lines = aligned([" ".join(words) for words in headers], [["1"] * len(headers)], width=20)
    found = Counter(" ".join(lines).split())
    assert not Counter(word for words in headers for word in words) - found
    assert found["1"] >= len(headers)


@pytest.mark.parametrize(
    ("value", "std", "text"),
    [
        (1.426e-19, 0.00061, "0.0000"),
        (-3e-7, 0.00061, "0.0000"),
        (0.01439, 0.035, "0.01"),
        (12.345, 0.0014, "12.3450"),
        (1234.5, 40.0, "1230"),
        (5.4321, 0.0, "5.432"),
        (5.4321, np.nan, "5.432"),
    ],
)
def test_printed_numbers_have_known_digits(value, std, text):
    assert rounded(value, std) == text


def test_wide_tables_fit_the_terminal_and_lose_nothing():
    assert [formatted(x, ".1f") for x in (-0.04, np.nan, -np.inf)] == ["0.0", "–", "-∞"]
    header = ["controller", "joint", *(f"some quantity {i} [N m s/rad]" for i in range(9))]
    rows = [[c, k, *(f"{c}{k}{i}" for i in range(9))] for c in "ab" for k in "12"]
    assert len(aligned(header, rows, 2, 400)) == 5
    narrow = aligned(header, rows, 2, 60)
    blocks = [block.splitlines() for block in "\n".join(narrow).split("\n\n")]
    assert max(map(len, narrow)) <= 60 and len(blocks) == 3
    for k, row in enumerate(rows):
        cells = [block[-4 + k].split() for block in blocks]
        assert {tuple(part[:2]) for part in cells} == {tuple(row[:2])}
        assert [cell for part in cells for cell in part[2:]] == row[2:]


@pytest.mark.parametrize(
    ("header", "rows", "keys", "expected"),
    [
        (  # turned, as there are fewer joints than quantities
            ["joint", *(f"value {k}" for k in range(5))],
            [["roll", *"12345"], ["yaw", *"67890"]], 1,
            ["joint    roll  yaw", "value 0     1    6", "value 1     2    7"],
        ),
        (["part", "a", "b"], [["p", "0.1 (0.2)", "0.3 (0.4)"], *([x, "0", "0"] for x in "qr")], 1,
         ["part      a      b", "p       0.1    0.3", "      (0.2)  (0.4)"]),
        (["controller", "joint", "error"], [["p_pi", "roll", "1"], ["", "yaw", "2"]], 2,
         ["controller,", "joint        error", "p_pi", "  roll           1", "  yaw            2"]),
    ],
)  # fmt: skip
def test_wide_table_is_turned_or_broken_before_it_is_cut(header, rows, keys, expected):
    lines = aligned(header, rows, keys, 20)
    assert lines[: len(expected)] == expected and "" not in lines


def test_numbers_of_rounding_errors_are_zero():
    assert [formatted(x, ".2g") for x in (4.9e-24, -4.9e-24, 2e-12)] == ["0", "0", "2e-12"]


def test_results_become_pandas_tables(short, run):
    pytest.importorskip("pandas")
    table = run.to_pandas()
    assert table.index.name == "time" and np.array_equal(table.index, run.time)
    assert np.array_equal(table["tau_cmd_2"], run.tau_cmd[:, 1])
    assert np.array_equal(
        short.reference.tracked.to_pandas()["vd_ref_4"], short.reference.tracked.vd[:, 3]
    )
    compared = Comparison([Compared("pi_ctc", short, run)]).to_pandas()
    error = np.abs(run.speed_error[:, 1]).max()
    assert compared.loc[("pi_ctc", "roll"), "max_abs_speed_error"] == pytest.approx(error)


# --- functions ------------------------------------------------------------------------------------


def test_functions_give_numbers_of_commands(short, run, tmp_path):
    response = sdt.bode(short, time=0.25)
    expected = frequency_response(short, sample=50).loop_gain
    np.testing.assert_array_equal(response.loop_gain, expected)
    np.testing.assert_array_equal(short.tuning.numbers["i_eff_max"], short.inertia.maximum)
    run.save(tmp_path / "run.csv")
    replayed = sdt.replay(tmp_path / "run.csv", short.scenario)
    assert replayed.explained("speed_error").min() > 0.999999
    result = sdt.learn(short, flights=1)
    np.testing.assert_array_equal(result.best.largest, np.abs(run.position_error).max(axis=0))
    for result, words in ((response, "phase margin [deg]"), (replayed, "speed error [%]")):
        assert isinstance(result.plot(*[short] * (result is response)), Figure)
        assert words in str(result)


def test_axis_loop_poles_equal_the_papers_transfer_function(designed):
    """v / v_ref = K_IS / (I s² + K_PS s + K_IS), Section 3.3 with P in the feedback path; the load
    torque acts on the motor: v = s / (I s² + ...) tau / r."""
    pytest.importorskip("control")
    design = designed("axis_pi", end=0.5)
    model = design.linear()
    system, s = model.to_control(), 10j
    for k in range(4):
        kp, ki, inertia = design.tuning.gains.kp[k], design.tuning.gains.ki[k], design.i_eff[k]
        below = np.poly1d([inertia, kp, ki])
        for pole in below.roots:
            assert np.abs(system.poles() - pole).min() < 1e-9 * abs(pole)
        row = model.outputs.index(f"v_{k + 1}")
        gain, load = (
            system(s)[row, model.inputs.index(f"{x}_{k + 1}")] for x in ("v_ref", "tau_ff")
        )
        assert gain == pytest.approx(ki / below(s), rel=1e-9)
        assert load == pytest.approx(s / below(s) / design.device.simulated.gear_ratio[k], rel=1e-9)
    assert list(system.state_labels) == list(model.states)
    np.testing.assert_allclose(model.A[:4, 4:8], np.eye(4), atol=1e-12)  # q' = v


# --- wrong arguments ------------------------------------------------------------------------------

FREE = {"trust", "compare", "meshcat", "at_rest"}
"""Arguments that are true or false, or are not checked beforehand."""


class Odd:
    """Something that no function takes."""


def test_every_argument_refuses_an_odd_object(short, run, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    zeros, scenario = np.zeros((21, 3)), short.scenario
    calls = {
        "load": ["axis_pi"], "save": [scenario, "x.yaml"], "load_robot": ["sdt"],
        "plan": ["leans"], "identify": ["sdt", "r.csv"], "judge": ["sdt", "r.csv"],
        "replay": ["r.csv", scenario], "export": [short, "drives", "out"],
        "fly": ["sdt", "turn"], "track": [run], "compare": [short, ["pi"]],
        "perceive": [STILL.time, zeros, zeros], "design": [scenario],
        "learn_update": ["state", ["r.csv"]], "accept_judge": ["folder", "r.csv"],
        "accept_plan": [scenario], "accept_predict": [scenario],
        "register_controller": ["own", object],
        **{x: [short] for x in ("loop", "simulate", "tune", "bode", "learn", "linear", "view")},
        "step": [short], "stability": [short], "stops": [short],
    }  # fmt: skip
    objects = {x: getattr(sdt, x) for x in sdt.__all__}
    functions = {x for x, y in objects.items() if callable(y) and not isinstance(y, type)}
    assert functions | {"loop"} == set(calls)
    for name, arguments in calls.items():
        signature = inspect.signature(getattr(sdt, name))
        for parameter in set(signature.parameters) - FREE:
            bound = signature.bind(*arguments)
            bound.arguments[parameter] = Odd()
            with pytest.raises(sdt.InputError) as error:
                getattr(sdt, name)(*bound.args, **bound.kwargs)
                pytest.fail(f"{name}({parameter}=...) takes any object")
            assert "\n" not in str(error.value), (name, parameter)
    assert list(tmp_path.iterdir()) == []


FIGURES = {
    f"{module}.{name}": function
    for module in ("plots", "plots_motion", "plots_pilot")
    for name, function in vars(getattr(sdt, module)).items()
    if inspect.isfunction(function) and function.__module__.startswith("sdt_drake.show.figures")
}


@pytest.mark.parametrize("name", [name for name in FIGURES if "._" not in name])
def test_figure_of_wrong_type_names_its_argument(name):
    names = list(inspect.signature(FIGURES[name]).parameters)
    has_title = names[0] == "title"
    for value in ([Odd()], {"a": Odd()}, Odd(), "x", 3):
        arguments = dict.fromkeys(names, value) | ({"title": "a title"} if has_title else {})
        with pytest.raises(sdt.InputError, match=rf"^{names[has_title]}: a \w+, exp") as error:
            FIGURES[name](**arguments)
        assert "\n" not in str(error.value)


NAN, V, Q0 = float("nan"), np.zeros((21, 4)), np.zeros(4)
WRONG = {
    "period: nan": lambda design: Motion.from_speeds(NAN, Q0, V),
    r"q, v, vd: .*\(21, 4\), \(5, 4\)": lambda design: Motion(0.005, V, V[:5], V),
    r"v\[0, 0\]: nan": lambda design: Motion.from_speeds(0.005, Q0, V + NAN),
    "q0: .*3 joint": lambda design: Motion.from_speeds(0.005, Q0[:3], V),
    r"q: 2 row\(s\)": lambda design: Motion.from_positions(0.005, V[:2]),
    "torque_margin: 1.5": lambda design: sdt.plan("leans", torque_margin=1.5),
    r"prescribed_motion\[0\]\[0, 0\]: nan": lambda design: sdt.loop(
        design.assuming(prescribed_motion=(V + NAN, V))
    ),
    "controllers: 'pi'": lambda design: sdt.compare(design, "pi"),
    r"controllers: \[None\]": lambda design: sdt.compare(design, [None]),
    "controller: the class Adder": lambda design: sdt.loop(design, controller=Adder),
    "sample: True": lambda design: sdt.linear(design, True),
    "time: 0.6 s, the motion ends at 0.5 s": lambda design: sdt.bode(design, time=0.6),
    "recordings: none": lambda design: sdt.identify("sdt", []),
    "held_out: 1,": lambda design: sdt.identify("sdt", "r", held_out=1),
    "of: 'x'": lambda design: sdt.learn(design, of="x"),
    r"changes: \['a=b'\]": lambda design: sdt.load("coupled_pi", ["a=b"]),
    r"changes: \{1: 2\}": lambda design: sdt.load("coupled_pi", {1: 2}),
    r"joint_names: 1 name": lambda design: design.reference.tracked.plot(["a"]),
}
"""Wrong uses by the beginning of what they are told."""


@pytest.mark.parametrize("message", WRONG)
def test_wrong_values_name_their_argument(short, message):
    with pytest.raises(sdt.InputError, match=f"^{message}") as error:
        WRONG[message](short)
    assert "\n" not in str(error.value)


def test_inputs_that_abort_drake_are_refused(design, designed):
    motion = copy.deepcopy(STILL)
    motion.v[3, 1] = np.nan
    with pytest.raises(sdt.InputError, match=r"v of joint 2 is not finite at 0\.015 s"):
        sdt.design(design.scenario, robot=design.device.simulated, motion=motion)
    three = Motion.from_speeds(0.005, Q0[:3], V[:, :3])
    with pytest.raises(sdt.InputError, match=r"motion: .*3 joint\(s\), .*'sdt' has 4"):
        sdt.design(design.scenario, robot=design.device.simulated, motion=three)
    with pytest.raises(sdt.InputError, match="'axis_loop', expected the loop of the design"):
        simulate(design, sdt.loop(designed("axis_pi")))


def test_stuck_integrator_says_when(designed):
    """On a torque that changes faster, and by more, than the smallest step can follow."""
    loop, builder = sdt.loop(designed("coupled_pi", motion=STILL)), DiagramBuilder()
    builder.AddSystem(loop.diagram)
    load = builder.AddSystem(Sine(amplitude=1e15, frequency=1e10, phase=0.0, size=4))
    builder.Connect(load.get_output_port(0), loop.GetInputPort("extra_load_torque"))
    with pytest.raises(sdt.InputError, match=r"stuck at \d.* s \("):
        sdt.simulate(loop, builder.Build())
