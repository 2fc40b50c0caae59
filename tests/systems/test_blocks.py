"""Every block alone, without a simulator: ports, laws, slopes, starts, and bad arguments."""

import inspect
import re
import textwrap
from functools import cache, partial

import numpy as np
import pytest
from alone import (
    ARGUMENTS,
    ENVELOPE,
    ERROR,
    FRICTION,
    GEAR,
    LIMIT,
    PERIOD,
    RESOLVED,
    Alone,
    N,
    close,
    exact,
    inputs_of,
    made,
    outputs_of,
)
from hypothesis import given, settings
from laws import CASES, DEVICE, TIME
from pydrake.autodiffutils import ExtractGradient, InitializeAutoDiff
from pydrake.common.yaml import yaml_load
from strategies import GENERATORS

from sdt_drake import systems
from sdt_drake.io.errors import InputError
from sdt_drake.robot.device import OVERFLOW_RATE, sliding_friction
from sdt_drake.run.controllers import Controller, make_controller
from sdt_drake.run.kinds import CONTROLLERS

BLOCKS = [name for name in systems.__all__ if name[0].isupper()]
OF_EACH = pytest.mark.parametrize("case", CASES, ids=lambda case: case.title)


# --- ports -----------------------------------------------------------------------------------


def is_drawn(system, optional=()):
    """The ports of a block are those of the picture in its docstring; others are in its text."""
    kind = type(system)
    text = re.search(
        r"^ *\.\. pydrake_system::\n((?:\n| {8}.*\n)+)", f"{kind.__doc__}\n", re.MULTILINE
    )
    drawn = yaml_load(data=textwrap.dedent(text[1]))
    assert drawn.pop("name") == kind.__name__
    assert drawn.pop("input_ports", []) == [i for i in inputs_of(system) if i not in optional]
    assert drawn.pop("output_ports", []) == list(outputs_of(system))
    assert not drawn and set(optional) <= set(inputs_of(system))
    described = " ".join(c.__doc__ for c in kind.__mro__ if c in (kind, *kind.__bases__))
    assert all(f"`{name}`" in described for name in optional)


def test_every_block_has_a_law_here_or_in_test_sources_or_test_drawing():
    others = {"ReferenceSource", "SignalTable", "RobotDrawing"}
    assert {case.block for case in CASES} | others == set(BLOCKS)


@pytest.mark.parametrize("name", BLOCKS)
def test_a_block_has_keyword_arguments_and_the_ports_of_its_picture(name, robot, meshcat):
    signature = inspect.signature(getattr(systems, name))
    assert all(p.kind is p.KEYWORD_ONLY for p in signature.parameters.values())
    if name != "SymbolicLaw":  # its ports are arguments
        is_drawn(made(name, robot, **({"meshcat": meshcat} if name == "RobotDrawing" else {})))
    if name == "DynamicSaturation":
        is_drawn(made(name, **ENVELOPE), ["state"])
    if name == "PiSpeedController":
        is_drawn(made(name, anti_windup=True), ["tau_cmd", "tau"])


@pytest.mark.parametrize("name", CONTROLLERS)
def test_controllers_have_the_ports_of_their_pictures(designed, name):
    kind = {"controller.kind": name}
    is_drawn(make_controller(designed("coupled_pi", kind, end=0.1)))
    inputs = {"anti_windup": (True, "tau_limited"), "feedforward": ("ctc", "load_torque")}
    for option in inputs.keys() & set(CONTROLLERS[name].options):
        value, port = inputs[option]
        fields = kind | {f"controller.{option}": value}
        assert port in inputs_of(make_controller(designed("coupled_pi", fields, end=0.1)))
        assert f"`{port}`" in Controller.__doc__


CHECKED = {
    "i_eff", "gear_ratio", "n", "amplitude", "omega_d", "motor_torque_limit", "period", "omega_n",
    "zeta", "position_gain", "resolution", "structure", "algorithm",
}  # fmt: skip
FREE = ("i_eff", "position_gain", "motor_torque_limit")  # of any length
MORE = {"Encoder": RESOLVED, "PiSpeedController": {"structure": "pi"}}
MORE |= {"LoadTorque": {"algorithm": "printed"}}
BAD = [
    (name, argument, bad)
    for name in BLOCKS
    for argument, right in (ARGUMENTS[name] | MORE.get(name, {})).items()
    for bad in ("a", -1.0, [np.nan] * np.size(right), [1.0] * (np.size(right) + 1))
    if argument in CHECKED and not (np.size(bad) > N and argument in FREE)
]


