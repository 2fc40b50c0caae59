"""Scenarios: YAML in and out, paths, designs, and what is refused."""

from __future__ import annotations

import ast
import copy
import dataclasses
import re
import typing
from pathlib import Path

import numpy as np
import pytest

import sdt_drake
from sdt_drake.controllers import CONTROLLERS
from sdt_drake.design import load_plan, make_design
from sdt_drake.deviation import Deviation
from sdt_drake.device import DeviceChoice, Drive, Elasticity, Friction
from sdt_drake.errors import InputError
from sdt_drake.motion import Motion, load_profile
from sdt_drake.resources import find_file, models_dir
from sdt_drake.scenario import (
    ControllerChoice,
    Disturbance,
    PlantChoice,
    Scenario,
    load_scenario,
    save_scenario,
)
from sdt_drake.yaml_files import load_yaml

SHIPPED = sorted(path.stem for path in (models_dir() / "scenarios").glob("*.yaml"))
# Table 1.
I_EFF = [4.26, 98.01, 796.3, 250.28]
KP = [267.1, 6.34e3, 5.2e4, 1.57e4]
KI = [4.64e3, 1.07e5, 8.67e5, 2.73e5]
ZETA = [0.95, 0.98, 0.99, 0.95]
STILL = "duration: 1\njoints:\n" + 4 * "  - !Knots {knots: [[0, 0], [1, 0]]}\n"


def shipped(name: str) -> Scenario:
    return load_scenario(f"package://sdt/scenarios/{name}.yaml")


@pytest.fixture
def load(tmp_path):
    """Write the text of a scenario and load it."""

    def load_text(text: str) -> Scenario:
        path = tmp_path / "run.yaml"
        path.write_text(text, encoding="utf-8")
        return load_scenario(path)

    return load_text


# --- the shipped scenarios -------------------------------------------------------------------


PUBLISHED = ["axis_pi", "axis_pi_ctc", "coupled_pi", "coupled_pi_ctc"]


def test_the_papers_scenarios_and_a_real_device_are_shipped():
    assert {*PUBLISHED, "real_device"} <= set(SHIPPED)


def test_the_papers_scenarios_are_ideal():
    for scenario in map(shipped, PUBLISHED):
        assert scenario.plant.friction is scenario.plant.elasticity is None
        assert scenario.drive == Drive()
        assert scenario.controller.model.exact


@pytest.mark.parametrize("name", [n for n in SHIPPED if n not in (*PUBLISHED, "training")])
def test_the_others_are_the_coupled_one_with_a_real_plant_drive_or_model(name):
    ideal, real = values(shipped("coupled_pi")), values(shipped(name))
    apart = {field for field in real if field not in ideal or real[field] != ideal[field]}
    parts = ("plant.friction", "plant.elasticity", "plant.deviation", "drive", "controller.model.")
    assert apart > {"name"}
    assert all(field.startswith(parts) for field in apart - {"name"}), apart


@pytest.mark.parametrize("name", SHIPPED)
def test_a_shipped_scenario_survives_a_round_trip_and_can_be_made(name, tmp_path, make_variant):
    scenario = shipped(name)
    scenario.validate()
    scenario.validate_sizes(4)
    assert scenario.name == name
    assert scenario.period == 0.005
    save_scenario(scenario, tmp_path / "new" / "copy.yaml")
    assert load_scenario(tmp_path / "new" / "copy.yaml") == scenario
    assert make_variant(name).scenario == scenario


@pytest.mark.parametrize("name", ["axis_pi", "axis_pi_ctc"])
def test_axis_scenarios_have_the_published_numbers(name, make_variant):
    scenario = shipped(name)
    assert scenario.plant == PlantChoice("axis", I_EFF)
    assert scenario.controller == ControllerChoice(
        kind=name.removeprefix("axis_"), structure="p_in_feedback", kp=KP, ki=KI
    )
    assert scenario.algorithm == "printed"
    design = make_variant(name)
    np.testing.assert_array_equal(design.i_eff, I_EFF)
    np.testing.assert_array_equal(design.gains.kp, KP)
    np.testing.assert_array_equal(design.gains.ki, KI)


@pytest.mark.parametrize("name", ["coupled_pi", "coupled_pi_ctc"])
def test_coupled_scenarios_are_tuned_to_table_1(name, make_variant):
    scenario = shipped(name)
    assert scenario.plant == PlantChoice("coupled", None)
    assert scenario.controller == ControllerChoice(
        kind=name.removeprefix("coupled_"), structure="p_in_feedback", omega_r=65.991, zeta=ZETA
    )
    assert scenario.controller.omega_r == pytest.approx(2 * np.pi * 10.5028, rel=1e-5)
    assert scenario.algorithm == "consistent"
    gains = make_variant(name).gains
    # The paper prints 2.73e5 for joint 4; its own formula gives 2.7248e5.
    np.testing.assert_allclose(gains.ki, [4.64e3, 1.067e5, 8.67e5, 2.7248e5], rtol=1e-3)
    np.testing.assert_allclose(gains.kp, KP, rtol=5e-3)


