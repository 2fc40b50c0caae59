"""The controllers: what they tell of themselves, their starts, and their commands."""

import pickle
from dataclasses import dataclass, fields
from functools import partial

import jsonschema
import numpy as np
import pytest
from helpers.alone import Alone
from helpers.variants import overruled
from pydrake.systems.framework import LeafSystem

from sdt_drake.analysis.comparison import compare, with_controller
from sdt_drake.analysis.linear import linear_feedback, operating_point
from sdt_drake.io.errors import InputError
from sdt_drake.io.fields import Positive, field
from sdt_drake.io.schema import json_schema
from sdt_drake.robot.dynamics import InertiaRange
from sdt_drake.run.controllers import (
    CONTROLLERS,
    SHIPPED,
    ChosenFeedforward,
    Controller,
    PPi,
    make_controller,
    register_controller,
    start_controller,
)
from sdt_drake.run.feedforward import start_feedforward
from sdt_drake.run.loop import make_loop
from sdt_drake.run.options import in_print
from sdt_drake.run.recorded import after_updates
from sdt_drake.run.scenario import Scenario, load_scenario, save_scenario
from sdt_drake.run.simulate import simulate
from sdt_drake.studies.fields import find_field
from sdt_drake.systems import pi_speed_controller
from sdt_drake.systems.gains import SpeedGains
from sdt_drake.systems.wiring import set_state


@dataclass(frozen=True)
class MyOptions(ChosenFeedforward):
    """Options of a PI speed controller on the coupled plant, that takes a feedforward."""

    plants = ("coupled",)
    needs = ("largest inertia of each joint",)
    share: Positive = field(1.0, unit="-")
    """Share of the tuned gains."""


def mine(design):
    share, gains = design.scenario.controller.share, design.tuning.gains
    own = SpeedGains(kp=share * gains.kp, ki=share * gains.ki)
    return pi_speed_controller(gains=own, gear_ratio=design.device.simulated.gear_ratio)


def test_registered_controller_is_known_to_scenarios_and_comparisons(designed):
    base = designed("coupled_pi", end=0.2)
    with pytest.raises(InputError, match=r"controllers: 'mine', expected one of pi, "):
        compare(base, ["mine"])
    register_controller("mine", mine, MyOptions)
    register_controller("mine", mine, MyOptions)  # of a file that is run once more
    plain, fed, of_pi = compare(base, ["mine", "mine+id", "pi"])
    np.testing.assert_array_equal(plain.recording.v, of_pi.recording.v)
    assert plain.needs == of_pi.needs and len(fed.needs) > len(of_pi.needs)
    assert not np.array_equal(fed.recording.v, plain.recording.v)

    for name, controller, message in (
        ("a+b", mine, "expected a name of letters"),
        ("pi", mine, "'pi': ships with the package"),
        ("mine", LeafSystem, "expected a class that derives"),
        ("mine", None, "expected a class or a function"),
    ):
        with pytest.raises(InputError, match=message):
            register_controller(name, controller)

    shipped, heir = (make_loop(made.design) for made in (of_pi, plain))
    assert shipped.feedthrough and heir.feedthrough is None  # its law may be another

    scenario = with_controller(base.scenario, "mine")
    with pytest.raises(InputError, match=r"controller\.anti_windup: mine takes none, only pi, "):
        scenario.changed({"controller.anti_windup": True})
    with pytest.raises(InputError, match=r"controller\.kind: mine needs plant\.kind coupled$"):
        designed("axis_pi", {"controller.kind": "mine"}, end=0.1)


def test_options_made_before_their_controller_was_registered_again_become_its_own():
    register_controller("mine", mine, MyOptions)
    before = load_scenario("coupled_pi", {"controller.kind": "mine", "controller.share": 0.5})

    @dataclass(frozen=True)
    class Again(MyOptions):
        pass

    register_controller("mine", mine, Again)
    after = before.changed({"name": "after"}).controller
    assert type(after) is CONTROLLERS["mine"] is not type(before.controller)
    assert isinstance(after, Again) and after.share == 0.5


