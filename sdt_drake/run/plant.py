"""What of a plant follows from its motion: inertia of the axes, springs of the joints; and loops so
stiff that their simulation would not end, refused beforehand."""

from __future__ import annotations

import numpy as np

from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError
from sdt_drake.motion import Motion
from sdt_drake.robot.device import (
    PRESLIDING_DAMPING_TIME,
    FrictionParameters,
    Springs,
    friction_parameters,
    springs_of,
)
from sdt_drake.robot.dynamics import (
    InertiaRange,
    TorqueGroups,
    effective_inertia,
    gravity_stiffness,
    where_largest,
)
from sdt_drake.robot.motors import as_driven
from sdt_drake.robot.robot import Robot
from sdt_drake.run.scenario import Scenario
from sdt_drake.systems.gains import SpeedGains


def plant_along(
    scenario: Scenario,
    motion: Motion,
    loaded: tuple[Robot, TorqueGroups],
    nominal: tuple[Robot, TorqueGroups],
) -> tuple[InertiaRange, Array, Springs | None, FrictionParameters | None]:
    """Inertia along the motion, that of the axis process, springs and friction of the joints.

    Springs are those of the nominal robot, whatever deviates: another payload does not change them,
    but the frequency.
    """
    robot, torques = loaded
    plant = scenario.plant
    inertia = InertiaRange.of(effective_inertia(robot, torques.d_kk))
    i_eff = inertia.maximum if plant.i_eff is None else np.array(plant.i_eff)
    springs = _springs(scenario, motion, *nominal)
    friction = None if plant.friction.is_none else friction_parameters(plant.friction, robot.n)
    return inertia, i_eff, springs, friction


def _springs(
    scenario: Scenario, motion: Motion, robot: Robot, torques: TorqueGroups
) -> Springs | None:
    """The springs, from the inertia that each sees where it is largest along the motion."""
    elasticity, i_eff = scenario.plant.elasticity, scenario.plant.i_eff
    if elasticity.is_rigid:
        return None
    links, k_g = torques.d_kk.max(axis=0), np.zeros(robot.n)
    if i_eff is not None:
        links = robot.gear_ratio**2 * (np.array(i_eff) - robot.rotor_inertia)
    if scenario.plant.kind == "coupled":
        at = motion.q[where_largest(torques.d_kk)]  # a row for each joint
        k_g = np.array([gravity_stiffness(robot, at[k])[k, k] for k in range(robot.n)])
    elastic = np.array(elasticity.natural_frequency) > 0
    for k in np.flatnonzero(elastic):
        if robot.rotor_inertia[k] <= 0 or links[k] <= 0:
            raise InputError(
                f"plant.elasticity: joint {k + 1} has the rotor inertia {robot.rotor_inertia[k]:g} "
                f"kg m² (motor side) and the link inertia {links[k]:g} kg m² (joint side); an "
                "elastic joint needs both > 0"
            )
    return springs_of(elasticity, links, k_g)


# --- poles -----------------------------------------------------------------------------------

_FASTEST = 1000.0  # rad per interpolation period; far beyond what a drive could do


def check_poles(
    scenario: Scenario, robot: Robot, gains: SpeedGains, i_eff: Array, springs: Springs | None
) -> None:
    """Refuse a loop with a pole beyond _FASTEST.

    Args:
        scenario: says what there is.
        robot: what moves.
        gains: of its speed loops, motor side.
        i_eff: smallest inertia of each motor, motor side [kg m²], shape (n,).
        springs: of its joints, None if all are rigid.

    Raises:
        InputError: naming the field that gives the pole.
    """
    at_motor = i_eff
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
        if springs is not None:
            # Above the spring's frequency the motor has nothing but its rotor to turn.
            at_motor = np.where(springs.elastic, robot.rotor_inertia, i_eff)
            for name, poles in (
                ("natural_frequency", np.sqrt(springs.stiffness / robot.reflected_inertia)),
                ("damping_ratio", springs.damping / robot.reflected_inertia),
            ):
                poles = np.where(springs.elastic, poles, 0.0)
                _check_pole(scenario, poles, f"plant.elasticity.{name} gives")
        fastest = np.maximum(gains.kp / at_motor, np.sqrt(gains.ki / at_motor))
    model = "" if scenario.controller.model.exact else ", for the inertia of controller.model,"
    _check_pole(scenario, fastest, f"gains (kp, ki, or omega_r, zeta){model} against inertia give")
    _check_device(scenario, robot, i_eff)


def _check_device(scenario: Scenario, robot: Robot, i_eff: Array) -> None:
    """The same for friction and drive; i_eff motor side [kg m²]."""
    inertia = robot.gear_ratio**2 * i_eff
    if not scenario.plant.friction.is_none:
        friction = friction_parameters(scenario.plant.friction, robot.n)
        bristles = friction.coulomb / friction.presliding / inertia
        extra = friction.breakaway - friction.coulomb
        for name, poles in (
            ("coulomb over presliding", np.sqrt(bristles)),
            ("coulomb over presliding", PRESLIDING_DAMPING_TIME * bristles),
            ("breakaway over stribeck_speed", 2 * extra / friction.stribeck_speed / inertia),
            ("viscous", friction.viscous / inertia),
        ):
            _check_pole(scenario, poles, f"plant.friction: {name} gives")
    drive = scenario.drive
    if drive.torque_bandwidth is not None:
        lag = np.full(robot.n, 2 * np.pi * drive.torque_bandwidth)
        _check_pole(scenario, lag, "drive.torque_bandwidth gives")
    envelope = as_driven(robot, drive).envelope
    if envelope is not None:
        poles = robot.motor_torque_limit * envelope.slope / i_eff
        where = "drive" if drive.n1 is not None else "device.motors"
        _check_pole(scenario, poles, f"{where}: n0 so close to n1 gives")


def _check_pole(scenario: Scenario, poles: Array, cause: str) -> None:
    if np.any(poles * scenario.period > _FASTEST):
        k = int(np.argmax(poles))
        raise InputError(
            f"{cause} joint {k + 1} a pole at {poles[k]:.3g} rad/s, expected less than "
            f"{_FASTEST / scenario.period:.3g}"
        )


def check_reference(scenario: Scenario, robot: Robot, motion: Motion) -> None:
    """Refuse a motion of other joints, NaN, where Drake ends the process, and a reference that
    never arrives.

    Raises:
        InputError: naming joint and time, or the field.
    """
    if motion.n != robot.n:
        raise InputError(f"motion: of {motion.n} joint(s), robot '{robot.name}' has {robot.n}")
    for name in ("q", "v", "vd"):
        for i, k in np.argwhere(~np.isfinite(getattr(motion, name))):
            raise InputError(
                f"motion: {name} of joint {k + 1} is not finite at {motion.time[i]:g} s"
            )
    delay = scenario.drive.reference_delay
    if delay >= motion.duration:
        raise InputError(
            f"drive.reference_delay: {delay:g} s, but the motion ends at {motion.duration:g} s"
        )