def test_published_disturbance_belongs_to_the_axis_loop_with_ctc():
    amplitudes = {name: shipped(name).disturbance.amplitude for name in SHIPPED}
    assert amplitudes == {name: 0.05 * (name == "axis_pi_ctc") for name in SHIPPED}
    assert shipped("axis_pi_ctc").disturbance.omega_d == pytest.approx(2 * np.pi)


# --- a design takes what the scenario says ---------------------------------------------------


def test_inertia_of_the_axes_is_the_largest_one_if_not_given(make_variant):
    def without_i_eff(scenario):
        scenario.plant.i_eff = None

    design = make_variant("axis_pi", without_i_eff)
    np.testing.assert_allclose(design.i_eff, [4.2601, 98.0127, 796.298, 250.280], rtol=1e-5)


def test_zeta_is_1_if_not_given(make_variant):
    def without_zeta(scenario):
        scenario.controller.zeta = None

    design = make_variant("coupled_pi", without_zeta)
    # zeta = 1: K_PS = 2 I_eff omega_n with omega_n = omega_r / 2
    np.testing.assert_allclose(design.gains.kp, 65.991 * design.inertia.maximum, rtol=1e-12)


def test_algorithm_chooses_the_sign_of_the_loads(make_variant):
    def printed(scenario):
        scenario.algorithm = "printed"

    consistent, printed = (
        make_variant("coupled_pi").loads,
        make_variant("coupled_pi", printed).loads,
    )
    np.testing.assert_array_equal(printed.alleviating_torque, consistent.alleviating_torque)
    np.testing.assert_array_equal(np.abs(printed.load_torque), np.abs(consistent.load_torque))
    assert np.any(printed.load_torque != consistent.load_torque)


def test_torque_margin_and_period_reach_the_planner():
    scenario = shipped("coupled_pi")
    scenario.torque_margin, scenario.period = 0.9, 0.01
    motion = make_design(scenario).motion
    assert motion.period == 0.01
    command = load_profile("package://sdt/motions/reference.yaml").speeds(motion.time)
    np.testing.assert_array_equal(np.any(np.abs(motion.v - command) > 1e-3, axis=0), [0, 1, 0, 0])


# --- every field -----------------------------------------------------------------------------


def schemas(schema=Scenario) -> list[type]:
    """A dataclass and all that it holds, optional ones too."""
    found = [schema]
    for hint in typing.get_type_hints(schema).values():
        for part in (hint, *typing.get_args(hint)):
            if dataclasses.is_dataclass(part):
                found += schemas(part)
    return found


class _Reads(ast.NodeVisitor):
    """Names of attributes that code reads, checks aside."""

    def __init__(self) -> None:
        self.names: set[str] = set()

    def visit_FunctionDef(self, node: ast.FunctionDef) -> None:
        if not node.name.lstrip("_").startswith("validate"):
            self.generic_visit(node)

    def visit_Attribute(self, node: ast.Attribute) -> None:
        if isinstance(node.ctx, ast.Load):
            self.names.add(node.attr)
        self.generic_visit(node)


def test_a_scenario_is_made_of_these():
    assert set(schemas()) == {
        Scenario,
        DeviceChoice,
        PlantChoice,
        Friction,
        Elasticity,
        Drive,
        ControllerChoice,
        Deviation,
        Disturbance,
    }


@pytest.mark.parametrize("schema", schemas())
def test_every_field_of_a_scenario_is_read_somewhere(schema):
    reads = _Reads()
    for path in Path(sdt_drake.__file__).parent.rglob("*.py"):
        reads.visit(ast.parse(path.read_text(encoding="utf-8")))
    unread = {field.name for field in dataclasses.fields(schema)} - reads.names
    assert not unread, f"{schema.__name__}: nothing reads {unread}"