def test_inverse_dynamics_controller_has_the_damping_of_the_scenario(designed):
    """A small speed error takes 2 zeta omega_n M / r of torque, to its square."""
    zeta, error = np.array([0.3, 0.5, 0.7, 0.9]), 1e-7
    fields = {"controller.kind": "inverse_dynamics", "controller.zeta": zeta}
    design = designed("coupled_pi", fields, end=0.1)
    model, law = design.device.model, design.scenario.controller.feedback(design)
    context, columns = law.CreateDefaultContext(), []
    for v in [np.zeros(4), *(error * np.eye(4))]:
        law.GetInputPort("reference").FixValue(context, np.zeros(12))
        law.GetInputPort("sampled_state").FixValue(context, [0, 0, 0, 0, *v])
        columns.append(law.GetOutputPort("tau_fb").Eval(context))
    M = model.mass_matrix(model.context_at_zero())
    found = (np.array(columns[1:]) - columns[0]).T / error * model.gear_ratio[:, None]
    expected = -2 * M * zeta * design.tuning.omega_n
    np.testing.assert_allclose(found, expected, atol=1e-5 * np.abs(expected).max())


@pytest.mark.parametrize(
    ("kind", "word", "weight", "line"),
    [
        ("pi", "pi", 1, "pi is deprecated and goes in 0.7, write setpoint_weight: 1"),
        ("pi_ctc", "p_in_feedback", 0, "p_in_feedback is deprecated .* write setpoint_weight: 0"),
        ("p_pi", "p_in_feedback", 1, "remove it: this kind takes no setpoint_weight"),
        ("inverse_dynamics", "pi", None, "remove it"),
    ],
)
def test_old_structure_words_work_and_warn(tmp_path, kind, word, weight, line):
    (tmp_path / "old.yaml").write_text(
        f"plant: {{kind: coupled}}\ncontroller: {{kind: {kind}, structure: {word}, omega_r: 60}}\n"
    )
    with pytest.warns(FutureWarning, match=line) as warned:
        controller = load_scenario(tmp_path / "old.yaml").controller
    assert len(warned) == 1 and getattr(controller, "setpoint_weight", None) == weight
    with pytest.warns(
        DeprecationWarning, match="structure is controller.setpoint_weight now, and goes in 0.7"
    ):
        assert controller.structure == ("pi" if weight != 0 else word)


def test_other_controller_kind_keeps_shared_options():
    base = load_scenario("coupled_pi", {"controller.anti_windup": True})
    cascade = base.changed({"controller.kind": "p_pi", "controller.position_gain": [8.0] * 4})
    assert type(cascade.controller) is PPi and cascade.controller.anti_windup
    assert cascade.controller.zeta == base.controller.zeta
    back = cascade.changed({"controller.kind": "pi", "controller.position_gain": None})
    assert back == base
    with pytest.raises(InputError, match=r"position_gain: pi takes none, only p_pi$"):
        cascade.changed({"controller.kind": "pi"})


@pytest.mark.parametrize(("name", "kind"), [("pi+ctc", "pi_ctc"), ("pi+id", "pi_id")])
def test_kind_by_the_name_of_its_feedforward_is_the_same_everywhere(name, kind):
    loaded = load_scenario("axis_pi", {"controller.kind": name})
    assert loaded == load_scenario("axis_pi", {"controller.kind": kind})
    assert with_controller(load_scenario("axis_pi"), name).controller.label == kind
    assert in_print(name) == in_print(kind) == name.upper().replace("+", " + ")
    schema = json_schema(Scenario, "")
    jsonschema.validate({"controller": {"kind": name, "feedforward_gain": [0.9] * 4}}, schema)
    with pytest.raises(InputError, match="is given twice"):
        compare(load_scenario("axis_pi"), [kind, name])
    assert all(in_print(kind) != kind for kind in SHIPPED)


