"""Every block without Python in it against its law by hand: values, and AutoDiff's slopes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest
from alone import (
    ARGUMENTS,
    ENVELOPE,
    FRICTION,
    GAINS,
    GEAR,
    LIMIT,
    PERIOD,
    ROTORS,
    SPRINGS,
    Alone,
    N,
    inputs_of,
    outputs_of,
)
from pydrake.autodiffutils import ExtractGradient, InitializeAutoDiff

from sdt_drake.device import OVERFLOW_RATE, PRESLIDING_DAMPING_TIME
from sdt_drake.systems import (
    axis_process_block,
    ctc_feedforward_block,
    disturbance_block,
    dynamic_saturation_block,
    elastic_joints_block,
    encoder_block,
    friction_block,
    gain_schedule_block,
    pi_speed_controller_block,
    position_loop_block,
    torque_loop_block,
    true_load_block,
)

TIME = 0.3  # s


class Case(NamedTuple):
    """A block with its law: from state and inputs to outputs, and to rates and next samples.

    `scales` are the sizes of what it is tried with, 1 unless given; "x" is the state.
    """

    name: str
    describe: object
    changes: dict
    law: object
    scales: dict


CASES = []


def case(describe, *, scales=None, name="", **changes):
    """Register the law that follows."""

    def register(law):
        title = " ".join([describe.__name__.removesuffix("_block"), name]).strip()
        CASES.append(Case(title, describe, changes, law, scales or {}))
        return law

    return register


def pi_law(structure, anti_windup, period):
    def law(x, reference, state, tau_cmd=0, tau=0):
        v_ref, v = reference[N : 2 * N], state[N:]
        error = GEAR * (v_ref - v)
        proportional = error if structure == "pi" else -GEAR * v
        rate = error + (tau - tau_cmd) / GAINS.kp if anti_windup else error
        change = rate if period is None else x + period * rate
        return {"tau_fb": GAINS.ki * x + GAINS.kp * proportional}, change

    return law


for structure in ("pi", "p_in_feedback"):
    for anti_windup in (False, True):
        for period in (None, PERIOD / 4):
            for elements in (False, True):
                words = [
                    structure,
                    "anti-windup" if anti_windup else "",
                    "sampled" if period else "",
                    "elements" if elements else "",
                ]
                case(
                    pi_speed_controller_block,
                    name=" ".join(filter(None, words)),
                    structure=structure,
                    anti_windup=anti_windup,
                    period=period,
                    elements=elements,
                )(pi_law(structure, anti_windup, period))


@case(ctc_feedforward_block)
def feedforward(x, tau_fb, tau_ff):
    return {"tau_cmd": tau_fb + tau_ff}, []


@case(true_load_block)
def true_load(x, modelled_load, disturbance):
    return {"load_torque": modelled_load + disturbance}, []


@case(true_load_block, name="three parts", parts=["a", "b", "c"])
def three_parts(x, a, b, c):
    return {"load_torque": a + b + c}, []


@case(disturbance_block)
def disturbance(x, load_torque):
    return {"disturbance": 0.05 * np.sin(7.0 * TIME) * load_torque}, [0.0]


@case(dynamic_saturation_block, scales={"tau_cmd": 150.0, "alleviating_torque": 30.0})
def saturation(x, tau_cmd, alleviating_torque):
    lower, upper = np.minimum(alleviating_torque, 0), np.maximum(alleviating_torque, 0)
    return {"tau": np.clip(tau_cmd, lower - 100, upper + 100)}, [0.0]


@case(
    dynamic_saturation_block,
    name="with envelope",
    motor_torque_limit=LIMIT,
    envelope=ENVELOPE,
    scales={
        "tau_cmd": LIMIT,
        "alleviating_torque": 0.2 * LIMIT,
        "state": np.repeat([ENVELOPE.n0 / GEAR], 2, axis=0).ravel(),
    },
)
def saturation_with_envelope(x, tau_cmd, alleviating_torque, state):
    motor_speed = GEAR * state[N:]

    def share(speed):
        return np.interp(speed, [0, 1], [1, 0])  # from n1 to n0

    span = ENVELOPE.n0 - ENVELOPE.n1
    forward = LIMIT * share((motor_speed - ENVELOPE.n1) / span)
    backward = LIMIT * share((-motor_speed - ENVELOPE.n1) / span)
    lower = np.minimum(alleviating_torque, 0) - backward
    upper = np.maximum(alleviating_torque, 0) + forward
    return {"tau": np.minimum(np.maximum(tau_cmd, lower), upper)}, [0.0]


@case(axis_process_block)
def axis_process(x, tau, load_torque):
    i_eff = np.array(ARGUMENTS[axis_process_block]["i_eff"])
    return {"state": x}, [*x[N:], *((tau - load_torque) / i_eff / GEAR)]


# Sticking, sliding, and both sides of the Stribeck peak.
@case(friction_block, scales={"x": 0.02, "state": 0.03})
def friction(x, state):
    v = state[N:]
    stretch = 100 * x  # z / z_c
    held = np.clip(stretch, -1, 1)
    rate = v / FRICTION.presliding - OVERFLOW_RATE * (stretch - held)
    damping = FRICTION.coulomb * PRESLIDING_DAMPING_TIME / FRICTION.presliding
    s = v / FRICTION.stribeck_speed
    force = (
        FRICTION.coulomb * held
        + damping * np.maximum(0, 1 - stretch**2) * v
        + (FRICTION.breakaway - FRICTION.coulomb) * s * np.exp((1 - s**2) / 2)
        + FRICTION.viscous * v
    )
    return {"friction": force / GEAR}, rate / 100


@case(torque_loop_block)
def ideal_torque_loop(x, tau_limited):
    return {"tau": tau_limited}, []


@case(torque_loop_block, name="with error", error=[0.05, -0.1, 0.0])
def torque_loop_with_error(x, tau_limited):
    return {"tau": tau_limited * [1.05, 0.9, 1.0]}, []


@case(torque_loop_block, name="with lag", bandwidth=300.0, error=[0.05, -0.1, 0.0])
def torque_loop_with_lag(x, tau_limited):
    tau = 100 * LIMIT * x
    rate = 2 * np.pi * 300 * (tau_limited * [1.05, 0.9, 1.0] - tau)
    return {"tau": tau}, rate / LIMIT / 100


@case(elastic_joints_block)
def springs_of(x, tau, state):
    q, v = np.split(state, 2)
    theta, w = q.copy(), v.copy()
    theta[[0, 2]], w[[0, 2]] = x[:2], x[2:]
    spring = (SPRINGS.stiffness * (theta - q) + SPRINGS.damping * (w - v)) / GEAR
    tau_link = np.where(SPRINGS.elastic, spring, tau)
    wd = ((tau - tau_link) / ROTORS / GEAR)[[0, 2]]
    return {"tau_link": tau_link, "motor_state": np.concatenate([theta, w])}, [*x[2:], *wd]


@case(position_loop_block)
def position_loop(x, reference, state):
    q_ref, v_ref, vd_ref = np.split(reference, 3)
    v_ref = v_ref + np.array([2.0, 3.0, 5.0]) * (q_ref - state[:N])
    return {"reference": np.concatenate([q_ref, v_ref, vd_ref])}, []


@case(gain_schedule_block)
def gain_schedule(x, reference, state, inertia_share):
    q_ref, v_ref, vd_ref = np.split(reference, 3)
    q, v = np.split(state, 2)
    weighted = [q_ref, inertia_share * v_ref, vd_ref]
    return {
        "reference": np.concatenate(weighted),
        "state": np.concatenate([q, inertia_share * v]),
    }, [0.0]


@case(encoder_block)
def ideal_encoder(x, state):
    return {"state": x}, state


@case(encoder_block, name="with resolution", resolution=[50.0, 60.0, 70.0], gear_ratio=GEAR)
def encoder(x, state):
    now, before = np.split(x[1:], 2)
    increments = np.array([50.0, 60.0, 70.0]) * GEAR  # per revolution of the joint
    count = np.floor(state[:N] * increments / (2 * np.pi))
    speed = (now - before) / PERIOD
    return {"state": np.concatenate([now, speed])}, [0.0, *(count * 2 * np.pi / increments), *now]


# --- the blocks against them -----------------------------------------------------------------


def sizes_of_state(context):
    """Of the continuous state, and of each group of the discrete one."""
    discrete = context.get_discrete_state()
    groups = [discrete.get_vector(k).size() for k in range(discrete.num_groups())]
    return [context.num_continuous_states(), *groups]


def evaluate(diagram, x, inputs):
    """Outputs, and rates and next samples, of a diagram of any scalar type."""
    context = diagram.CreateDefaultContext()
    context.SetTime(TIME)
    for name, value in inputs.items():
        diagram.GetInputPort(name).FixValue(context, value)
    continuous, *samples = np.split(x, np.cumsum(sizes_of_state(context))[:-1])
    change = []
    if len(continuous):
        context.SetContinuousState(continuous)
    for k, sample in enumerate(samples):
        context.SetDiscreteState(k, sample)
    if len(continuous):
        change += list(diagram.EvalTimeDerivatives(context).CopyToVector())
    if samples:
        update = diagram.EvalUniquePeriodicDiscreteUpdate(context)
        for k in range(len(samples)):
            change += list(update.get_vector(k).CopyToVector())
    return {name: port.Eval(context) for name, port in outputs_of(diagram).items()}, change


def tries(diagram, scales, count):
    """Random states and inputs."""
    rng = np.random.default_rng(9)
    size = sum(sizes_of_state(diagram.CreateDefaultContext()))
    for _ in range(count):
        x = rng.normal(size=size) * scales.get("x", 1.0)
        yield (
            x,
            {
                name: rng.normal(size=port.size()) * scales.get(name, 1.0)
                for name, port in inputs_of(diagram).items()
            },
        )


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_law(case):
    diagram = Alone(case.describe, **case.changes).diagram
    for x, inputs in tries(diagram, case.scales, 50):
        outputs, change = evaluate(diagram, x, inputs)
        expected, expected_change = case.law(x, **inputs)
        assert outputs.keys() == expected.keys()
        for name, value in outputs.items():
            size = np.max(np.abs(expected[name]), initial=1e-300)
            np.testing.assert_allclose(value, expected[name], rtol=1e-12, atol=1e-12 * size)
        size = np.max(np.abs(expected_change), initial=1e-300)
        np.testing.assert_allclose(change, expected_change, rtol=1e-12, atol=1e-12 * size)


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_autodiff_gives_the_slope_of_the_law(case):
    diagram = Alone(case.describe, **case.changes).diagram
    converted = diagram.ToAutoDiffXd()
    for x, inputs in tries(diagram, case.scales, 8):
        sizes = [len(x), *map(len, inputs.values())]
        flat = np.concatenate([x, *inputs.values()])
        steps = 1e-5 * np.maximum(np.abs(flat), 1e-3)

        def split(values, sizes=sizes, names=tuple(inputs)):
            x, *rest = np.split(values, np.cumsum(sizes)[:-1])
            return x, dict(zip(names, rest, strict=True))

        def law(values, split=split):
            x, inputs = split(values)
            outputs, change = case.law(x, **inputs)
            return np.concatenate([*outputs.values(), change])

        outputs, change = evaluate(converted, *split(InitializeAutoDiff(flat).ravel()))
        actual = ExtractGradient(np.concatenate([*outputs.values(), change])[:, None])
        expected = np.transpose(
            [
                (law(flat + step) - law(flat - step)) / (2 * step.sum())
                for step in np.diag(steps)
            ]
        )  # fmt: skip
        if not actual.size:  # of constants, Drake gives no gradient at all
            actual = np.zeros_like(expected)
        size = np.abs(expected).max(axis=1, keepdims=True)
        assert np.all(np.abs(actual - expected) <= 1e-5 * size)