def on_axes() -> Scenario:
    """No field has its default but omega_r, omega_ratio and zeta."""
    return Scenario(
        name="axes",
        robot="package://sdt/other.sdf",
        device=DeviceChoice(
            ["", "TM-2860", "", ""],
            [60.0, 1.0, 1.0, 1.0],
            0.9,
            "gondola",
            2.0,
            ["AC-203"] * 4,
            "package://sdt/other.yaml",
        ),
        motion="package://sdt/motions/other.csv",
        period=0.01,
        torque_margin=0.9,
        planner="retiming",
        algorithm="printed",
        inverse_dynamics="online",
        accuracy=1e-5,
        plant=PlantChoice(
            "axis",
            I_EFF,
            Friction(I_EFF, KP, KI, 0.1, 2e-5),
            Elasticity([0.0, 9, 9, 9], 0, "link"),
            Deviation("arm", 3.0, [0.1, 0.0, 0.0], 0.95, [1.1, 1.0]),
        ),
        drive=Drive(0.0005, 200.0, [0.0, 0.1, -0.1, 0], [1e6] * 4, I_EFF, KP, 0.015),
        controller=ControllerChoice(
            kind="p_pi",
            file=str(Path(__file__).with_name("own_controllers.py")),
            structure="pi",
            kp=KP,
            ki=KI,
            anti_windup=True,
            feedforward="id",
            feedforward_gain=[1.1, 1.0, 0.9, -0.5],
            friction_compensation=True,
            position_gain=[1.0, 2.0, 3.0, 4.0],
            model=Deviation("gondola", -40.5, [0.0, 1e-3, -0.1], 1.05, [0.9]),
        ),
        disturbance=Disturbance(0.05, 3.0),
    )


def coupled() -> Scenario:
    """The same on the coupled plant, with omega_r, omega_ratio and zeta instead of gains."""
    scenario = on_axes()
    scenario.plant.kind, scenario.plant.i_eff = "coupled", None
    controller = scenario.controller
    controller.kp = controller.ki = None
    controller.omega_r, controller.zeta = 65.991, ZETA
    controller.omega_ratio = 0.4
    return scenario


def values(scenario) -> dict[str, object]:
    """Values by dotted name, without those that stand for others."""
    found = {}
    for field in dataclasses.fields(scenario):
        value = getattr(scenario, field.name)
        if dataclasses.is_dataclass(value):
            found |= {f"{field.name}.{name}": v for name, v in values(value).items()}
        else:
            found[field.name] = value
    return found


def test_these_scenarios_use_every_field():
    default = values(
        Scenario(
            device=DeviceChoice(),
            plant=PlantChoice(friction=Friction(), elasticity=Elasticity()),
            drive=Drive(),
        )
    )
    first, second = values(on_axes()), values(coupled())
    assert set(first) == set(second) == set(default)
    # The kind of plant cannot be new: both are there.
    unused = {name for name in default if first[name] == second[name] == default[name]}
    assert not unused


@pytest.mark.parametrize("make", [on_axes, coupled])
def test_every_field_survives_a_round_trip(make, tmp_path):
    scenario = make()
    scenario.validate()
    scenario.validate_sizes(4)
    save_scenario(scenario, tmp_path / "run.yaml")
    assert load_scenario(tmp_path / "run.yaml") == scenario
    again = tmp_path / "again.yaml"
    save_scenario(load_scenario(tmp_path / "run.yaml"), again)
    assert again.read_bytes() == (tmp_path / "run.yaml").read_bytes()


def test_empty_parts_are_ideal_ones_and_null_is_none(load):
    scenario = load(
        "controller: {omega_r: 60, model: {}}\ndrive: {}\nplant: {friction: {}, elasticity: null}\n"
    )
    assert scenario.drive == Drive()
    assert scenario.plant == PlantChoice(friction=Friction())
    assert scenario.controller.model.exact


# --- what a controller is in use -------------------------------------------------------------


@pytest.mark.parametrize(
    "kind, feedforward, in_use, structure, label",
    [
        ("pi", None, "none", "p_in_feedback", "pi"),
        ("pi_ctc", None, "ctc", "p_in_feedback", "pi_ctc"),
        ("pi_id", None, "id", "pi", "pi_id"),
        ("p_pi", None, "none", "pi", "p_pi"),
        ("p_pi", "none", "none", "pi", "p_pi"),
        ("p_pi", "id", "id", "pi", "p_pi+id"),
        ("pi_scheduled", "ctc", "ctc", "p_in_feedback", "pi_scheduled+ctc"),
        ("inverse_dynamics", None, "none", "p_in_feedback", "inverse_dynamics"),
    ],
)
def test_feedforward_structure_and_label(kind, feedforward, in_use, structure, label):
    choice = ControllerChoice(kind=kind, feedforward=feedforward)
    assert choice.feedforward_in_use == in_use
    assert choice.structure_in_use == structure
    assert choice.label == label


# --- paths -----------------------------------------------------------------------------------

PROJECT = """robot: robots/own.sdf
motion: ../still.yaml
controller:
  omega_r: 60
"""


@pytest.fixture
def project(tmp_path):
    """A folder with a scenario of relative paths, its robot and its motion."""
    folder = tmp_path / "project" / "runs"
    (folder / "robots").mkdir(parents=True)
    (folder / "robots" / "own.sdf").write_bytes(find_file("package://sdt/sdt.sdf").read_bytes())
    (folder.parent / "still.yaml").write_text(STILL)
    (folder / "first_run.yaml").write_text(PROJECT)
    return folder


