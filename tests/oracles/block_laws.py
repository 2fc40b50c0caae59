"""The law of every block, by hand in numpy: CASES.

Independent: each law is typed in from its equation as a function of arrays, without Drake's
systems. Of the package come numbers of the blocks' arguments, and Algorithm 1 as a function
(`decouple`), which the tests of robots hold.
"""

import itertools
from dataclasses import replace
from functools import partial
from types import SimpleNamespace

import numpy as np
import pydrake.symbolic as sym
from helpers import alone
from helpers.alone import ERROR, FEELING, FRICTION, GAINS, GEAR, LIMIT, PERIOD, N

from sdt_drake.robot.deviation import Deviation, deviated
from sdt_drake.robot.device import OVERFLOW_RATE, PRESLIDING_DAMPING_TIME, Springs
from sdt_drake.robot.dynamics import decouple
from sdt_drake.robot.robot import Robot, load_robot
from sdt_drake.systems.gains import feedforward_torque
from sdt_drake.systems.symbolic import TIME as CLOCK

TIME = 0.3  # s


CASES: list[SimpleNamespace] = []


def case(block, title="", *, scales=None, tolerance=1e-12, **changes):
    """Register the law that follows, of a block with changed arguments.

    It goes from state and inputs to outputs, and to rates and next samples; None stands for 0.

    Args:
        block: name of the block.
        title: what is special about it.
        scales: sizes of the random inputs, 1 by default; "x" is the state.
        tolerance: relative error of outputs and rates.
        changes: arguments of the block.
    """
    of = {"block": block, "title": f"{block} {title}".strip(), "scales": scales or {}}
    of |= {"changes": changes, "tolerance": tolerance}

    def register(law):
        CASES.append(SimpleNamespace(law=law, **of))
        return law

    return register


# --- controllers and motors ------------------------------------------------------------------


def pi_law(
    x, reference, measured, tau_cmd=0, tau_limited=0, *, setpoint_weight, anti_windup, period
):
    v_ref, v = reference[N : 2 * N], measured[N:]
    error = GEAR * (v_ref - v)
    proportional = GEAR * (setpoint_weight * v_ref - v)
    rate = error + (tau_limited - tau_cmd) / GAINS.kp if anti_windup else error
    change = rate if period is None else x + period * rate
    return {"tau_fb": GAINS.ki * x + GAINS.kp * proportional}, change


for weight, anti_windup, period in itertools.product(
    (0, 0.3, 1), (False, True), (None, PERIOD / 4)
):
    options = {"setpoint_weight": weight, "anti_windup": anti_windup, "period": period}
    case("pi_speed_controller", f"{[*options.values()]}", **options)(partial(pi_law, **options))


@case("disturbance")
def disturbance(x, load_torque):
    return {"disturbance": 0.05 * np.sin(7.0 * TIME) * load_torque}, None


def disturbance_observer(x, tau, measured, *, period):
    g, unit = np.array([9.0, 20.0, 40.0]), 30 * alone.LIMIT
    momentum = g * alone.I_EFF * GEAR * measured[N:]
    towards = (tau + momentum) / unit
    after = np.exp(-g * (period or 0)) * (x - towards) + towards if period else g * (towards - x)
    return {"disturbance": unit * x - momentum}, after


for period in (None, PERIOD):
    register = case("disturbance_observer", "sampled" * bool(period), period=period)
    register(partial(disturbance_observer, period=period))


@case("gear_loss", "fast")
@case("gear_loss", "slow", scales={"state": 0.01})
def gear_loss(x, tau, state):
    eta, v = np.array([0.9, 0.6, 1.0]), state[N:]
    share = np.clip(v / 0.01, -1, 1)
    lost = np.where(tau * v > 0, np.abs(tau) * (1 - eta), np.abs(tau) * (1 / eta - 1))
    return {"gear_loss": lost * share}, None


@case("torque_ripple")
def torque_ripple(x, motor_state):
    angle = GEAR * motor_state[:N]
    return {"ripple": alone.LIMIT * (0.1 * np.sin(angle) + 0.02 * np.sin(6 * angle))}, None