@pytest.mark.parametrize(("name", "argument", "bad"), BAD)
def test_a_bad_argument_is_one_line_with_its_name(name, argument, bad, robot):
    with pytest.raises(InputError, match=f"^{argument}: [^\n]*$"):
        made(name, robot, **MORE.get(name, {}) | {argument: bad})


def test_arguments_that_need_another_one_are_refused():
    with pytest.raises(InputError, match=r"^n1, n0: "):
        made("DynamicSaturation", n1=[1.0] * N)
    with pytest.raises(InputError, match=r"^gear_ratio: missing"):
        made("Encoder", resolution=[5.0] * N)


# --- laws ------------------------------------------------------------------------------------


def sizes_of_state(context):
    """Size of the continuous state, and of each group of the discrete one."""
    discrete = context.get_discrete_state()
    groups = [discrete.get_vector(k).size() for k in range(discrete.num_groups())]
    return [context.num_continuous_states(), *groups]


def evaluate(diagram, x, inputs):
    """Outputs and "change", rates and next samples, of a diagram of any scalar type."""
    context = diagram.CreateDefaultContext()
    context.SetTime(TIME)
    for name, value in inputs.items():
        diagram.GetInputPort(name).FixValue(context, value)
    continuous, *samples = np.split(x, np.cumsum(sizes_of_state(context))[:-1])
    change = []
    if len(continuous):
        context.SetContinuousState(continuous)
        change += list(diagram.EvalTimeDerivatives(context).CopyToVector())
    for k, sample in enumerate(samples):
        context.SetDiscreteState(k, sample)
    if samples:
        update = diagram.EvalUniquePeriodicDiscreteUpdate(context)
        change += [x for k in range(len(samples)) for x in update.get_vector(k).CopyToVector()]
    outputs = {name: port.Eval(context) for name, port in outputs_of(diagram).items()}
    return outputs | {"change": change}


def drawn(diagram, scales, rng):
    """A random state and random inputs."""
    size = sum(sizes_of_state(diagram.CreateDefaultContext()))
    ports = {"x": size} | {name: port.size() for name, port in inputs_of(diagram).items()}
    inputs = {name: rng.normal(size=n) * scales.get(name, 1.0) for name, n in ports.items()}
    return inputs.pop("x"), inputs


@cache
def of_case(title, autodiff=False):
    (case,) = (case for case in CASES if case.title == title)
    block = made(case.block, DEVICE, **case.changes)
    return block.ToAutoDiffXd() if autodiff else block


def by_law(case, x, inputs):
    outputs, change = case.law(x, **inputs)
    return outputs | {"change": np.zeros(len(x)) if change is None else change}


@OF_EACH
@given(rng=GENERATORS)
def test_law(case, rng):
    diagram = of_case(case.title)
    x, inputs = drawn(diagram, case.scales, rng)
    values, expected = evaluate(diagram, x, inputs), by_law(case, x, inputs)
    assert values.keys() == expected.keys()
    for name, right in expected.items():
        size = np.max(np.abs(right), initial=1e-300)
        np.testing.assert_allclose(values[name], right, rtol=0, atol=case.tolerance * size)


SYMBOLIC = [case for case in CASES if case.block not in ("LoadTorque", "ReferenceTorque")]


@pytest.mark.parametrize("case", SYMBOLIC, ids=lambda case: case.title)
@settings(max_examples=4)
@given(rng=GENERATORS)
def test_autodiff_gives_the_slopes_of_the_law(case, rng):
    x, inputs = drawn(of_case(case.title), case.scales, rng)
    ends = np.cumsum([len(x), *map(len, inputs.values())])[:-1]
    flat = np.concatenate([x, *inputs.values()])
    steps = np.diag(1e-5 * np.maximum(np.abs(flat), 1e-3))

    def of(law, values):
        x, *rest = np.split(values, ends)
        return np.concatenate([*law(x, dict(zip(inputs, rest, strict=True))).values()])

    autodiff, law = partial(evaluate, of_case(case.title, True)), partial(by_law, case)
    actual = ExtractGradient(of(autodiff, InitializeAutoDiff(flat).ravel())[:, None])
    slopes = [(of(law, flat + s) - of(law, flat - s)) / (2 * s.sum()) for s in steps]
    expected = np.transpose(slopes)
    size = np.abs(expected).max(axis=1, keepdims=True)  # Drake gives no gradient of constants
    assert np.all(np.abs((actual if actual.size else 0) - expected) <= 1e-5 * size)