@pytest.mark.parametrize("start, path", [("elsewhere", "../project/runs"), ("project", "runs")])
def test_relative_paths_start_from_the_folder_of_the_scenario(
    project, tmp_path, monkeypatch, start, path
):
    (tmp_path / start).mkdir(exist_ok=True)
    monkeypatch.chdir(tmp_path / start)
    for reference in (f"{path}/first_run.yaml", project / "first_run.yaml"):
        scenario = load_scenario(reference)
        assert scenario.name == "first_run"
        design = make_design(scenario)
        assert design.robot.path.samefile(project / "robots" / "own.sdf")
        assert design.motion.duration == 1


def test_absolute_paths_stay_as_they_are(project, load):
    robot = project / "robots" / "own.sdf"
    assert load(PROJECT.replace("robots/own.sdf", str(robot))).robot == str(robot)


@pytest.mark.parametrize("absolute", [True, False])
def test_relative_paths_survive_saving_in_another_folder(project, tmp_path, monkeypatch, absolute):
    monkeypatch.chdir(tmp_path)
    folder = project if absolute else project.relative_to(tmp_path)
    save_scenario(load_scenario(folder / "first_run.yaml"), tmp_path / "results" / "copy.yaml")
    copy = load_scenario(tmp_path / "results" / "copy.yaml")
    assert Path(copy.robot).is_file()
    assert Path(copy.motion).is_file()


# --- what is refused -------------------------------------------------------------------------

AXIS = find_file("package://sdt/scenarios/axis_pi.yaml").read_text(encoding="utf-8")
COUPLED = find_file("package://sdt/scenarios/coupled_pi.yaml").read_text(encoding="utf-8")