@case("position_loop")
def position_loop(x, reference, sampled_state):
    q_ref, v_ref, vd_ref = np.split(reference, 3)
    v_ref = v_ref + np.array([2.0, 3.0, 5.0]) * (q_ref - sampled_state[:N])
    return {"speed_reference": np.concatenate([q_ref, v_ref, vd_ref])}, None


@case("gain_schedule")
def gain_schedule(x, reference, measured, inertia_share):
    q_ref, v_ref, vd_ref = np.split(reference, 3)
    q, v = np.split(measured, 2)
    return {
        "weighted_reference": np.concatenate([q_ref, inertia_share * v_ref, vd_ref]),
        "weighted_measured": np.concatenate([q, inertia_share * v]),
    }, None


def saturation(x, tau_cmd, alleviating_torque=0.0, motor_state=None):
    """All of the limit up to n1, none from n0 on, in the direction of the motion alone."""
    speed = np.zeros(N) if motor_state is None else GEAR * motor_state[N:]
    n1, n0 = (alone.ENVELOPE[name] for name in ("n1", "n0"))
    forward, backward = (LIMIT * np.clip((n0 - w) / (n0 - n1), 0, 1) for w in (speed, -speed))
    lower = np.minimum(alleviating_torque, 0) - backward
    upper = np.maximum(alleviating_torque, 0) + forward
    return {"tau_limited": np.clip(tau_cmd, lower, upper)}, None


SIZES = {"tau_cmd": 1.5 * LIMIT, "alleviating_torque": 0.3 * LIMIT}
SIZES |= {"motor_state": np.tile(alone.N0 / GEAR, 2)}
for envelope, widened in itertools.product(({}, alone.ENVELOPE), (True, False)):
    options = {"motor_torque_limit": LIMIT, "widened": widened, **envelope}
    case("dynamic_saturation", f"{len(envelope)} {widened}", scales=SIZES, **options)(saturation)


def torque_loop(x, tau_limited):
    given = tau_limited * (1 + np.array([0.05, -0.1, 0.0]))
    if not len(x):
        return {"tau": given}, None
    tau = 30 * LIMIT * x
    return {"tau": tau}, 2 * np.pi * 300 * (given - tau) / LIMIT / 30


case("torque_loop", tolerance=0)(lambda x, tau_limited: ({"tau": tau_limited}, None))
case("torque_loop", "with error", error=ERROR)(torque_loop)
case("torque_loop", "with lag", bandwidth=300.0, error=ERROR)(torque_loop)


# --- plants ----------------------------------------------------------------------------------


@case("axis_process")
def axis_process(x, tau, load_torque):
    return {"state": x}, [*x[N:], *((tau - load_torque) / alone.I_EFF / GEAR)]


# Sticking, sliding, and both sides of the Stribeck peak.
@case("joint_friction", scales={"x": 0.02, "state": 0.03})
def friction(x, state):
    v = state[N:]
    stretch = 100 * x  # z / z_c
    held = np.clip(stretch, -1, 1)
    rate = v / FRICTION.presliding - OVERFLOW_RATE * (stretch - held)
    damped = stretch + PRESLIDING_DAMPING_TIME * v / FRICTION.presliding
    s = v / FRICTION.stribeck_speed
    force = (
        FRICTION.coulomb * np.clip(damped, -1, 1)
        + (FRICTION.breakaway - FRICTION.coulomb) * s * np.exp((1 - s**2) / 2)
        + FRICTION.viscous * v
        + FRICTION.offset
    )
    return {"friction": force / GEAR}, rate / 100