@OF_EACH
def test_direct_feedthrough(case):
    """Elsewhere an input leaves no algebraic loop."""
    block = Alone(of_case(case.title))
    pairs = {f"{i} {o}" for i in inputs_of(block.system) for o in outputs_of(block.system)}
    expected = pairs if case.feedthrough is None else case.feedthrough
    assert {" ".join(way) for way in block.at_once()} == expected


# --- starts ----------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["AxisProcess", "RobotPlant", "ElasticJoints", "Encoder"])
def test_a_block_starts_with_the_given_state(robot, name):
    block = Alone(name, robot)
    state = np.random.normal(size=(2, 4 if name == "RobotPlant" else N))
    block.system.rest(block.context, *state)
    if name == "ElasticJoints":  # rigid joints have the state of the links
        block.give(state=state.ravel())
    output = {"ElasticJoints": "motor_state", "Encoder": "measured"}.get(name, "state")
    exact(block.output(output), state.ravel())


def test_an_encoder_with_a_resolution_starts_in_steady_motion():
    block = Alone("Encoder", **RESOLVED)
    assert block.timing == Alone("Encoder").timing == (0, PERIOD)
    increment = 2 * np.pi / (np.array(RESOLVED["resolution"]) * GEAR)
    q, v = np.random.normal(size=(2, N))
    block.system.rest(block.context, q, v)
    counted = np.floor(q / increment) * increment
    np.testing.assert_allclose(block.output("measured"), [*counted, *v], rtol=1e-9)
    block.give(state=[*q, *v])  # at time 0 it samples once more
    block.sample(0.0)
    exact(block.output("measured")[N:], np.zeros(N))


@pytest.mark.parametrize("period", [None, PERIOD])
def test_a_pi_starts_with_the_torque_of_its_integral(period):
    block = Alone("PiSpeedController", period=period)
    block.system.rest(block.context, LIMIT)
    block.give(reference=np.zeros(3 * N), state=np.zeros(2 * N))
    close(block.output("tau_fb"), LIMIT)


def test_a_torque_loop_starts_with_the_torque_of_the_motors():
    block = Alone("TorqueLoop", bandwidth=300.0, error=ERROR)
    block.system.rest(block.context, LIMIT)
    block.give(tau_limited=LIMIT / (1 + ERROR))
    close(block.output("tau"), LIMIT)
    assert np.all(np.abs(block.derivatives()) < 1e-9)


@pytest.mark.parametrize("speed", [0.0, *np.logspace(-9, 1, 6), 0.019, 0.02])
def test_friction_starts_in_steady_sliding_or_unloaded(speed):
    block, v = Alone("JointFriction"), speed * np.array([1, -1, 1])
    block.system.rest(block.context, v)
    block.give(state=[*np.ones(N), *v])
    force = GEAR * block.output("friction")
    np.testing.assert_allclose(force, sliding_friction(FRICTION, v), rtol=1e-9, atol=1e-9)
    assert np.all(np.abs(block.derivatives()) <= 1e-8 * speed + 1e-15)


# --- energy ----------------------------------------------------------------------------------


@given(rng=GENERATORS)
def test_friction_only_takes_energy_and_leads_to_steady_sliding(rng):
    """(F - F_0) v - dW/dt >= 0, with W = int F_c clip(z / z_c) dz; any z leads to z_c + v/l."""
    block, z_c = Alone("JointFriction"), FRICTION.presliding
    for _ in range(20):
        z = rng.choice([-1, 1], size=N) * z_c * 10 ** rng.uniform(-3, 3, size=N)
        v = rng.choice([-1, 1], size=N) * 10 ** rng.uniform(-9, 1, size=N)
        block.context.SetContinuousState(z / z_c / 100)
        block.give(state=[*np.zeros(N), *v])
        force = GEAR * block.output("friction") - FRICTION.offset
        rate = 100 * z_c * block.derivatives()
        stored = FRICTION.coulomb * np.clip(z / z_c, -1, 1) * rate
        assert np.all(force * v - stored >= -1e-12 * (np.abs(force * v) + np.abs(stored)))
        steady = np.sign(v) * z_c + v / OVERFLOW_RATE
        assert np.all(rate * (steady - z) > 0)
