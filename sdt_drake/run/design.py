"""A scenario with everything computed that its loop needs."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from sdt_drake.io.arguments import a, takes
from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError, checked_type, within
from sdt_drake.io.fields import check
from sdt_drake.io.shown import Shown, Summary, face, of_joints
from sdt_drake.motion import LearnedReference, Motion, Plan, load_learned, load_plan
from sdt_drake.robot.deviation import deviated
from sdt_drake.robot.device import Drive, FrictionParameters, Springs
from sdt_drake.robot.dynamics import (
    InertiaRange,
    Loads,
    TorqueGroups,
    decouple,
    effective_inertia,
    torque_groups,
)
from sdt_drake.robot.envelope import Envelope
from sdt_drake.robot.motors import as_driven, chosen_robot
from sdt_drake.robot.robot import Robot, load_robot
from sdt_drake.run.plant import check_poles, check_reference, plant_along
from sdt_drake.run.scenario import Scenario
from sdt_drake.run.tuning import FeedforwardLaw, fed, feedforward_of, gains_of
from sdt_drake.systems.gains import SpeedGains, natural_frequency

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from sdt_drake.analysis.linear import LinearModel

_BITS = 31  # of a period: 2^22 multiples of it are exact, and it is off by 5e-10 of itself at most


@dataclass(frozen=True, eq=False, repr=False)
class Design(Shown):
    """A scenario, resolved: all that its loop is made of.

    Attributes:
        scenario: what was asked for.
        nominal: the robot as the SDF has it, of which planner and controller know.
        robot: what moves: `nominal` with the deviation of the plant.
        model: what the controller takes the robot for; `nominal` itself if it knows it exactly.
        wanted: the planned motion, feasible for the nominal robot; errors are against it.
        motion: the reference: `wanted` itself, or what flights of it have taught, feasible, too.
        nominal_torques: inverse dynamics of the nominal links along the motion, joint side.
        torques: those of `loaded_robot` along it, joint side.
        model_torques: those of `model` along it, joint side.
        loads: of each motor by Algorithm 1 with the scenario's sign, motor side.
        inertia: range of the effective inertia along the motion, motor side.
        i_eff: inertia of the axis process, motor side [kg m²], shape (n,).
        springs: of the joints, None if all are rigid.
        friction: of the joints, None if they have none.
        gains: of the PI speed controllers, motor side; tuned on the controller's model.
        omega_n: natural frequency of the speed loops at the model's largest inertia [rad/s], (n,).
        inertia_share: I_eff along the motion over its largest, of the model [-], shape (N + 1, n).
        position_gain: K_V of a position loop [1/s], shape (n,).
        feedforward: torque feedforward of the controller; None where it has none, or one that was
            recorded.
        learned_torque: what flights have taught beside it, motor side [N m], shape (N + 1, n).
        tau_ff: all of it along the motion, motor side [N m], shape (N + 1, n); None for none.
        steady_load, steady_ff: load torque and torque feedforward of who has gone on at the first
            speed for long, motor side [N m], shape (n,): where a run starts.
    """

    scenario: Scenario
    nominal: Robot
    robot: Robot
    model: Robot
    wanted: Motion
    motion: Motion
    nominal_torques: TorqueGroups
    torques: TorqueGroups
    model_torques: TorqueGroups
    loads: Loads
    inertia: InertiaRange
    i_eff: Array
    springs: Springs | None
    friction: FrictionParameters | None
    gains: SpeedGains
    omega_n: Array
    inertia_share: Array
    position_gain: Array
    feedforward: FeedforwardLaw | None
    learned_torque: Array | None
    tau_ff: Array | None
    steady_load: Array
    steady_ff: Array | float

    def summary(self) -> Summary:
        columns = {
            "I_eff max [kg m²]": (".5g", self.inertia.maximum),
            "K_PS [N m s/rad]": (".4g", self.gains.kp),
            "K_IS [N m/rad]": (".4g", self.gains.ki),
            "omega_n [rad/s]": (".4g", self.omega_n),
        }
        title = f"{self.scenario.summary().title}; {self.motion.in_time}; motor side"
        if self.envelope is not None:
            title += f"; torque-speed envelope of {self.envelope.source}"
        return of_joints(title, columns, self.robot.joint_names)

    def plot(self) -> Figure:
        """A figure of the effective inertia along the motion, motor side."""
        robot, title = self.robot, f"{self.scenario.name}: effective inertia, motor side"
        i_eff = effective_inertia(robot, self.torques.d_kk)
        return face().plots.effective_inertia(title, self.motion.time, i_eff, robot.joint_names)

    def linear(self, sample: int = 0) -> LinearModel:
        """The closed loop around a sample of the motion, at rest there; see `sdt_drake.linear`."""
        return face().linear(self, sample)

    @property
    def omega_r(self) -> float | None:
        """Lowest natural frequency of the structure of the device [rad/s]; None where the scenario
        gives the gains instead."""
        omega_r = self.scenario.controller.omega_r
        return None if omega_r is None else omega_r * self.nominal.frequency_factor

    @property
    def loaded_robot(self) -> Robot:
        """The robot whose load torque is that of the loop: on the axis plant what moves, as it
        loads the motors there; on the coupled plant, which has its own, the nominal robot."""
        return self.robot if self.scenario.plant.kind == "axis" else self.nominal

    @property
    def feeds_load_torque(self) -> bool:
        """Whether the feedforward is just the load torque of the loop (Figure 6)."""
        choice = self.scenario.controller
        has_no_more = choice.feedforward_gain is None and not choice.friction_compensation
        has_no_more &= self.learned_torque is None
        is_ctc = choice.feedforward_in_use == "ctc"
        is_exact = self.feedforward is not None and self.model is self.loaded_robot
        return is_ctc and has_no_more and is_exact

    @cached_property
    def reference(self) -> Motion:
        """What the loop holds: the motion, with the speeds that the scenario says, on the clock of
        the loop, whose period is that of the motion to 1e-9 of it.

        What samples at multiples of different periods has to meet, to the last bit: of two updates
        at one instant neither sees the other, and one that comes a bit later does. So where the
        drives sample several times per interpolation period, their period is rounded to so few
        bits that all multiples of both are exact.
        """
        motion = self.motion
        if self.scenario.held_speed == "mean":
            mean = np.diff(motion.q, axis=0) / motion.period
            motion = replace(motion, v=np.vstack([mean, motion.v[-1:]]))
        if self._samples == 1:
            return motion
        mantissa, exponent = math.frexp(motion.period / self._samples)
        exact = math.ldexp(round(math.ldexp(mantissa, _BITS)), exponent - _BITS)
        return replace(motion, period=self._samples * exact)

    @cached_property
    def drive(self) -> Drive:
        """The drive of the scenario, on the clock of the loop."""
        drive = self.scenario.drive
        if drive.period is None:
            return drive
        period, delay = self.reference.period / self._samples, drive.reference_delay
        if abs(delay / period - round(delay / period)) < 1e-6:
            delay = round(delay / period) * period
        return replace(drive, period=period, reference_delay=delay)

    @property
    def _samples(self) -> int:
        """Of the drives in an interpolation period."""
        period = self.scenario.drive.period
        return 1 if period is None else round(self.motion.period / period)

    @property
    def envelope(self) -> Envelope | None:
        """The torque-speed envelope in force, motor side; None where nothing gives one."""
        return as_driven(self.robot, self.scenario.drive).envelope

    def variant(self, scenario: Scenario) -> Design:
        """The design of another scenario with the same SDF and planned motion.

        Raises:
            InputError: for what does not fit them.
        """
        known: dict[str, TorqueGroups] = {}
        if self.motion is self.wanted:
            known[self.nominal.sdf] = self.nominal_torques
            known[self.loaded_robot.sdf] = self.torques
            known[self.model.sdf] = self.model_torques
        return _resolved(scenario, _robots(scenario, self.nominal), self.wanted, known)

    def given(self, learned: LearnedReference) -> Design:
        """The same design with what flights have taught.

        Raises:
            InputError: for what was learned of another motion, or is beyond a limit.
        """
        return make_design(self.scenario, robot=self.nominal, motion=self.wanted, learned=learned)

    def with_feedforward(self, tau_ff: Array) -> Design:
        """The same design with this torque feedforward instead of the controller's own, motor side
        [N m], shape (N + 1, n).

        What it had been before is taken for the same without what the first acceleration takes: of
        the controller's own, or of the nominal links and motors.
        """
        if self.tau_ff is not None:
            jump = self.tau_ff[0] - self.steady_ff
        else:
            links = self.nominal_torques.inertial[0] + self.nominal_torques.reaction[0]
            motors = self.nominal.reflected_inertia * self.motion.vd[0]
            jump = (links + motors) / self.nominal.gear_ratio
        return replace(self, feedforward=None, tau_ff=tau_ff, steady_ff=tau_ff[0] - jump)


@takes(
    robot=a(Robot, "sdt_drake.load_robot"),
    motion=a(Motion, "sdt_drake.plan, or a design,"),
    learned=a(LearnedReference, "sdt_drake.learn"),
)
def make_design(
    scenario: Scenario,
    *,
    robot: Robot | None = None,
    motion: Motion | None = None,
    torques: TorqueGroups | None = None,
    learned: LearnedReference | None = None,
) -> Design:
    """Load, plan and tune what a scenario names: device, plan, model, gains, feedforward.

    Args:
        scenario: checked here once more: it may be made or changed in Python.
        robot, motion, torques: of the SDF without any deviation; used instead of loading, planning
            and computing the scenario's own, to save time where many scenarios share them. `robot`
            is the chosen device: `scenario.device` is not applied to it once more. `torques` are
            those along the planned motion, and of no use with a learned reference.
        learned: in place of that of the scenario.

    Raises:
        InputError: for any bad input on the way.
    """
    robots = _robots(scenario, robot)
    wanted = plan_of(scenario, robots[0]).motion if motion is None else motion
    known = {} if torques is None else {robots[0].sdf: torques}
    return _resolved(scenario, robots, wanted, known, learned)


def as_design(design: Design | Scenario) -> Design:
    """A design itself, or that of a scenario.

    Raises:
        InputError: for anything else, and for what `make_design` refuses.
    """
    if isinstance(design, Scenario):
        return make_design(design)
    made_by = "sdt_drake.design, or a Scenario, as sdt_drake.load"
    checked_type(design, Design, "design", made_by)
    return design


def _resolved(
    scenario: Scenario,
    robots: tuple[Robot, Robot, Robot],
    wanted: Motion,
    known: dict[str, TorqueGroups],
    learned: LearnedReference | None = None,
) -> Design:
    """The design of these robots, torques along the planned motion known by SDF of the robot."""
    nominal, robot, model = robots
    with within(_name(scenario)):
        taught = _learned(scenario, nominal, wanted, learned)
        motion, known = taught.motion, known if taught.motion is wanted else {}
        check_reference(scenario, nominal, motion)

        def torques_of(robot: Robot) -> TorqueGroups:
            if robot.sdf not in known:
                known[robot.sdf] = _along(robot, motion)
            return known[robot.sdf]

        loaded = robot if scenario.plant.kind == "axis" else nominal
        torques, modelled = torques_of(loaded), torques_of(model)
        inertia, i_eff, springs, friction = plant_along(
            scenario, motion, (loaded, torques), (nominal, torques_of(nominal))
        )
        i_eff_modelled = effective_inertia(model, modelled.d_kk)
        largest = i_eff_modelled.max(axis=0)
        gains = gains_of(scenario, largest, nominal)
        slowest = i_eff if scenario.plant.kind == "axis" else inertia.minimum
        check_poles(scenario, robot, gains, slowest, springs)
    feedforward = feedforward_of(scenario, model)
    tau_ff = None if feedforward is None else fed(feedforward, modelled, motion)
    if taught.torque is not None:
        tau_ff = taught.torque + (0.0 if tau_ff is None else tau_ff)
    omega_n, k_v = natural_frequency(gains, largest), scenario.controller.position_gain
    steady = Motion(motion.period, motion.q[:1], motion.v[:1], np.zeros_like(motion.v[:1]))
    return Design(
        scenario=scenario,
        nominal=nominal,
        robot=robot,
        model=model,
        wanted=wanted,
        motion=motion,
        nominal_torques=torques_of(nominal),
        torques=torques,
        model_torques=modelled,
        loads=_loads(scenario, robot, torques),
        inertia=inertia,
        i_eff=i_eff,
        springs=springs,
        friction=friction,
        gains=gains,
        omega_n=omega_n,
        inertia_share=i_eff_modelled / largest,
        position_gain=omega_n / 4 if k_v is None else np.array(k_v),
        feedforward=feedforward,
        learned_torque=taught.torque,
        tau_ff=tau_ff,
        steady_load=_loads(scenario, robot, _along(loaded, steady)).load_torque[0],
        steady_ff=0 if feedforward is None else fed(feedforward, _along(model, steady), steady)[0],
    )


# --- device ----------------------------------------------------------------------------------


def _robots(scenario: Scenario, nominal: Robot | None) -> tuple[Robot, Robot, Robot]:
    """The nominal robot, what moves, and what the controller takes it for."""
    checked_type(scenario, Scenario, "scenario", "sdt_drake.load")
    nominal = nominal or load_device(scenario)
    check(scenario, _name(scenario), nominal.n)
    with within(_name(scenario)):
        return (
            nominal,
            deviated(nominal, scenario.plant.deviation, "plant.deviation"),
            deviated(nominal, scenario.controller.model, "controller.model"),
        )


def load_device(scenario: Scenario) -> Robot:
    """The robot that planner, controller and plant of a scenario know.

    Raises:
        InputError: for a robot that cannot be used, or fields of the scenario that do not fit it.
    """
    robot = load_robot(scenario.robot)
    check(scenario, _name(scenario), robot.n)
    with within(_name(scenario)):
        return chosen_robot(robot, scenario.device)


def _name(scenario: Scenario) -> str:
    """For errors."""
    return f"scenario '{scenario.name}'" if scenario.name else "scenario"


def plan_of(scenario: Scenario, robot: Robot) -> Plan:
    """The plan of the motion that a scenario names.

    Args:
        scenario: with period, planner and margin.
        robot: the chosen device, whose motors' envelope a drive with its own replaces.

    Raises:
        InputError: for a motion that cannot be used, or that the device cannot do.
    """
    return load_plan(
        scenario.motion,
        as_driven(robot, scenario.drive),
        period=scenario.period,
        torque_margin=scenario.torque_margin,
        planner=scenario.planner,
    )


def _learned(
    scenario: Scenario, robot: Robot, wanted: Motion, given: LearnedReference | None
) -> LearnedReference:
    """What flights have taught: as given, or else of the scenario's file, if any."""
    margin, robot = scenario.torque_margin, as_driven(robot, scenario.drive)
    if given is not None:
        given.check(wanted, robot, torque_margin=margin)
    elif scenario.learned:
        with within("learned"):
            given = load_learned(scenario.learned, wanted, robot, torque_margin=margin)
    taught = given or LearnedReference(wanted)
    if taught.torque is not None and scenario.inverse_dynamics != "table":
        raise InputError("inverse_dynamics: online, but a learned torque needs table")
    return taught


def _along(robot: Robot, motion: Motion) -> TorqueGroups:
    return torque_groups(robot, motion.q, motion.v, motion.vd)


def _loads(scenario: Scenario, robot: Robot, torques: TorqueGroups) -> Loads:
    return decouple(torques.inertial, torques.coupled, robot.gear_ratio, scenario.algorithm)
