"""The law of every block without Python in it, by hand in numpy: CASES."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pydrake.symbolic as sym
from alone import (
    ENVELOPE,
    ERROR,
    FEELING,
    FRICTION,
    GAINS,
    GEAR,
    I_EFF,
    LIMIT,
    N0,
    N1,
    PERIOD,
    RESOLVED,
    ROTORS,
    SPRINGS,
    N,
)

from sdt_drake.robot.device import OVERFLOW_RATE, PRESLIDING_DAMPING_TIME, Springs
from sdt_drake.systems import SymbolicLaw

TIME = 0.3  # s


class Case(NamedTuple):
    """A block with its law: from state and inputs to outputs, and to rates and next samples.

    `scales` are the sizes of what it is tried with, 1 unless given; "x" is the state.
    """

    block: str
    title: str
    changes: dict
    law: object
    scales: dict


CASES = []


def case(block, *, scales=None, title="", **changes):
    """Register the law that follows."""

    def register(law):
        CASES.append(Case(block, f"{block} {title}".strip(), changes, law, scales or {}))
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


for anti_windup in (False, True):
    for period in (None, PERIOD / 4):
        for changes in ({"structure": "pi"}, {}):
            words = [*changes.values(), "anti-windup" * anti_windup, "sampled" * bool(period)]
            case(
                "PiSpeedController",
                title=" ".join(filter(None, words)),
                anti_windup=anti_windup,
                period=period,
                **changes,
            )(pi_law(changes.get("structure"), anti_windup, period))


@case("CtcFeedforward")
def feedforward(x, tau_fb, tau_ff):
    return {"tau_cmd": tau_fb + tau_ff}, []


@case("Disturbance")
def disturbance(x, load_torque):
    return {"disturbance": 0.05 * np.sin(7.0 * TIME) * load_torque}, [0.0]


@case("DynamicSaturation", scales={"tau_cmd": 150.0, "alleviating_torque": 30.0})
def saturation(x, tau_cmd, alleviating_torque):
    lower, upper = np.minimum(alleviating_torque, 0), np.maximum(alleviating_torque, 0)
    return {"tau": np.clip(tau_cmd, lower - 100, upper + 100)}, [0.0]


@case(
    "DynamicSaturation",
    title="not widened",
    motor_torque_limit=LIMIT,
    widened=False,
    scales={"tau_cmd": 1.5 * LIMIT},
)
def constant_limits(x, tau_cmd):
    return {"tau": np.clip(tau_cmd, -LIMIT, LIMIT)}, []


AT_SPEED = np.repeat([N0 / GEAR], 2, axis=0).ravel()


def within_envelope(x, tau_cmd, alleviating_torque, state):
    """All of the limit up to n1, none from n0 on, in the direction of the motion alone."""
    speeds = GEAR * state[N:]
    ends = list(zip(N1, N0, strict=True))
    forward, backward = (
        LIMIT * [np.interp(w, n, [1, 0]) for w, n in zip(way * speeds, ends, strict=True)]
        for way in (1, -1)
    )
    lower = np.minimum(alleviating_torque, 0) - backward
    upper = np.maximum(alleviating_torque, 0) + forward
    return {"tau": np.minimum(np.maximum(tau_cmd, lower), upper)}, [0.0]


WITHIN = {"motor_torque_limit": LIMIT, **ENVELOPE}
SIZES = {"tau_cmd": LIMIT, "alleviating_torque": 0.2 * LIMIT, "state": AT_SPEED}
case("DynamicSaturation", title="with envelope", **WITHIN, scales=SIZES)(within_envelope)


@case(
    "DynamicSaturation", title="with envelope, not widened", widened=False, **WITHIN, scales=SIZES
)
def envelope_alone(x, tau_cmd, state):
    return within_envelope(x, tau_cmd, np.zeros(N), state)


@case("AxisProcess")
def axis_process(x, tau, load_torque):
    return {"state": x}, [*x[N:], *((tau - load_torque) / I_EFF / GEAR)]


# Sticking, sliding, and both sides of the Stribeck peak.
@case("JointFriction", scales={"x": 0.02, "state": 0.03})
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
        + FRICTION.offset
    )
    return {"friction": force / GEAR}, rate / 100


@case("TorqueLoop")
def ideal_torque_loop(x, tau_limited):
    return {"tau": tau_limited}, []


@case("TorqueLoop", title="with error", error=ERROR)
def torque_loop_with_error(x, tau_limited):
    return {"tau": tau_limited * [1.05, 0.9, 1.0]}, []


@case("TorqueLoop", title="with lag", bandwidth=300.0, error=ERROR)
def torque_loop_with_lag(x, tau_limited):
    tau = 100 * LIMIT * x
    rate = 2 * np.pi * 300 * (tau_limited * [1.05, 0.9, 1.0] - tau)
    return {"tau": tau}, rate / LIMIT / 100


@case("ElasticJoints")
def springs_of(x, tau, state):
    q, v = np.split(state, 2)
    theta, w = q.copy(), v.copy()
    theta[[0, 2]], w[[0, 2]] = x[:2], x[2:]
    spring = (SPRINGS.stiffness * (theta - q) + SPRINGS.damping * (w - v)) / GEAR
    tau_link = np.where(SPRINGS.elastic, spring, tau)
    wd = ((tau - tau_link) / ROTORS / GEAR)[[0, 2]]
    return {"tau_link": tau_link, "motor_state": np.concatenate([theta, w])}, [*x[2:], *wd]


ALL = Springs(np.full(N, True), np.array([9e5, 8.0, 4e3]), np.array([700.0, 0.0, 5.0]))


@case("ElasticJoints", title="all of them", springs=ALL)
def all_springs_of(x, tau, state):
    (theta, w), (q, v) = np.split(x, 2), np.split(state, 2)
    tau_link = (ALL.stiffness * (theta - q) + ALL.damping * (w - v)) / GEAR
    return {"tau_link": tau_link, "motor_state": x}, [*w, *((tau - tau_link) / ROTORS / GEAR)]


@case("PositionLoop")
def position_loop(x, reference, sampled_state):
    q_ref, v_ref, vd_ref = np.split(reference, 3)
    v_ref = v_ref + np.array([2.0, 3.0, 5.0]) * (q_ref - sampled_state[:N])
    return {"speed_reference": np.concatenate([q_ref, v_ref, vd_ref])}, []


@case("GainSchedule")
def gain_schedule(x, reference, state, inertia_share):
    q_ref, v_ref, vd_ref = np.split(reference, 3)
    q, v = np.split(state, 2)
    return {
        "weighted_reference": np.concatenate([q_ref, inertia_share * v_ref, vd_ref]),
        "weighted_state": np.concatenate([q, inertia_share * v]),
    }, [0.0, 0.0]


@case("Encoder")
def ideal_encoder(x, state):
    return {"measured": x}, state


@case("Encoder", title="with resolution", **RESOLVED)
def encoder(x, state):
    now, before = np.split(x[1:], 2)
    increments = np.array([50.0, 60.0, 70.0]) * GEAR  # per revolution of the joint
    count = np.floor(state[:N] * increments / (2 * np.pi))
    speed = (now - before) / PERIOD
    return {"measured": np.concatenate([now, speed])}, [
        0.0,
        *(count * 2 * np.pi / increments),
        *now,
    ]


@case(
    "SymbolicLaw",
    inputs={"a": 2, "b": 1},
    output="c",
    states=1,
    timed=True,
    law=lambda x, a, b: [x[0] * a[1], sym.sin(SymbolicLaw.time) * b[0]],
    rates=lambda x, a, b: [a[0] * b[0] - x[0]],
)
def of_two_inputs(x, a, b):
    return {"c": np.array([x[0] * a[1], np.sin(TIME) * b[0]])}, [a[0] * b[0] - x[0]]


K_W, K_FW, K_FG, K_A, TAU, TAU_A = (
    np.array(getattr(FEELING, name)) for name in ("k_w", "k_fw", "k_fg", "k_a", "tau", "tau_a")
)
LAG = 2 * np.pi * 1.5


@case("InternalModel")
def internal_model(x, otoliths, canals):
    expected, unused, gravity, low_pass, cupula = np.split(x, [3, 4, 7, 10])
    axis = np.cross(otoliths, expected)
    size = np.sqrt(np.sum(axis**2))
    angle = np.arccos(otoliths @ expected / np.sqrt(np.sum(otoliths**2) * np.sum(expected**2)))
    error = angle * axis / size
    felt = K_A * (otoliths - expected)
    w_r = K_FW * error + K_W * (canals - (low_pass - cupula))
    rate = (K_W + 1) / K_W * w_r
    change = [
        LAG * (gravity - felt - expected),
        0 * unused,
        -np.cross(K_FG * error + rate, gravity) + (1 - np.sum(gravity**2)) * gravity,
        LAG * (w_r - low_pass),
        (low_pass - cupula) / TAU,
    ]
    return {"gravity": gravity, "rate": rate, "acceleration": 9.81 * felt}, np.concatenate(change)


@case("OrientationObserver", scales={"specific_force": 9.81})
def orientation_observer(x, specific_force, angular_rate):
    otoliths, low_pass, cupula, nerve, inside = np.split(x, [3, 6, 9, 12])
    outputs, change = internal_model(inside, otoliths, low_pass - cupula - nerve)
    senses = [
        LAG * (-specific_force / 9.81 - otoliths),
        LAG * (angular_rate - low_pass),
        (low_pass - cupula) / TAU,
        (low_pass - cupula - nerve) / TAU_A,
    ]
    return outputs, np.concatenate([*senses, change])