BAD = [
    # Fields.
    (AXIS, "package://sdt/motions/reference.yaml", "''", "motion: empty, expected a file"),
    (AXIS, "package://sdt/sdt.sdf", "''", "robot: empty, expected a file"),
    (AXIS, "period:", "perod:", "perod: unknown field, did you mean period"),
    (AXIS, "  kind: axis", "  kid: axis", r"plant\.kid: unknown field, did you mean kind"),
    (
        AXIS,
        "  kp:",
        "  kq:",
        r"controller\.kq: unknown field, expected one of kind, file, s",
    ),
    (
        AXIS,
        "  i_eff",
        "  frict: {}\n  i_eff",
        r"plant\.frict: unknown field, did you mean friction",
    ),
    (
        AXIS,
        "  i_eff",
        "  friction: {coulom: [1]}\n  i_eff",
        r"plant\.friction\.coulom: unknown field, did you mean coulomb",
    ),
    (AXIS, "  kp:", "  model: {mass: 1}\n  kp:", r"controller\.model\.mass: unknown field"),
    (
        AXIS,
        "name: axis_pi",
        "drive: {periods: 1}",
        r"drive\.periods: unknown field, did you mean p",
    ),
    (AXIS, "  struc", "  struk", r"controller\.strukture: unknown field, did you mean structure"),
    (AXIS, "plant:\n", "plant: !Axis\n", "plant: .*Axis"),
    # Types.
    (AXIS, "0.005", "fast", "period: 'fast', expected a number"),
    (AXIS, "0.005", "true", "period: True, expected a number"),
    (AXIS, "0.005", "[0.005]", r"period: \[0\.005\], expected a number"),
    (AXIS, "0.005", "", "period: None, expected a number"),
    (AXIS, "0.005", "1" + 400 * "0", "period: "),
    (AXIS, "name: axis_pi", "name: 7", "name: 7, expected a text"),
    (AXIS, "name: axis_pi", "name: [a]", r"name: \['a'\], expected a text"),
    (AXIS, "name: axis_pi", "disturbance: 0.05", r"disturbance: 0\.05, expected a mapping with am"),
    (AXIS, "[4.26, 98.01, 796.3, 250.28]", "4.26", r"plant\.i_eff: 4\.26, expected a list"),
    (AXIS, "4.26,", "big,", r"plant\.i_eff\[1\]: 'big', expected a number"),
    (AXIS, "98.01,", "true,", r"plant\.i_eff\[2\]: True, expected a number"),
    (AXIS, "name: axis_pi", "drive: ideal", "drive: 'ideal', expected a mapping with period, tor"),
    (AXIS, "name: axis_pi", "drive: {n1: 3}", r"drive\.n1: 3, expected a list"),
    (AXIS, "name: axis_pi", "drive: {n1: [a]}", r"drive\.n1\[1\]: 'a', expected a number"),
    (AXIS, "  kp:", "  anti_windup: 1\n  kp:", r"controller\.anti_windup: 1, expected true or f"),
    (AXIS, "  kp:", "  feedforward: 1\n  kp:", r"controller\.feedforward: 1, expected a text"),
    (
        AXIS,
        "  i_eff",
        "  elasticity: {natural_frequency: 9}\n  i_eff",
        r"plant\.elasticity\.natural_frequency: 9, expected a list",
    ),
    # Values.
    (AXIS, "0.005", "0", "period: 0.0, expected a finite number > 0"),
    (AXIS, "0.005", "-0.005", "period: -0.005, "),
    (AXIS, "0.005", ".nan", "period: nan, "),
    (AXIS, "0.005", ".inf", "period: inf, "),
    (AXIS, "0.005", "1e999", "period: inf, "),
    (AXIS, "name: axis_pi", "torque_margin: 0", "torque_margin: 0.0, expected a finite number > 0"),
    (AXIS, "name: axis_pi", "torque_margin: 1.1", r"torque_margin: 1\.1, .* \(0, 1\]"),
    (AXIS, "name: axis_pi", "torque_margin: .nan", "torque_margin: nan, "),
    (AXIS, "algorithm: printed", "algorithm: print", "algorithm: 'print', expected one of consis"),
    (AXIS, "name: axis_pi", "inverse_dynamics: no", "inverse_dynamics: False, expected a text"),
    (AXIS, "name: axis_pi", "inverse_dynamics: off_line", "'off_line', expected one of table, onl"),
    (AXIS, "kind: axis", "kind: axes", r"plant\.kind: 'axes', expected one of axis, coupled"),
    (
        AXIS,
        "kind: pi",
        "kind: pid",
        r"controller\.kind: 'pid', expected one of pi, pi_ctc, pi_id, p_pi, pi_scheduled, "
        r"inverse_dynamics$",
    ),
    (AXIS, "p_in_feedback", "p", r"controller\.structure: 'p', expected one of pi, p_in_feedback"),
    (AXIS, "kind: axis", "kind: coupled", r"plant\.i_eff: the coupled plant has its inertia"),
    (
        AXIS,
        "name: axis_pi",
        "disturbance: {amplitude: -0.1}",
        r"disturbance\.amplitude: -0\.1, expected a finite number >= 0",
    ),
    (
        AXIS,
        "name: axis_pi",
        "disturbance: {omega_d: .nan}",
        r"disturbance\.omega_d: nan, expected a finite number >= 0",
    ),
    (
        AXIS,
        "  i_eff",
        "  friction: {presliding: 0}\n  i_eff",
        r"plant\.friction\.presliding: 0\.0, expected a finite number > 0",
    ),
    (
        AXIS,
        "  i_eff",
        "  elasticity: {encoder: load}\n  i_eff",
        r"plant\.elasticity\.encoder: 'load', expected one of motor, link",
    ),
    (
        AXIS,
        "name: axis_pi",
        "drive: {period: 0.002}",
        r"drive\.period: 0\.002 s does not divide the interpolation period, 0\.005 s",
    ),
    (AXIS, "name: axis_pi", "drive: {n1: [1]}", "drive: n1 and n0 must be given together"),
    (
        AXIS,
        "  kp:",
        "  model: {inertia_scale: 0}\n  kp:",
        r"controller\.model\.inertia_scale: 0\.0, expected a finite number > 0",
    ),
    (
        AXIS,
        "  kp:",
        "  model: {payload_offset: [1]}\n  kp:",
        r"controller\.model\.payload_offset: 1 value\(s\), expected 3: x, y, z",
    ),
    # Options that the kind would not use.
    (
        AXIS,
        "kind: pi",
        "kind: inverse_dynamics",
        r"controller\.kind inverse_dynamics: needs plant\.kind coupled$",
    ),
    (
        AXIS,
        "  kp:",
        "  feedforward: id\n  kp:",
        r"controller\.feedforward: pi takes none, only p_pi, pi_scheduled$",
    ),
    (AXIS, "  kp:", "  position_gain: [1]\n  kp:", r"controller\.position_gain: pi takes none"),
    # Gains.
    (AXIS, "  ki:", "  # ki:", "controller: kp and ki must be given together"),
    (AXIS, "  kp:", "  # kp:", "controller: kp and ki must be given together"),
    (AXIS, "  kp:", "  omega_r: 60\n  kp:", "controller: give either kp and ki, or omega_r"),
    (AXIS, "  kp:", "  zeta: [1, 1, 1, 1]\n  kp:", "controller: give either kp and ki, or omega_r"),
    (COUPLED, "  omega_r:", "  # omega_r:", r"controller\.omega_r: missing"),
    (COUPLED, "65.991", "0", r"controller\.omega_r: 0\.0, expected a finite number > 0"),
    (COUPLED, "65.991", "-66", r"controller\.omega_r: -66\.0, "),
    (COUPLED, "65.991", ".nan", r"controller\.omega_r: nan, "),
]