def test_schema_has_options_of_each_controller():
    validator = pytest.importorskip("jsonschema").Draft7Validator
    schema = json_schema(Scenario, "scenario")
    for kind, options in SHIPPED.items():
        for name in {own.name for other in SHIPPED.values() for own in fields(other)}:
            field = schema["$defs"]["ControllerOptions"]["properties"][name]
            value = field.get("default") if name not in ("kind", "model") else None
            if value is None:
                continue
            data = {"controller": {"kind": kind, name: value}}
            takes = name in {field.name for field in fields(options)}
            assert validator(schema).is_valid(data) == takes, (kind, name)
    assert validator(schema).is_valid({"controller": {"omega_r": 60, "setpoint_weight": 1}})
    assert not validator(schema).is_valid({"controller": {"kind": "mine"}})
    assert validator(schema).is_valid({"controller": {"kind": "mine", "file": "a.py", "share": 1}})


def test_own_controller_options_are_scenario_fields(tmp_path, designed):
    register_controller("mine", mine, MyOptions)
    (tmp_path / "own.yaml").write_text(
        "plant: {kind: coupled}\ncontroller: {kind: mine, omega_r: 60, share: 0.5}\n"
    )
    scenario = load_scenario(tmp_path / "own.yaml")
    save_scenario(scenario, tmp_path / "copy.yaml")
    assert load_scenario(tmp_path / "copy.yaml").controller == scenario.controller
    assert scenario.controller.share == 0.5 and pickle.loads(pickle.dumps(scenario)) == scenario
    unknown, wrong = {"controller.shares": 1}, {"controller.share": -1}
    with pytest.raises(InputError, match=r"controller\.shares: .* did you mean 'share'"):
        scenario.changed(unknown)
    with pytest.raises(InputError, match=r"controller\.share: -1, expected a number > 0"):
        scenario.changed(wrong)
    with pytest.raises(InputError, match=r"controller\.share: pi takes none, only mine$"):
        scenario.changed({"controller.kind": "pi"})
    assert find_field("controller.share").type is float
    whole = designed("coupled_pi", {"controller.kind": "mine"}, end=0.1)
    half = designed("coupled_pi", {"controller.kind": "mine", "controller.share": 0.5}, end=0.1)
    assert not np.array_equal(simulate(whole).tau, simulate(half).tau)


def test_options_listed_as_in_0_4_work_and_warn():
    class Old(LeafSystem, Controller):
        options = ("feedforward", "anti_windup")

    with pytest.warns(DeprecationWarning, match="derives from ChosenFeedforward, AntiWindup"):
        register_controller("old", Old)
    fields = {"kind": "old", "feedforward": "id", "anti_windup": True}
    fields = {f"controller.{name}": value for name, value in fields.items()}
    assert load_scenario("coupled_pi", fields).controller.label == "old+id"


WIRED = [
    ("pi", {}),
    ("pi", {"setpoint_weight": 1, "anti_windup": True}),
    ("pi_ctc", {}),
    ("pi_id", {}),
    ("p_pi", {"feedforward": "id", "position_gain": [2.0, 3.0, 4.0, 5.0]}),
]
UNREAD = np.full(4, 1e9)  # by any controller


def command(loop, i, q, v):
    """Return the command of a loop while sample i is in force, at q sampled with it, and at v."""
    diagram, held = loop.diagram, loop.design.reference.held
    context = diagram.CreateDefaultContext()
    context.SetTime(i * held.period)
    diagram.GetInputPort("extra_load_torque").FixValue(context, np.zeros(4))
    put = partial(set_state, diagram, context)
    put("zero_order_hold", [*held.q[i], *held.v[i], *held.vd[i]])
    put("device/multibody_plant", [*UNREAD, *v])
    put("controller/pi_speed_controller/integral", np.ones(4))
    if loop.controller.HasInputPort("sampled_state"):
        put("encoder/samples/now", [*q, *UNREAD])
    tables = diagram.GetSubsystemByName("feedforward")
    start_feedforward(tables, diagram.GetMutableSubsystemContext(tables, context))
    return diagram.GetOutputPort("tau_cmd").Eval(context).copy()


