"""Every block alone, without a simulator: ports, laws, starts, and bad arguments."""

import inspect
import re
import textwrap
from functools import cache, partial

import numpy as np
import pytest
from helpers import alone
from helpers.alone import GEAR, LIMIT, PERIOD, Alone, N, block, inputs_of, made, outputs_of
from helpers.strategies import GENERATORS
from hypothesis import given, settings
from oracles.block_laws import CASES, DEVICE, TIME
from pydrake.autodiffutils import ExtractGradient, InitializeAutoDiff
from pydrake.common.yaml import yaml_load
from pydrake.systems.framework import LeafSystem

from sdt_drake import pilot, systems
from sdt_drake.io.errors import InputError
from sdt_drake.systems.elastic_joints import set_motor_state
from sdt_drake.systems.encoder import set_measured
from sdt_drake.systems.pi import set_integral
from sdt_drake.systems.torque_loop import set_motor_torque
from sdt_drake.systems.wiring import set_state

BLOCKS = ["symbolic_law"]  # its ports are arguments, so it has no picture
FACES = [name for face in (systems, pilot) for name, x in vars(face).items() if callable(x)]
BLOCKS += [name for name in FACES if ".. pydrake_system::" in (block(name).__doc__ or "")]


# --- ports -----------------------------------------------------------------------------------


def is_drawn(name, system, optional=()):
    """The ports of a block are those of the picture in its docstring; others are in its text."""
    text = re.search(
        r"^\.\. pydrake_system::\n((?:\n| {4}.*\n)+)",
        f"{inspect.getdoc(block(name))}\n",
        re.MULTILINE,
    )
    inputs = [name for name in inputs_of(system) if name not in optional]
    ports = {"input_ports": inputs, "output_ports": list(outputs_of(system))}
    drawn = {name: names for name, names in ports.items() if names} | {"name": name}
    assert yaml_load(data=textwrap.dedent(text[1])) == drawn
    assert len(inputs) + len(optional) == system.num_input_ports()
    assert all(f"`{port}`" in block(name).__doc__ for port in optional)
    assert isinstance(system, LeafSystem) or system.get_name() == name


def test_every_block_has_a_law_in_these_tests():
    others = {"reference_source", "signal_table", "robot_drawing", "pilot_at_head"}
    assert {case.block for case in CASES} | others == set(BLOCKS)


@pytest.mark.parametrize("name", BLOCKS)
def test_block_has_keyword_arguments_and_documented_ports(name, robot, meshcat):
    signature = inspect.signature(block(name))
    assert all(p.kind is p.KEYWORD_ONLY for p in signature.parameters.values())
    if name != "symbolic_law":
        changes = {"meshcat": meshcat} if name == "robot_drawing" else {}
        is_drawn(name, made(name, robot, **changes))
    if name == "dynamic_saturation":
        is_drawn(name, made(name, **alone.ENVELOPE), ["motor_state"])
    if name == "pi_speed_controller":
        is_drawn(name, made(name, anti_windup=True), ["tau_cmd", "tau_limited"])


def test_motors_without_gears_have_their_envelope_at_the_joint_speed():
    own = systems.dynamic_saturation(motor_torque_limit=[5.0], n1=[10.0], n0=[20.0], widened=False)
    context = own.CreateDefaultContext()
    own.GetInputPort("tau_cmd").FixValue(context, 9.0)
    own.GetInputPort("motor_state").FixValue(context, [0.0, 15.0])
    assert own.GetOutputPort("tau_limited").Eval(context) == pytest.approx([2.5])


FREE = {"i_eff", "position_gain", "motor_torque_limit"}  # of any length
CHECKED = FREE | {"gear_ratio", "n", "amplitude", "omega_d", "period", "omega_n", "zeta"}
MORE = {"encoder": alone.RESOLVED, "pi_speed_controller": {"setpoint_weight": 1.0}}
MORE |= {"LoadTorque": {"algorithm": "printed"}}
BAD = [
    (name, argument, bad)
    for name in BLOCKS
    for argument, right in (alone.ARGUMENTS[name] | MORE.get(name, {})).items()
    for bad in ("a", -1.0, [np.nan] * np.size(right), [1.0] * (np.size(right) + 1))
    if argument in CHECKED | {"resolution", "setpoint_weight", "algorithm"}
    and not (np.size(bad) > N and argument in FREE)
]


