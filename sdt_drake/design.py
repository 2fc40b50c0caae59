"""A scenario with everything computed that its loop needs."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sdt_drake.control import (
    SpeedGains,
    feedforward_torque,
    natural_frequency,
    tune,
)
from sdt_drake.deviation import Deviation, deviated
from sdt_drake.device import (
    PRESLIDING_DAMPING_TIME,
    Springs,
    chosen_robot,
    friction_parameters,
    sliding_friction,
    springs_of,
)
from sdt_drake.dynamics import (
    InertiaRange,
    Loads,
    TorqueGroups,
    decouple,
    effective_inertia,
    torque_groups,
    where_largest,
)
from sdt_drake.errors import InputError, checked_choice, checked_type
from sdt_drake.motion import (
    PLANNERS,
    CommandProfile,
    Motion,
    Plan,
    Sampled,
    check_motion,
    find_motion,
    import_motion,
    load_command,
)
from sdt_drake.resources import find_file
from sdt_drake.robot import Robot, load_robot
from sdt_drake.scenario import Scenario

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Design:
    """A scenario, resolved.

    Attributes:
        scenario: what was asked for.
        robot: what moves: the SDF with the deviation of the plant.
        motion: planned, feasible for the robot as the SDF has it.
        torques: inverse dynamics of the links along the motion, joint side: on the axis plant of
            what moves, as they load the motors there; on the coupled plant, which has its own, of
            the robot as the SDF has it.
        loads: of each motor by Algorithm 1 with the scenario's sign, motor side.
        inertia: range of the effective inertia along the motion, motor side.
        i_eff: inertia of the axis process, motor side [kg m²], shape (n,).
        gains: of the PI speed controllers, motor side; tuned on the controller's model.
        model: what the controller takes the robot for; `robot` itself if it knows it exactly.
        tau_ff: torque feedforward along the motion, motor side [N m], shape (N + 1, n); None where
            the controller has none.
        inertia_share: I_eff along the motion over its largest, of the model [-], shape (N + 1, n).
        omega_n: natural frequency of the speed loops at the model's largest inertia [rad/s], (n,).
        position_gain: K_V of a position loop [1/s], shape (n,).
        elastic: springs of the joints, None if all are rigid.
        nominal: the robot as the SDF has it; `robot` itself if the plant does not deviate.
        nominal_torques: `torques` of it.
        steady_load, steady_ff: load torque and torque feedforward of who has gone on at the first
            speed for long, motor side [N m], shape (n,): where a run starts.
    """

    scenario: Scenario
    robot: Robot
    motion: Motion
    torques: TorqueGroups
    loads: Loads
    inertia: InertiaRange
    i_eff: Array
    gains: SpeedGains
    model: Robot
    tau_ff: Array | None
    inertia_share: Array
    omega_n: Array
    position_gain: Array
    elastic: Springs | None
    nominal: Robot
    nominal_torques: TorqueGroups
    steady_load: Array
    steady_ff: Array | float

    def variant(self, scenario: Scenario) -> Design:
        """The design of another scenario with the same SDF and motion.

        Raises:
            InputError: for what does not fit them.
        """
        return make_design(
            scenario, robot=self.nominal, motion=self.motion, torques=self.nominal_torques
        )


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
        robot, motion, torques: of the SDF without any deviation; used instead of loading, planning
            and computing the scenario's own, to save time where many scenarios share them. `robot`
            is the chosen device: `scenario.device` is not applied to it once more.

    Raises:
        InputError: for any bad input on the way.
    """
    checked_type(scenario, Scenario, "scenario")
    try:
        scenario.validate()
    except InputError as error:
        raise InputError(f"{_named(scenario)}{error}") from None
    robot = load_device(scenario) if robot is None else checked_type(robot, Robot, "robot")
    try:
        scenario.validate_sizes(robot.n)
        choice, nominal = scenario.controller, robot
        model = _load_model(nominal, choice.model, "controller.model")
        robot = _load_model(nominal, scenario.plant.deviation, "plant.deviation")
    except InputError as error:
        raise InputError(f"{_named(scenario)}{error}") from None
    if motion is None:
        motion = load_plan(
            scenario.motion,
            nominal,
            period=scenario.period,
            torque_margin=scenario.torque_margin,
            planner=scenario.planner,
        ).motion
    try:
        _check_finite(checked_type(motion, Motion, "motion"))
        if torques is None:
            torques = torque_groups(nominal, motion.q, motion.v, motion.vd)
        nominal_torques = torques
        _check_delay(scenario, motion)
        if robot is not nominal and scenario.plant.kind == "axis":
            torques = torque_groups(robot, motion.q, motion.v, motion.vd)
        inertia = InertiaRange.of(effective_inertia(robot, torques.d_kk))
        loads = _loads(scenario, robot, motion, torques)
        i_eff = inertia.maximum if scenario.plant.i_eff is None else np.array(scenario.plant.i_eff)
        elastic = _elastic_joints(scenario, robot, motion, torques, i_eff)
        modelled = nominal_torques
        if model is not nominal:
            modelled = torque_groups(model, motion.q, motion.v, motion.vd)
        i_eff_modelled = effective_inertia(model, modelled.d_kk)
        largest = i_eff_modelled.max(axis=0)
        gains = _gains(scenario, largest, nominal)
        slowest = i_eff if scenario.plant.kind == "axis" else inertia.minimum
        _check_speed(scenario, robot, gains, slowest, elastic)
        _check_device_speed(scenario, robot, slowest)
    except InputError as error:
        raise InputError(f"{_named(scenario)}{error}") from None
    omega_n = natural_frequency(gains, largest)
    steady = Motion(motion.period, motion.q[:1], motion.v[:1], np.zeros((1, robot.n)))
    steady_ff = feedforward_along(scenario, model, steady)
    return Design(
        scenario=scenario,
        robot=robot,
        motion=motion,
        torques=torques,
        loads=loads,
        inertia=inertia,
        i_eff=i_eff,
        gains=gains,
        model=model,
        tau_ff=feedforward_along(scenario, model, motion, modelled),
        inertia_share=i_eff_modelled / largest,
        omega_n=omega_n,
        position_gain=omega_n / 4
        if choice.position_gain is None
        else np.array(choice.position_gain),
        elastic=elastic,
        nominal=nominal,
        nominal_torques=nominal_torques,
        steady_load=_loads(scenario, robot, steady).load_torque[0],
        steady_ff=0.0 if steady_ff is None else steady_ff[0],
    )