@pytest.mark.parametrize(("kind", "choices"), WIRED, ids=str)
def test_recomputed_command_equals_that_of_the_loop(designed, kind, choices):
    fields = {"controller.kind": kind} | {f"controller.{k}": v for k, v in choices.items()}
    loop = make_loop(designed("coupled_pi", fields, start=2.0, end=3.0, rest=2))
    motion, rng = loop.design.reference.tracked, np.random.default_rng(3)
    measured = rng.normal(size=(4, 8)) + np.hstack([motion.q, motion.v])[97:101]
    held = np.array([97, 98, 99])
    before, after = [], []
    for i, (q_v, q_before) in enumerate(zip(measured[:3], measured[[0, 0, 1], :4], strict=True)):
        before.append(command(loop, held[max(i - 1, 0)], q_before, q_v[4:]))
        after.append(command(loop, held[i], q_v[:4], q_v[4:]))
    tau_cmd = np.array([*before, before[0]])
    told = after_updates(loop.design, loop.feedthrough, tau_cmd, measured, held)
    np.testing.assert_allclose(told, after, rtol=1e-9, atol=1e-6)
    assert not np.allclose(before[1:], after[1:]) or (kind == "pi" and not choices)


def rests(design, **inputs):
    """Check that a controller started at rest commands what it is told."""
    owner, system = make_controller(design)
    controller, motion = Alone(system), design.reference.tracked
    tau_cmd, state = np.array([1.0, -2.0, 300.0, 0.5]), np.append(motion.q[0], motion.v[0])
    start_controller(owner, system, controller.context, design, tau_cmd, None)
    inputs = {"reference": [*state, *motion.vd[0]], "measured": state} | inputs
    inputs |= {"sampled_state": state, "tau_cmd": tau_cmd, "tau_limited": tau_cmd}
    controller.give(**{k: x for k, x in inputs.items() if system.HasInputPort(k)})
    command = controller.output("tau_fb") + design.tuning.feedforward.steady
    np.testing.assert_allclose(command, tau_cmd, rtol=1e-9, atol=1e-9)


SCHEDULED = [("pi_scheduled", {}), ("pi_scheduled", {"feedforward": "ctc", "setpoint_weight": 1})]


@pytest.mark.parametrize(("kind", "choices"), [*WIRED, *SCHEDULED], ids=str)
def test_controller_starts_with_the_command_of_rest(designed, kind, choices):
    fields = {"controller.kind": kind} | {f"controller.{k}": v for k, v in choices.items()}
    rests(designed("coupled_pi", fields, start=2.0, end=3.0, rest=2))


@pytest.mark.parametrize(
    ("kind", "options"), [("pi", {}), ("pi", {"setpoint_weight": 0.4}), ("p_pi", {})]
)
def test_held_mean_speeds_are_those_of_the_periods(designed, kind, options):
    """Of a motion that accelerates; a run starts without an error of speed all the same."""
    fields = {f"controller.{name}": value for name, value in (options | {"kind": kind}).items()}
    design = designed("coupled_pi", fields | {"held_speed": "mean"}, start=2.0, end=2.1)
    motion = design.reference.tracked
    mean = (motion.v[1:] + motion.v[:-1]) / 2
    np.testing.assert_allclose(design.reference.held.v, [*mean, motion.v[-1]], rtol=0, atol=1e-12)
    rests(design, reference=[*motion.q[0], *motion.v[0], *np.zeros(4)])


def test_scheduled_gains_follow_the_inertia(designed):
    plain = designed("coupled_pi", end=0.1)
    share = np.array([0.5, 0.6, 0.7, 0.8])
    design = designed("coupled_pi", {"controller.kind": "pi_scheduled"}, end=0.1)
    along = np.tile(share, (len(design.reference.tracked.q), 1))  # at most 1, as at another sample
    largest = overruled(design.tuning, i_eff=along)
    design = overruled(design, tuning=overruled(largest, inertia=InertiaRange(1, 1, 1)))
    start = operating_point(design, 3)
    own, fixed = linear_feedback(design, 3, start), linear_feedback(plain, 3, start)
    np.testing.assert_allclose(own.C, share[:, None] * fixed.C, rtol=1e-12)
    np.testing.assert_allclose(own.D, share[:, None] * fixed.D, rtol=1e-12)