@pytest.mark.parametrize("text, old, new, message", BAD, ids=[case[-1] for case in BAD])
def test_a_bad_field_is_refused_with_file_and_name(load, text, old, new, message):
    assert old in text
    with pytest.raises(InputError, match=rf"run\.yaml: .*({message})") as error:
        load(text.replace(old, new, 1))
    assert "\n" not in str(error.value)


LEAVES_IT_OPEN = ("p_pi", "pi_scheduled")
UNUSED = [
    *(
        (
            kind,
            {"feedforward": feedforward},
            f"controller.feedforward: {kind} takes none, only p_pi, pi_scheduled",
        )
        for kind in CONTROLLERS
        if kind not in LEAVES_IT_OPEN
        for feedforward in ("none", "id")
    ),
    *(
        (
            kind,
            {"feedforward": "full"},
            "controller.feedforward: 'full', expected one of none, ctc, id",
        )
        for kind in LEAVES_IT_OPEN
    ),
    *(
        (
            kind,
            {"position_gain": [1.0] * 4},
            f"controller.position_gain: {kind} takes none, only p_pi",
        )
        for kind in CONTROLLERS
        if kind != "p_pi"
    ),
    *(
        (
            kind,
            {"feedforward_gain": [1.0] * 4},
            f"controller.feedforward_gain: {kind} has no feedforward",
        )
        for kind in ("pi", "p_pi", "pi_scheduled", "inverse_dynamics")
    ),
    (
        "p_pi",
        {"feedforward": "none", "feedforward_gain": [1.0] * 4},
        "controller.feedforward_gain: p_pi has no feedforward",
    ),
    (
        "inverse_dynamics",
        {"anti_windup": True},
        "controller.anti_windup: inverse_dynamics takes none, only pi, pi_ctc, pi_id, p_pi, "
        "pi_scheduled",
    ),
    *(
        (
            kind,
            {"friction_compensation": True},
            "controller.friction_compensation: needs plant.friction",
        )
        for kind in CONTROLLERS
    ),
    ("pi_id", {"structure": "pd"}, "controller.structure: 'pd', expected one of pi, p_in_feedback"),
]


@pytest.mark.parametrize("kind, options, message", UNUSED, ids=str)
def test_an_option_that_the_kind_would_not_use_is_refused(kind, options, message):
    scenario = Scenario(
        plant=PlantChoice("coupled"),
        controller=ControllerChoice(kind=kind, omega_r=66.0),
    )
    scenario.validate()
    for name, value in options.items():
        setattr(scenario.controller, name, copy.deepcopy(value))
    with pytest.raises(InputError, match=f"^{re.escape(message)}$"):
        scenario.validate()


@pytest.mark.parametrize("kind", CONTROLLERS)
def test_a_kind_is_refused_on_a_plant_that_it_is_not_for(kind):
    scenario = Scenario(controller=ControllerChoice(kind=kind, omega_r=66.0))
    if kind == "inverse_dynamics":
        message = r"^controller\.kind inverse_dynamics: needs plant\.kind coupled$"
        with pytest.raises(InputError, match=message):
            scenario.validate()
    else:
        scenario.validate()