def _loads(
    scenario: Scenario, robot: Robot, motion: Motion, torques: TorqueGroups | None = None
) -> Loads:
    if torques is None:
        torques = torque_groups(robot, motion.q, motion.v, motion.vd)
    return decouple(torques.inertial, torques.coupled, robot.gear_ratio, scenario.algorithm)


def load_plan(
    path: str | Path,
    robot: Robot,
    *,
    period: float,
    torque_margin: float = 1.0,
    planner: str = "limiter",
) -> Plan:
    """Plan the motion of a file, or the shipped one of a name.

    A command (.yaml) is planned. So is a CSV, resampled if it has to be; but one that is a motion
    at `period` already is planned only by the retiming planner, for the limiter just checked.

    Raises:
        InputError: if there is no such file, or `robot` cannot do the motion.
    """
    checked_choice(planner, tuple(PLANNERS), "planner")
    file = find_file(find_motion(path))
    plan = partial(PLANNERS[planner], robot, period=period, torque_margin=torque_margin)
    try:
        if file.suffix in (".yaml", ".yml"):
            return plan(load_command(file, robot))
        if file.suffix == ".csv":
            motion, loss = import_motion(file, period)
            if loss is None and planner == "limiter":
                torque = check_motion(robot, motion, torque_margin=torque_margin)
                return Plan(
                    motion, torque, np.zeros(motion.q.shape, dtype=bool), torque_margin, motion
                )
            return replace(plan(_as_command(motion, file.stem)), loss=loss)
    except InputError as error:
        raise _located(error, file) from None
    raise InputError(f"{file}: expected a profile (.yaml) or a motion (.csv)")