@pytest.mark.parametrize(("name", "argument", "bad"), BAD)
def test_bad_block_argument_is_one_line_with_its_name(name, argument, bad, robot):
    with pytest.raises(InputError, match=f"^{argument}: [^\n]*$"):
        made(name, robot, **MORE.get(name, {}) | {argument: bad})


# --- laws ------------------------------------------------------------------------------------


@cache
def of_case(title):
    (case,) = (case for case in CASES if case.title == title)
    return Alone(made(case.block, DEVICE, **case.changes))


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.title)
@given(rng=GENERATORS)
def test_block_follows_its_law_by_hand(case, rng):
    block, x = of_case(case.title), []
    context = block.context
    context.SetTime(TIME)
    groups = range(context.num_discrete_state_groups())
    states = [context.get_mutable_discrete_state(k) for k in groups]
    for state in (context.get_mutable_continuous_state_vector(), *states):
        state.SetFromVector(rng.normal(size=state.size()) * case.scales.get("x", 1.0))
        x = np.append(x, state.CopyToVector())
    inputs = {
        name: rng.normal(size=port.size()) * case.scales.get(name, 1.0)
        for name, port in inputs_of(block.system).items()
    }
    block.give(**inputs)
    found = {name: block.output(name) for name in outputs_of(block.system)}
    found["change"] = block.derivatives()
    if groups:
        update = block.system.EvalUniquePeriodicDiscreteUpdate(context)
        parts = [update.get_vector(k).CopyToVector() for k in groups]
        found["change"] = np.concatenate([found["change"], *parts])
    expected, change = case.law(x, **inputs)
    expected["change"] = np.zeros(len(x)) if change is None else change
    assert found.keys() == expected.keys()
    for name, right in expected.items():
        size = np.max(np.abs(right), initial=1e-300)
        np.testing.assert_allclose(found[name], right, rtol=0, atol=case.tolerance * size)


SYMBOLIC = [case for case in CASES if case.block not in ("LoadTorque", "ReferenceTorque")]


def evaluated(system, x, inputs):
    """All outputs of a system, then its rates and next samples, as one array."""
    context = system.CreateDefaultContext()
    context.SetTime(TIME)
    groups, size = range(context.num_discrete_state_groups()), context.num_continuous_states()
    context.SetContinuousState(x[:size])
    for k in groups:
        first, size = size, size + context.get_discrete_state(k).size()
        context.SetDiscreteState(k, x[first:size])
    for name, values in inputs.items():
        system.GetInputPort(name).FixValue(context, values)
    found = [port.Eval(context) for port in outputs_of(system).values()]
    found.append(system.EvalTimeDerivatives(context).CopyToVector())
    if groups:
        update = system.EvalUniquePeriodicDiscreteUpdate(context)
        found += [update.get_vector(k).CopyToVector() for k in groups]
    return np.concatenate(found)