MISFIT = [
    (AXIS, "4.26, ", "", r"plant\.i_eff: 3 value\(s\), expected 4"),
    (AXIS, "4.26, ", "-4.26, ", r"plant\.i_eff: \[-4\.26, .*every value must be > 0"),
    (AXIS, "4.26, ", "0, ", r"plant\.i_eff: .*every value must be > 0"),
    (AXIS, "4.26, ", ".nan, ", r"plant\.i_eff: .*not finite"),
    (AXIS, "267.1, ", "", r"controller\.kp: 3 value\(s\), expected 4"),
    (AXIS, "2.73e5]", "-2.73e5]", r"controller\.ki: .*every value must be > 0"),
    (COUPLED, "0.95]", "0.95, 1]", r"controller\.zeta: 5 value\(s\), expected 4"),
    (COUPLED, "[0.95", "[.inf", r"controller\.zeta: .*not finite"),
    (
        AXIS,
        "  i_eff",
        "  friction: {coulomb: [1, 2, 3]}\n  i_eff",
        r"scenario 'axis_pi': plant\.friction\.coulomb: 3 value\(s\), expected 4",
    ),
    (
        AXIS,
        "  i_eff",
        "  elasticity: {}\n  i_eff",
        r"scenario 'axis_pi': plant\.elasticity\.natural_frequency: 0 value\(s\), expected 4",
    ),
    (
        AXIS,
        "name: axis_pi",
        "drive: {torque_error: [-1, 0, 0, 0]}",
        r"scenario 'run': drive\.torque_error: \[-1\.0, .*expected shares between -1 and 1",
    ),
    (
        COUPLED,
        "kind: pi",
        "kind: p_pi\n  position_gain: [1, 1, 1, 0]",
        r"controller\.position_gain: .*every value must be > 0",
    ),
    (
        COUPLED,
        "kind: pi",
        "kind: pi_id\n  feedforward_gain: [1]",
        r"controller\.feedforward_gain: 1 value\(s\), expected 4",
    ),
    (
        COUPLED,
        "kind: pi",
        "kind: pi\n  model: {payload_mass: -180}",
        r"scenario 'coupled_pi': controller\.model\.payload_mass: -180 kg would leave 0 kg",
    ),
    (
        COUPLED,
        "kind: pi",
        "kind: pi\n  model: {payload: cabin, payload_mass: 1}",
        r"scenario 'coupled_pi': controller\.model\.payload: no link 'cabin'",
    ),
    (AXIS, "0.005", "0.007", r"30 s is not a whole multiple of the period 0\.007 s"),
    (AXIS, "0.005", "1e-310", "period"),
    (AXIS, "0.005", "1e-14", "period"),
    (AXIS, "package://sdt/sdt.sdf", "none.sdf", r"none\.sdf: no such file"),
    (AXIS, "package://sdt/motions/reference", "none", r"none\.yaml: no such file"),
    (AXIS, "package://sdt/motions/reference.yaml", ".", "is a folder, expected a file"),
    (AXIS, "package://sdt/motions/reference", "package://sdt/motions/x", r"shipped: .*referen"),
    (AXIS, "package://sdt/sdt.sdf", "package://other/a.sdf", "package://other/a.sdf: no such"),
]


@pytest.mark.parametrize("text, old, new, message", MISFIT, ids=[case[-1] for case in MISFIT])
def test_a_field_that_does_not_fit_the_robot_or_motion_is_refused(load, text, old, new, message):
    assert old in text
    scenario = load(text.replace(old, new, 1))
    with pytest.raises(InputError, match=message):
        make_design(scenario)


# --- YAML files in general -------------------------------------------------------------------

UNREADABLE = [
    (b"", "empty, expected a mapping with name, description, duration, q0, joints"),
    (b"# nothing\n", "empty, expected a mapping"),
    (b"- 1\n- 2\n", r"\[1, 2\], expected a mapping"),
    (b"text", "'text', expected a mapping"),
    (b"joints: [1", "not valid YAML"),
    (b"name: a\n---\nname: b\n", "not valid YAML"),
    (b"\tname: a\n", "not valid YAML"),
    (b"name: \xff\n", "cannot be read"),
    (b"joints: 3\n", "joints: 3, expected a list"),
    (b"joints: [3]\n", r"joints\[1\]: 3, expected a mapping"),
    (b"joints:\n- !Spline {knots: []}\n", r"joints\[1\]: unknown kind !Spline, expected !Knots, "),
    (b"joints:\n- !Knots {knot: []}\n", r"joints\[1\]\.knot: unknown field, did you mean knots"),
    (b"joints:\n- !Sampled {period: x}\n", r"joints\[1\]\.period: 'x', expected a number"),
    (b"joints:\n- !Knots {knots: [1]}\n", r"joints\[1\]\.knots\[1\]: 1, expected a list"),
    (
        b"joints:\n- !Knots {knots: [[0, a]]}\n",
        r"joints\[1\]\.knots\[1\]\[2\]: 'a', expected a num",
    ),
    (b"q0: [0, null]\n", r"q0\[2\]: None, expected a number"),
    (b"7: 8\n", "7: no text to YAML"),
]


@pytest.mark.parametrize("content, message", UNREADABLE, ids=[case[-1] for case in UNREADABLE])
def test_a_bad_yaml_file_is_refused_with_file_and_place(tmp_path, content, message):
    path = tmp_path / "bad.yaml"
    path.write_bytes(content)
    with pytest.raises(InputError, match=rf"bad\.yaml(, line 1)?: {message}") as error:
        load_profile(path)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    "text, name",
    [
        ("period: 0.005\nname: a\nperiod: 0.01\ncontroller: {omega_r: 60}\n", "period"),
        ("controller: {omega_r: 60, kind: pi, omega_r: 66}\n", "omega_r"),
    ],
)
def test_a_key_that_is_given_twice_is_refused(load, text, name):
    with pytest.raises(InputError, match=rf"run\.yaml, line \d: .*{name} is given twice"):
        load(text)


