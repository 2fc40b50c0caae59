"""Plant data along the motion (torques, springs), and checks of reference and stiffness.

The checks reject a reference that does not fit the robot and loops that are too stiff to simulate.
"""

from weakref import WeakKeyDictionary

import numpy as np

from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError
from sdt_drake.io.progress import with_progress
from sdt_drake.motion import Motion
from sdt_drake.robot import device, dynamics
from sdt_drake.robot.motors import as_driven
from sdt_drake.robot.robot import Robot
from sdt_drake.run.scenario import Scenario
from sdt_drake.systems.gains import SpeedGains
from sdt_drake.systems.gear_loss import FULL_SPEED

_BLOCK = 10_000
"""Samples between reports of progress."""

_along: WeakKeyDictionary[Motion, WeakKeyDictionary[Robot, dynamics.TorqueGroups]] = (
    WeakKeyDictionary()
)


def torques_along(robot: Robot, motion: Motion) -> dynamics.TorqueGroups:
    """Return the inverse dynamics of a robot's links along a motion, joint side.

    The result is cached as long as robot and motion exist.
    """
    known = _along.setdefault(motion, WeakKeyDictionary())
    if robot not in known:
        rows = np.arange(len(motion.q))
        blocks = with_progress(np.array_split(rows, len(rows) // _BLOCK + 1))
        parts = (
            dynamics.torque_groups(robot, motion.q[i], motion.v[i], motion.vd[i]) for i in blocks
        )
        by_group = zip(*(vars(part).values() for part in parts), strict=True)
        known[robot] = dynamics.TorqueGroups(*map(np.concatenate, by_group))
    return known[robot]


def steady(motion: Motion) -> Motion:
    """Return the first sample of a motion, without its acceleration."""
    return Motion(motion.period, motion.q[:1], motion.v[:1], np.zeros_like(motion.v[:1]))


def springs_along(scenario: Scenario, robot: Robot, motion: Motion) -> device.Springs | None:
    """Return the springs of the joints; None if all joints are rigid.

    A spring has the stated frequency where the inertia of its link is largest along the motion.

    Args:
        scenario: gives frequencies and damping ratios.
        robot: the nominal robot; another payload changes the frequencies, not the springs.
        motion: the planned or learned motion.

    Raises:
        InputError: for an elastic joint without rotor or link inertia.
    """
    elasticity, i_eff = scenario.plant.elasticity, scenario.plant.i_eff
    if elasticity.is_rigid:
        return None
    d_kk = torques_along(robot, motion).d_kk
    links, k_g = d_kk.max(axis=0), np.zeros(robot.n)
    if i_eff is not None:
        links = robot.gear_ratio**2 * (np.array(i_eff) - robot.motor_inertia)
    if scenario.plant.kind == "coupled":
        at = motion.q[dynamics.where_largest(d_kk)]  # a row for each joint
        k_g = np.array([dynamics.gravity_stiffness(robot, at[k])[k, k] for k in range(robot.n)])
    elastic = np.array(elasticity.natural_frequency) > 0
    shared = np.argwhere((robot.shared_inertia != 0) & elastic[:, None] & ~elastic)
    if len(shared) and scenario.plant.kind == "coupled":
        one, other = (shared[0] + 1).tolist()
        raise InputError(
            f"joint {one} is elastic and joint {other} rigid, but a motor turns with both; "
            "expected both elastic or both rigid",
            place="plant.elasticity",
        )
    for k in np.flatnonzero(elastic):
        if robot.motor_inertia[k] <= 0 or links[k] <= 0:
            raise InputError(
                f"joint {k + 1} has the rotor inertia {robot.motor_inertia[k]:g} "
                f"kg m² (motor side) and the link inertia {links[k]:g} kg m² (joint side); an "
                "elastic joint needs both > 0",
                place="plant.elasticity",
            )
    return device.springs_of(elasticity, links, k_g)


# --- poles -----------------------------------------------------------------------------------

MAX_POLE = 1000.0
"""Largest pole of a loop [rad per interpolation period]; no real drive is as fast."""


def check_poles(
    scenario: Scenario,
    robot: Robot,
    gains: SpeedGains,
    i_eff: Array,
    springs: device.Springs | None,
) -> None:
    """Check that no pole of a loop exceeds MAX_POLE.

    Args:
        scenario: gives friction, elasticity and drive.
        robot: the simulated robot.
        gains: gains of the speed loops, motor side.
        i_eff: smallest inertia of each motor, motor side [kg m²], shape (n,).
        springs: springs of the joints; None if all joints are rigid.

    Raises:
        InputError: naming the field that causes the pole.
    """
    at_motor = i_eff
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
        if springs is not None:
            # Above the spring's frequency the motor accelerates its rotor alone.
            at_motor = np.where(springs.elastic, robot.motor_inertia, i_eff)
            for name, poles in (
                ("natural_frequency", np.sqrt(springs.stiffness / robot.reflected_inertia)),
                ("damping_ratio", springs.damping / robot.reflected_inertia),
            ):
                poles = np.where(springs.elastic, poles, 0.0)
                _check_pole(scenario, robot, poles, f"plant.elasticity.{name}")
        fastest = np.maximum(gains.kp / at_motor, np.sqrt(gains.ki / at_motor))
    model = "" if scenario.controller.model.exact else ", for the inertia of controller.model,"
    _check_pole(
        scenario,
        robot,
        fastest,
        "",
        f"gains (kp, ki, or omega_r, zeta){model} against inertia give",
    )
    _check_device(scenario, robot, i_eff)


def _check_device(scenario: Scenario, robot: Robot, i_eff: Array) -> None:
    """Check the poles of friction and drive; i_eff is on the motor side [kg m²], shape (n,)."""
    inertia = robot.gear_ratio**2 * i_eff
    if not scenario.plant.friction.is_none:
        friction = device.friction_parameters(scenario.plant.friction, robot.n)
        bristles = friction.coulomb / friction.presliding / inertia
        extra = friction.breakaway - friction.coulomb
        for name, poles in (
            ("coulomb over presliding", np.sqrt(bristles)),
            ("coulomb over presliding", device.PRESLIDING_DAMPING_TIME * bristles),
            ("breakaway over stribeck_speed", 2 * extra / friction.stribeck_speed / inertia),
            ("viscous", friction.viscous / inertia),
        ):
            _check_pole(scenario, robot, poles, "plant.friction", f"{name} gives")
    if (efficiency := scenario.plant.gear_efficiency) is not None:
        lost = (1 / np.array(efficiency) - 1) * robot.motor_torque_limit
        poles = lost / (FULL_SPEED * robot.gear_ratio * i_eff)
        _check_pole(scenario, robot, poles, "plant.gear_efficiency")
    stops = scenario.plant.stops
    stops.check(robot)
    for name, power in (("stiffness", 0.5), ("damping", 1.0)):
        if (values := getattr(stops, name)) is not None:
            poles = (np.array(values) / inertia) ** power
            _check_pole(scenario, robot, poles, f"plant.stops.{name}")
    drive, filters = scenario.drive, getattr(scenario.controller, "filters", None)
    if filters is not None and drive.period is None:
        for name, values in filters.frequencies.items():
            _check_pole(scenario, robot, 2 * np.pi * np.array(values), f"controller.filters.{name}")
    if drive.torque_bandwidth is not None:
        lag = np.full(robot.n, 2 * np.pi * drive.torque_bandwidth)
        _check_pole(scenario, robot, lag, "drive.torque_bandwidth")
    envelope = as_driven(robot, drive).envelope
    if envelope is not None:
        poles = robot.motor_torque_limit * envelope.slope / i_eff
        where = "drive" if drive.n1 is not None else "device.motors"
        _check_pole(scenario, robot, poles, where, "n0 so close to n1 gives")


def _check_pole(
    scenario: Scenario, robot: Robot, poles: Array, place: str, cause: str = "gives"
) -> None:
    if np.any(poles * scenario.period > MAX_POLE):
        k = int(np.argmax(poles))
        rotor = "; it has no rotor inertia, by <drake:rotor_inertia> or device.motors"
        raise InputError(
            f"{cause} joint {k + 1} a pole at {poles[k]:.3g} rad/s, expected less than "
            f"{MAX_POLE / scenario.period:.3g}{rotor * bool(robot.motor_inertia[k] == 0)}",
            place=place,
        )


def check_reference(scenario: Scenario, robot: Robot, motion: Motion) -> None:
    """Check that a reference fits the robot, is finite, and arrives before the motion ends.

    Drake would end the process at NaN.

    Raises:
        InputError: naming joint and time, or the field.
    """
    if motion.n != robot.n:
        raise InputError(f"{motion.n} joint(s), robot '{robot.name}' has {robot.n}", place="motion")
    for name in ("q", "v", "vd"):
        for i, k in np.argwhere(~np.isfinite(getattr(motion, name))):
            raise InputError(
                f"{name} of joint {k + 1} is not finite at {motion.time[i]:g} s", place="motion"
            )
    delay = scenario.drive.reference_delay
    if delay >= motion.duration:
        raise InputError(
            f"{delay:g} s, expected less than the motion's duration, {motion.duration:g} s",
            place="drive.reference_delay",
        )