def _as_command(motion: Motion, name: str) -> CommandProfile:
    """A motion as what is commanded."""
    joints = [Sampled(motion.period, speeds.tolist()) for speeds in motion.v.T]
    return CommandProfile(name, "", motion.duration, motion.q[0].tolist(), joints)


def _named(scenario: Scenario) -> str:
    return f"scenario '{scenario.name}': " if scenario.name else ""


def _located(error: InputError, file: Path) -> InputError:
    text = str(error)
    return InputError(text if text.startswith(str(file)) else f"{file}: {text}")


def load_device(scenario: Scenario) -> Robot:
    """The robot that planner, controller and plant know."""
    robot = load_robot(scenario.robot)
    try:
        return robot if scenario.device is None else chosen_robot(robot, scenario.device)
    except InputError as error:
        raise InputError(f"{_named(scenario)}{error}") from None


def _check_finite(motion: Motion) -> None:
    """Drake ends the process where it meets NaN."""
    for name in ("q", "v", "vd"):
        bad = np.argwhere(~np.isfinite(getattr(motion, name)))
        if len(bad):
            i, k = bad[0]
            raise InputError(
                f"motion: {name} of joint {k + 1} is not finite at {motion.time[i]:g} s"
            )


def _check_delay(scenario: Scenario, motion: Motion) -> None:
    delay = scenario.drive.reference_delay if scenario.drive is not None else 0.0
    if delay >= motion.duration:
        raise InputError(
            f"drive.reference_delay: {delay:g} s, but the motion ends at {motion.duration:g} s"
        )


def _load_model(robot: Robot, errors: Deviation, where: str) -> Robot:
    try:
        return deviated(robot, errors)
    except InputError as error:
        text = str(error)
        if text.startswith(("payload", "link_scales")):
            raise InputError(f"{where}.{text}") from None
        raise InputError(f"{where}: no body could be like that ({text})") from None


def feedforward_along(
    scenario: Scenario, model: Robot, motion: Motion, torques: TorqueGroups | None = None
) -> Array | None:
    """Torque feedforward of a scenario's controller, motor side [N m], shape (N + 1, n).

    None where it has none. `torques` are those of the model along the motion, computed here by
    default.
    """
    choice = scenario.controller
    kind = choice.feedforward_in_use
    if kind == "none" and not choice.friction_compensation:
        return None
    if torques is None:
        torques = torque_groups(model, motion.q, motion.v, motion.vd)
    groups = (torques.inertial, torques.reaction, torques.velocity, torques.gravity)
    tau_ff = feedforward_torque(kind, model, groups, motion.vd, scenario.algorithm)
    if choice.feedforward_gain is not None:
        tau_ff = np.array(choice.feedforward_gain) * tau_ff
    if choice.friction_compensation and scenario.plant.friction is not None:
        friction = friction_parameters(scenario.plant.friction, model.n)
        tau_ff = tau_ff + sliding_friction(friction, motion.v) / model.gear_ratio
    return tau_ff


