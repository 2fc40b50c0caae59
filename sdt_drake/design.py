"""A scenario with everything computed that its loop needs."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sdt_drake.control import SpeedGains, tune
from sdt_drake.dynamics import (
    InertiaRange,
    Loads,
    TorqueGroups,
    decouple,
    effective_inertia,
    torque_groups,
)
from sdt_drake.errors import InputError
from sdt_drake.motion import Motion, Plan, check_motion, load_profile, plan_motion
from sdt_drake.resources import find_file
from sdt_drake.robot import Robot, load_robot
from sdt_drake.scenario import Scenario

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Design:
    """A scenario, resolved.

    Attributes:
        scenario: what was asked for.
        robot: from its SDF.
        motion: planned, feasible.
        torques: inverse dynamics of the links along the motion, joint side.
        loads: of each motor by Algorithm 1 with the scenario's sign, motor side.
        inertia: range of the effective inertia along the motion, motor side.
        i_eff: inertia of the axis process, motor side [kg m²], shape (n,).
        gains: of the PI speed controllers, motor side.
    """

    scenario: Scenario
    robot: Robot
    motion: Motion
    torques: TorqueGroups
    loads: Loads
    inertia: InertiaRange
    i_eff: Array
    gains: SpeedGains


def make_design(
    scenario: Scenario,
    *,
    robot: Robot | None = None,
    motion: Motion | None = None,
    torques: TorqueGroups | None = None,
) -> Design:
    """Load, plan and tune what a scenario names.

    Args:
        scenario: validated here once more.
        robot, motion, torques: used instead of loading, planning and computing the scenario's own,
            to save time where many scenarios share them.

    Raises:
        InputError: for any bad input on the way.
    """
    robot = load_robot(scenario.robot) if robot is None else robot
    try:
        scenario.validate()
        scenario.validate_sizes(robot.n)
    except InputError as error:
        raise InputError(f"{_named(scenario)}{error}") from None
    if motion is None:
        motion = load_plan(
            scenario.motion, robot, period=scenario.period, margin=scenario.torque_margin
        ).motion
    if torques is None:
        torques = torque_groups(robot, motion.q, motion.v, motion.vd)
    inertia = InertiaRange.of(effective_inertia(robot, torques.d_kk))
    loads = decouple(torques.inertial, torques.coupled, robot.gear_ratio, scenario.algorithm)
    i_eff = inertia.maximum if scenario.plant.i_eff is None else np.array(scenario.plant.i_eff)
    gains = _gains(scenario, inertia)
    _check_speed(scenario, gains, i_eff if scenario.plant.kind == "axis" else inertia.minimum)
    return Design(scenario, robot, motion, torques, loads, inertia, i_eff, gains)


def load_plan(path: str | Path, robot: Robot, *, period: float, margin: float = 1.0) -> Plan:
    """The motion of a file: a profile (.yaml) is planned, a planned motion (.csv) is checked.

    Raises:
        InputError: if there is no such file, or `robot` cannot do the motion.
    """
    file = find_file(path)
    try:
        if file.suffix in (".yaml", ".yml"):
            return plan_motion(robot, load_profile(file), period=period, margin=margin)
        if file.suffix == ".csv":
            motion = Motion.from_csv(file)
            if abs(motion.period - period) > 1e-9:
                raise InputError(f"sampled at {motion.period:g} s, expected {period:g} s")
            torque = check_motion(robot, motion, margin=margin)
            return Plan(motion, torque, np.zeros(motion.q.shape, dtype=bool), margin)
    except InputError as error:
        raise _located(error, file) from None
    raise InputError(f"{file}: expected a profile (.yaml) or a planned motion (.csv)")


def _named(scenario: Scenario) -> str:
    return f"scenario '{scenario.name}': " if scenario.name else ""


def _located(error: InputError, file: Path) -> InputError:
    text = str(error)
    return InputError(text if text.startswith(str(file)) else f"{file}: {text}")


_FASTEST = 1000.0  # rad per interpolation period; far beyond what a drive could do


def _check_speed(scenario: Scenario, gains: SpeedGains, i_eff: Array) -> None:
    """Refuse a loop so stiff that its simulation would not end."""
    with np.errstate(over="ignore", divide="ignore"):
        fastest = np.maximum(gains.kp / i_eff, np.sqrt(gains.ki / i_eff))
    if np.any(fastest * scenario.period > _FASTEST):
        k = int(np.argmax(fastest))
        raise InputError(
            f"{_named(scenario)}gains (kp, ki, or omega_r, zeta) against inertia give "
            f"joint {k + 1} a pole at {fastest[k]:.3g} rad/s, expected less than "
            f"{_FASTEST / scenario.period:.3g}"
        )


def _gains(scenario: Scenario, inertia: InertiaRange) -> SpeedGains:
    controller = scenario.controller
    if controller.kp is not None and controller.ki is not None:
        return SpeedGains(kp=np.array(controller.kp), ki=np.array(controller.ki))
    zeta = 1.0 if controller.zeta is None else controller.zeta
    try:
        return tune(inertia.maximum, controller.omega_r or 0.0, zeta)
    except InputError as error:
        raise InputError(f"{_named(scenario)}{error}") from None