@pytest.mark.parametrize("case", SYMBOLIC, ids=lambda case: case.title)
@settings(max_examples=1)
@given(rng=GENERATORS)
def test_autodiff_gives_the_slopes_of_the_law(case, rng):
    block = of_case(case.title)
    size = block.context.num_total_states()
    sizes = {"x": size} | {name: port.size() for name, port in inputs_of(block.system).items()}
    ends = np.cumsum([*sizes.values()])[:-1]
    scales = np.concatenate([np.full(n, case.scales.get(x, 1.0)) for x, n in sizes.items()])
    flat = rng.normal(size=len(scales)) * scales

    def split(values):
        x, *inputs = np.split(values, ends)
        return x, dict(zip([*sizes][1:], inputs, strict=True))

    def by_law(values):
        x, inputs = split(values)
        outputs, change = case.law(x, **inputs)
        return np.concatenate([*outputs.values(), 0 * x if change is None else change])

    found = evaluated(block.system.ToAutoDiffXd(), *split(InitializeAutoDiff(flat).ravel()))
    steps = np.diag(1e-5 * np.maximum(np.abs(flat), 1e-3 * scales))
    slopes = [(by_law(flat + s) - by_law(flat - s)) / (2 * s.sum()) for s in steps]
    expected = np.transpose(slopes)
    actual = ExtractGradient(found[:, None])
    off = np.abs((actual if actual.size else 0) - expected)  # of constants Drake gives none
    assert np.all(off <= 1e-5 * np.abs(expected).max(axis=1, keepdims=True))


# --- starts ----------------------------------------------------------------------------------

Q, V = np.random.default_rng(3).normal(size=(2, 4))
STATE = np.concatenate([Q[:N], V[:N]])
INCREMENT = 2 * np.pi / (np.array(alone.RESOLVED["resolution"]) * GEAR)
Q_BEFORE, Q_NOW = (np.floor(x / INCREMENT) * INCREMENT for x in (Q[:N] - PERIOD * V[:N], Q[:N]))
LATE = alone.RESOLVED | {"offset": 0.4 * PERIOD}
STILL = {"reference": np.zeros(3 * N), "measured": np.zeros(2 * N)}
LOOP = {"bandwidth": 300.0, "error": alone.ERROR}
BOTH = np.concatenate([Q, V])
# What sets the state of a block, to what, and the output then.
PLANT = partial(set_state, path="multibody_plant", state=BOTH)
AXES = partial(set_state, path="motors", state=STATE)
MOTORS = partial(set_motor_state, q=Q[:N], v=V[:N], springs=alone.SPRINGS)
ENCODER = partial(set_measured, q=Q[:N], v=V[:N])
COUNTER = partial(ENCODER, **alone.RESOLVED)
INTEGRAL = partial(set_integral, tau=LIMIT, gains=alone.GAINS)
TORQUE = partial(set_motor_torque, tau=LIMIT, motor_torque_limit=LIMIT)
STARTS = [
    ("axis_process", {}, AXES, {}, "state", STATE),
    ("robot_plant", {}, PLANT, {}, "state", BOTH),
    ("elastic_joints", {}, MOTORS, {"state": STATE}, "motor_state", STATE),
    ("encoder", {}, ENCODER, {}, "measured", STATE),
    ("encoder", alone.RESOLVED, COUNTER, {}, "measured", np.append(Q_BEFORE, V[:N])),
    ("encoder", LATE, COUNTER, {}, "measured", np.append(Q_NOW, V[:N])),
    ("pi_speed_controller", {}, INTEGRAL, STILL, "tau_fb", LIMIT),
    ("pi_speed_controller", {"period": PERIOD}, INTEGRAL, STILL, "tau_fb", LIMIT),
    ("torque_loop", LOOP, TORQUE, {"tau_limited": LIMIT / (1 + alone.ERROR)}, "tau", LIMIT),
]


@pytest.mark.parametrize(("name", "changes", "start", "inputs", "output", "expected"), STARTS)
def test_block_starts_in_the_given_state(robot, name, changes, start, inputs, output, expected):
    block = Alone(name, robot, **changes)
    start(block.system, block.context)
    block.give(**inputs)
    np.testing.assert_allclose(block.output(output), expected, rtol=1e-9)
    if name == "torque_loop":
        assert np.all(np.abs(block.derivatives()) < 1e-9)
    if changes is alone.RESOLVED:  # at time 0 it samples once more
        block.give(state=STATE)
        block.sample(0.0)
        turned = Q_NOW - Q_BEFORE
        np.testing.assert_allclose(block.output("measured"), [*Q_NOW, *turned / PERIOD], atol=1e-12)