# Within and beyond the stops, pressed and released, quickly and slowly.
@case("joint_stops", scales={"state": np.repeat([0.8, 0.02], N)})
def stops(x, state):
    q, v = np.split(state, 2)
    torque = np.zeros(N)
    for k, stiffness, damping in ((0, 5e4, 600.0), (2, 30.0, 0.1)):
        for sign, stop in ((1, alone.UPPER[k]), (-1, alone.LOWER[k])):
            depth, w = sign * (q[k] - stop), sign * v[k]
            if depth > 0:
                share = 1 if w > 0 else 0.36 if w < -0.02 else 1 + 0.64 * w / 0.02
                torque[k] += sign * max(
                    stiffness * depth * share + damping * min(depth / 1e-5, 1) * w, 0
                )
    return {"stop_torque": torque / GEAR}, None


@case("motor_windings", scales={"tau": alone.WINDINGS.rated_torque})
def windings(x, tau):
    winding, housing = np.split(x, 2)
    heat = (tau / [68.0, 1780.0, 0.1]) ** 2
    parts = [0.6, 0.75, 1.0] * winding + [0.4, 0.25, 0.0] * housing
    rates = np.append((heat - winding) / [90, 180, 20], (heat - housing) / [2700, 900, 20])
    return {"winding_temperature": 25.0 + [105.0, 80.0, 60.0] * parts}, rates


ALL = Springs(np.full(N, True), np.array([9e5, 8.0, 4e3]), np.array([700.0, 0.0, 5.0]))


def elastic_joints(x, tau, state, *, springs):
    elastic = springs.elastic
    q, v = np.split(state, 2)
    theta, w = q.copy(), v.copy()
    m = elastic.sum()
    theta[elastic], w[elastic] = x[:m], x[m : 2 * m]
    half = np.broadcast_to(springs.backlash, N) / 2
    wound = theta - q - np.clip(theta - q, -half, half)
    taut = np.clip(np.abs(wound) / np.maximum(half / 50, 1e-300), 0, 1) + (half == 0)
    spring = (springs.stiffness * wound + springs.damping * (w - v) * np.minimum(taut, 1)) / GEAR
    tau_link = np.where(elastic, spring, tau)
    wd = ((tau - tau_link) / alone.ROTORS / GEAR)[elastic]
    outputs = {"tau_link": tau_link, "motor_state": np.concatenate([theta, w])}
    outputs["deflection"] = theta - q
    return outputs, [*w[elastic], *wd, *(0 * x[2 * m :])]  # one of play that nothing moves


LOOSE = replace(alone.SPRINGS, backlash=np.array([0.5, 0.0, 0.02]))
for springs in (alone.SPRINGS, ALL, LOOSE):
    title = "all" * (springs is ALL) + "with play" * (springs is LOOSE)
    register = case("elastic_joints", title, springs=springs)
    register(partial(elastic_joints, springs=springs))

DEVICE = load_robot()
RATIO = np.array([67.2, 1, 1, 1])
ROTOR = RATIO**2 * [0.1291, 1.73, 0.531, 0.531]  # kg m², joint side, as published


def rigid_body(robot: Robot, q, v):
    """Mass matrix without rotors, and the torque of velocities and gravity."""
    context = robot.plant.CreateDefaultContext()
    robot.plant.SetPositionsAndVelocities(context, np.concatenate([q, v]))
    M = robot.plant.CalcMassMatrix(context) - np.diag(ROTOR)
    gravity = robot.plant.CalcGravityGeneralizedForces(context)
    return M, robot.plant.CalcBiasTerm(context) - gravity


def robot_plant(x, tau, load_torque, *, rotors):
    """M vd = r (tau - load_torque) - C + gravity, with the rotors that are not apart."""
    q, v = np.split(x, 2)
    M, bias = rigid_body(DEVICE, q, v)
    torque = RATIO * (tau - load_torque)
    return {"state": x}, [*v, *np.linalg.solve(M + np.diag(rotors), torque - bias)]


STRONG = {"tau": 10 * DEVICE.motor_torque_limit, "load_torque": 100.0}  # not limited
for apart in ([0, 0, 0, 0], [1, 0, 1, 0], [0, 1, 0, 1]):
    apart = np.array(apart, dtype=bool)
    register = case("robot_plant", f"{apart}", without_rotor=apart, scales=STRONG, tolerance=1e-9)
    register(partial(robot_plant, rotors=ROTOR * ~apart))