def _elastic_joints(
    scenario: Scenario, robot: Robot, motion: Motion, torques: TorqueGroups, i_eff: Array
) -> Springs | None:
    """The springs, from the inertia that each sees where it is largest along the motion."""
    elasticity = scenario.plant.elasticity
    if elasticity is None:
        return None
    if scenario.plant.kind == "axis":
        links = robot.gear_ratio**2 * (i_eff - robot.rotor_inertia)
        gravity_stiffness = np.zeros(robot.n)
    else:
        links = torques.d_kk.max(axis=0)
        at = motion.q[where_largest(torques.d_kk)]  # a row for each joint
        gravity_stiffness = np.array([_gravity_stiffness(robot, at[k], k) for k in range(robot.n)])
    elastic = np.array(elasticity.natural_frequency) > 0
    for k in np.flatnonzero(elastic):
        if robot.rotor_inertia[k] <= 0 or links[k] <= 0:
            raise InputError(
                f"plant.elasticity: joint {k + 1} has the rotor inertia {robot.rotor_inertia[k]:g} "
                f"kg m² (motor side) and the link inertia {links[k]:g} kg m² (joint side); an "
                "elastic joint needs both > 0"
            )
    return springs_of(elasticity, links, gravity_stiffness)


def _gravity_stiffness(robot: Robot, q: Array, k: int) -> float:
    """Change of the gravity torque of joint k with its angle, joint side [N m/rad]."""
    step = 1e-5  # rad
    around = np.array([q, q])
    around[0, k] -= step
    around[1, k] += step
    rest = np.zeros_like(around)
    low, high = torque_groups(robot, around, rest, rest).gravity[:, k]
    return (high - low) / (2 * step)


_FASTEST = 1000.0  # rad per interpolation period; far beyond what a drive could do


def _check_speed(
    scenario: Scenario,
    robot: Robot,
    gains: SpeedGains,
    i_eff: Array,
    elastic: Springs | None,
) -> None:
    """Refuse a loop so stiff that its simulation would not end."""
    at_motor = i_eff
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
        if elastic is not None:
            # Above the spring's frequency the motor has nothing but its rotor to turn.
            at_motor = np.where(elastic.elastic, robot.rotor_inertia, i_eff)
            for name, poles in (
                ("natural_frequency", np.sqrt(elastic.stiffness / robot.reflected_inertia)),
                ("damping_ratio", elastic.damping / robot.reflected_inertia),
            ):
                poles = np.where(elastic.elastic, poles, 0.0)
                _check_pole(scenario, poles, f"plant.elasticity.{name} gives")
        fastest = np.maximum(gains.kp / at_motor, np.sqrt(gains.ki / at_motor))
    model = "" if scenario.controller.model.exact else ", for the inertia of controller.model,"
    _check_pole(scenario, fastest, f"gains (kp, ki, or omega_r, zeta){model} against inertia give")


def _check_device_speed(scenario: Scenario, robot: Robot, i_eff: Array) -> None:
    """The same for friction and drive; i_eff motor side [kg m²]."""
    inertia = robot.gear_ratio**2 * i_eff
    if scenario.plant.friction is not None:
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
    if drive is not None and drive.torque_bandwidth is not None:
        lag = np.full(robot.n, 2 * np.pi * drive.torque_bandwidth)
        _check_pole(scenario, lag, "drive.torque_bandwidth gives")
    if drive is not None and drive.n1 is not None and drive.n0 is not None:
        slope = robot.motor_torque_limit / (np.array(drive.n0) - np.array(drive.n1))
        _check_pole(scenario, slope / i_eff, "drive: n0 so close to n1 gives")


def _check_pole(scenario: Scenario, poles: Array, cause: str) -> None:
    if np.any(poles * scenario.period > _FASTEST):
        k = int(np.argmax(poles))
        raise InputError(
            f"{cause} joint {k + 1} a pole at {poles[k]:.3g} rad/s, expected less than "
            f"{_FASTEST / scenario.period:.3g}"
        )


def _gains(scenario: Scenario, i_eff_max: Array, robot: Robot) -> SpeedGains:
    controller = scenario.controller
    if controller.kp is not None and controller.ki is not None:
        return SpeedGains(kp=np.array(controller.kp), ki=np.array(controller.ki))
    zeta = 1.0 if controller.zeta is None else controller.zeta
    omega_r = (controller.omega_r or 0.0) * robot.frequency_factor
    return tune(i_eff_max, omega_r, zeta, controller.omega_ratio)