def test_a_missing_yaml_file_is_refused_with_what_there_is(tmp_path):
    with pytest.raises(InputError, match=r"none\.yaml: no such file; files of the package start"):
        load_scenario(tmp_path / "none.yaml")
    with pytest.raises(InputError, match=r"shipped: axis_pi\.yaml, axis_pi_ctc\.yaml, coupled_pi"):
        load_scenario("package://sdt/scenarios/none.yaml")
    with pytest.raises(InputError, match="is a folder, expected a file"):
        load_scenario(tmp_path)


def test_numbers_without_a_point_and_missing_fields_are_taken(tmp_path):
    path = tmp_path / "run.yaml"
    path.write_text("period: 1e-2\ncontroller: {omega_r: 60, zeta: null}\n")
    scenario, file = load_yaml(Scenario, str(path))
    assert file == path
    assert scenario == Scenario(period=0.01, controller=ControllerChoice(omega_r=60.0))
    assert scenario.robot == "package://sdt/sdt.sdf"


# --- motions of a design ---------------------------------------------------------------------


def test_a_scenario_names_a_shipped_motion_and_a_planner(tmp_path):
    path = tmp_path / "run.yaml"
    text = "motion: reference\ncontroller: {omega_r: 60}\nplanner: "
    path.write_text(text + "retiming\ntorque_margin: 0.9\n")
    scenario = load_scenario(path)
    assert scenario.motion == "reference"
    assert make_design(scenario).motion.duration > 30
    path.write_text(text + "fastest\n")
    with pytest.raises(InputError, match=r"run\.yaml: planner: 'fastest', expected one of lim"):
        load_scenario(path)
    path.write_text("motion: referense\ncontroller: {omega_r: 60}\n")
    with pytest.raises(InputError, match=r"run\.yaml: referense: no such motion, .*reference"):
        load_scenario(path)


@pytest.fixture
def write_motion(tmp_path):
    """Write a motion as CSV; gives its path."""

    def write(motion: Motion) -> Path:
        path = tmp_path / "motion.csv"
        motion.to_csv(path)
        return path

    return write


def standing(n: int = 4, period: float = 0.005, speed: float = 0.0) -> Motion:
    v = np.zeros((11, n))
    v[:, 0] = speed * np.arange(11)
    return Motion.from_speeds(period, np.zeros(n), v)


def test_a_planned_motion_is_the_same_from_its_csv(design, robot, write_motion):
    motion = load_plan(write_motion(design.motion), robot, period=0.005).motion
    for name in ("q", "v", "vd", "time"):
        np.testing.assert_array_equal(getattr(motion, name), getattr(design.motion, name))


@pytest.mark.parametrize(
    "motion, message",
    [
        (standing(n=3), "3 joints, robot 'sdt' has 4"),
        # 200 rad/s² of joint 1.
        (standing(speed=1.0), r"joint 1 'planetary' at 0\.000 s: needs torque 3\.65093e\+06 N m"),
    ],
    ids=["joints", "torque"],
)
def test_a_csv_that_the_robot_cannot_do_is_refused(robot, write_motion, motion, message):
    with pytest.raises(InputError, match=rf"motion\.csv: .*{message}"):
        load_plan(write_motion(motion), robot, period=0.005)


def test_the_margin_holds_for_a_csv_too(design, robot, write_motion):
    path = write_motion(design.motion)
    load_plan(path, robot, period=0.005, torque_margin=0.93)
    with pytest.raises(InputError, match=r"motion\.csv: joint 2 'roll' at .* N m"):
        load_plan(path, robot, period=0.005, torque_margin=0.92)


@pytest.mark.parametrize(
    "name, text, message",
    [
        ("still.txt", STILL, r"expected a profile \(\.yaml\) or a motion \(\.csv\)"),
        ("still.yaml", STILL.replace("duration", "length"), "length: unknown field"),
        ("still.yml", STILL.replace("0], [1, 0", "0], [1, 9", 1), "joint 1 'planetary' at 0.000 s"),
        ("still.yaml", STILL.replace("1, 0]", "1, 9]", 4), "motion refused"),
        ("still.yaml", STILL[: STILL.rindex("  -")], "3 joints, robot 'sdt' has 4"),
        ("still.csv", "time,q_1\n0,0\n1,0\n", "neither v_ref_1 nor q_ref_1"),
    ],
)
def test_a_file_that_is_no_motion_of_the_robot_is_refused(robot, tmp_path, name, text, message):
    path = tmp_path / name
    path.write_text(text)
    with pytest.raises(InputError, match=f"{name}: .*{message}") as error:
        load_plan(path, robot, period=0.005)
    assert str(error.value).count(name) == 1


def test_a_missing_motion_is_refused(robot):
    with pytest.raises(InputError, match=r"none\.csv: no such file"):
        load_plan("none.csv", robot, period=0.005)