# --- torques of a model ----------------------------------------------------------------------


WRONG = deviated(DEVICE, Deviation(payload_mass=100.0))


@case("inverse_dynamics_controller", model=WRONG, tolerance=1e-9)
def computed_torque(x, reference, sampled_state):
    """Without an integral: Drake's controller has one, of the gain 0."""
    q_ref, v_ref, vd_ref = np.split(reference, 3)
    q, v = np.split(sampled_state, 2)
    vd = vd_ref + 2 * alone.ZETA * alone.OMEGA_N * (v_ref - v) + alone.OMEGA_N**2 * (q_ref - q)
    M, bias = rigid_body(WRONG, q, v)
    return {"tau_fb": ((M + np.diag(ROTOR)) @ vd + bias) / RATIO}, q_ref - q


def algorithm_1(x, reference, *, sign):
    """Links alone, without rotors."""
    q, v, vd = np.split(reference, 3)
    M, bias = rigid_body(DEVICE, q, v)
    own = M.diagonal() * vd
    return decouple(own, M @ vd + bias - own, RATIO, sign)._asdict(), None


# Accelerations of all sizes: every branch of Algorithm 1.
BRANCHES = {"reference": np.concatenate([np.ones(8), [0.01, 0.3, 3, 30]])}
for sign in ("consistent", "printed"):
    register = case("LoadTorque", sign, algorithm=sign, tolerance=1e-9, scales=BRANCHES)
    register(partial(algorithm_1, sign=sign))


@case(
    "ReferenceTorque",
    outputs=("tau_ff", "v_ref"),
    tolerance=1e-9,
    law=lambda groups, v, vd: [feedforward_torque("id", DEVICE, groups, vd, "consistent"), v],
)
def inverse_dynamics(x, reference):
    q, v, vd = np.split(reference, 3)
    M, bias = rigid_body(DEVICE, q, v)
    return {"tau_ff": ((M + np.diag(ROTOR)) @ vd + bias) / RATIO, "v_ref": v}, None


# --- encoders, symbols, perception -----------------------------------------------------------


@case("encoder")
def ideal_encoder(x, state):
    return {"measured": x}, state


@case("encoder", "with resolution", **alone.RESOLVED)
def encoder(x, state):
    now, before = np.split(x[1:], 2)
    increments = np.array([50.0, 60.0, 70.0]) * GEAR  # per revolution of the joint
    count = np.floor(state[:N] * increments / (2 * np.pi))
    speed = (now - before) / PERIOD
    next_sample = [0.0, *(count * 2 * np.pi / increments), *now]
    return {"measured": np.concatenate([now, speed])}, next_sample


@case(
    "symbolic_law",
    inputs={"a": 2, "b": 1},
    output="c",
    states=1,
    timed=True,
    law=lambda x, a, b: [x[0] * a[1], sym.sin(CLOCK) * b[0]],
    rates=lambda x, a, b: [a[0] * b[0] - x[0]],
)
def of_two_inputs(x, a, b):
    return {"c": np.array([x[0] * a[1], np.sin(TIME) * b[0]])}, [a[0] * b[0] - x[0]]


K_W, K_FW, K_FG, K_A, TAU, TAU_A = (
    np.array(getattr(FEELING, name)) for name in ("k_w", "k_fw", "k_fg", "k_a", "tau", "tau_a")
)
LAG = 2 * np.pi * 1.5


@case("internal_model")
def internal_model(x, otoliths, canals):
    expected, unused, gravity, low_pass, cupula = np.split(x, [3, 4, 7, 10])
    axis = np.cross(otoliths, expected)
    size = np.sqrt(np.sum(axis**2))
    angle = np.arctan2(size, otoliths @ expected)
    error = angle * axis / np.maximum(size, 1e-300)  # 0 for parallel vectors
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


@case("orientation_observer", scales={"specific_force": 9.81})
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
