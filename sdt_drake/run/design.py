"""A design: a scenario and everything that its loop needs, computed on first use."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from sdt_drake.io.arguments import instance_of, takes
from sdt_drake.io.arrays import Array
from sdt_drake.io.deprecated import renamed
from sdt_drake.io.errors import InputError, within
from sdt_drake.io.fields import check_joints
from sdt_drake.io.shown import Figure, Shown, Summary, higher, of_joints
from sdt_drake.motion import LearnedReference, Motion, Plan, load_plan
from sdt_drake.robot import dynamics
from sdt_drake.robot.deviation import deviated
from sdt_drake.robot.device import Drive, FrictionParameters, Springs, friction_parameters
from sdt_drake.robot.envelope import Envelope
from sdt_drake.robot.lacks import PLANNING
from sdt_drake.robot.motors import as_driven, chosen_robot, motors_in_use
from sdt_drake.robot.robot import Robot
from sdt_drake.robot.windings import Windings, windings_of
from sdt_drake.run import plant
from sdt_drake.run.assumptions import Assumptions
from sdt_drake.run.reference import Reference, drive_on_clock, reference_of
from sdt_drake.run.scenario import Scenario, load_scenario, robot_of
from sdt_drake.run.tuning import Feedforward, Tuning, tuning_of
from sdt_drake.systems.state_space import LinearModel


@dataclass(frozen=True, eq=False)
class Device:
    """The robot as it is planned for, as it is simulated, and as the controller knows it."""

    nominal: Robot
    """Robot of the file with the chosen motors, without deviations. The planner uses it."""
    simulated: Robot
    """Robot with the plant's deviations; `nominal` itself if nothing deviates."""
    model: Robot
    """The controller's model of the robot; `nominal` itself if the model is exact."""

    @staticmethod
    def of(scenario: Scenario, nominal: Robot) -> Device:
        """Return the device of a scenario.

        Raises:
            InputError: naming the deviation that does not fit the robot.
        """
        return Device(
            nominal,
            simulated=deviated(nominal, scenario.plant.deviation, "plant.deviation"),
            model=deviated(nominal, scenario.controller.model, "controller.model"),
        )


@dataclass(frozen=True, eq=False, repr=False)
class Design(Shown):
    """A resolved scenario: device, reference and tuning, and what the plant needs along the motion.

    All of it follows from these inputs and is computed on first use. `dataclasses.replace` with
    another input returns a complete design of it. The inputs are checked when the loop is made.
    """

    scenario: Scenario
    """The scenario that is resolved."""
    nominal: Robot
    """The chosen robot without deviations."""
    planned: Motion
    """The planned motion, feasible for the nominal robot."""
    learned: LearnedReference | None = None
    """A learned reference; by default that of the scenario's file, if it names one."""
    feedforward_override: Feedforward | None = None
    """A torque feedforward that replaces the controller's own; by default the controller's own."""
    assumptions: Assumptions = field(default_factory=Assumptions)
    """Assumptions of an analysis about the device, unlike the scenario."""

    def summary(self) -> Summary:
        tuning = self.tuning
        columns = {
            "I_eff max [kg m²]": (".5g", tuning.inertia.maximum),
            "K_PS [N m s/rad]": (".4g", tuning.gains.kp),
            "K_IS [N m/rad]": (".4g", tuning.gains.ki),
            "omega_n [rad/s]": (".4g", tuning.omega_n),
        }
        title = f"{self.scenario.summary().title}; {tuning.motion.in_time}; motor side"
        if self.envelope is not None:
            title += f"; torque-speed envelope of {self.envelope.source}"
        return of_joints(title, columns, self.nominal.joint_names)

    def plot(self) -> Figure:
        """Return a figure of the effective inertia along the motion, motor side."""
        return self.tuning.plot()

    def linear(self, sample: int = 0, *, at_rest: bool = False) -> LinearModel:
        """Return the closed loop linearised at a sample of the motion; see `sdt_drake.linear`."""
        return higher("analysis.linear:linear")(self, sample, at_rest=at_rest)

    # --- device, reference and tuning ------------------------------------------------------------

    @cached_property
    def device(self) -> Device:
        """The robot: nominal, simulated, and the controller's model."""
        return Device.of(self.scenario, self.nominal)

    @cached_property
    def reference(self) -> Reference:
        """The planned motion, the one that is tracked, and the one that the loop holds."""
        return reference_of(self.scenario, self.nominal, self.planned, self.learned)

    @cached_property
    def tuning(self) -> Tuning:
        """Gains and feedforward of the controller."""
        override = self.feedforward_override
        return tuning_of(self.scenario, self.device.model, self.reference, override)

    # --- what the plant needs along the motion ---------------------------------------------------

    @property
    def loaded(self) -> Robot:
        """Robot of the load torque: the simulated one on axes, the nominal one if coupled."""
        is_axis = self.scenario.plant.kind == "axis"
        return self.device.simulated if is_axis else self.nominal

    @property
    def torques(self) -> dynamics.TorqueGroups:
        """Inverse dynamics of the links of `loaded` along the tracked motion, joint side."""
        return plant.torques_along(self.loaded, self.reference.tracked)

    @cached_property
    def loads(self) -> dynamics.Loads:
        """Loads of each motor by Algorithm 1 with the scenario's sign, motor side."""
        return self.loads_along(self.reference.tracked)

    def loads_along(self, motion: Motion) -> dynamics.Loads:
        """Return the loads of each motor along any motion, as `loads` along the tracked one."""
        torques = plant.torques_along(self.loaded, motion)
        ratio, algorithm = self.nominal.gear_ratio, self.scenario.algorithm
        return dynamics.decouple(torques.inertial, torques.coupled, ratio, algorithm)

    @cached_property
    def inertia(self) -> dynamics.InertiaRange:
        """Range of the effective inertia of `loaded` along the tracked motion, motor side."""
        return dynamics.InertiaRange.of(dynamics.effective_inertia(self.loaded, self.torques.d_kk))

    @property
    def i_eff(self) -> Array:
        """Inertia of the axis process, motor side [kg m²], shape (n,)."""
        own = self.scenario.plant.i_eff
        return self.inertia.maximum if own is None else np.array(own)

    @cached_property
    def springs(self) -> Springs | None:
        """Springs of the joints; None if all joints are rigid."""
        return plant.springs_along(self.scenario, self.nominal, self.reference.tracked)

    @cached_property
    def friction(self) -> FrictionParameters | None:
        """Friction of the joints; None without friction."""
        friction = self.scenario.plant.friction
        return None if friction.is_none else friction_parameters(friction, self.nominal.n)

    @cached_property
    def windings(self) -> Windings | None:
        """Windings of the motors; None if their temperature is not computed."""
        choice = self.scenario.plant.windings
        if choice.coolant is None:
            return None
        try:
            motors = motors_in_use(self.scenario.device, self.nominal.n)
        except InputError as error:
            text = f"{choice.coolant:g}, but {error}"
            raise InputError(text, place="plant.windings.coolant") from None
        return windings_of(motors, choice)

    @property
    def envelope(self) -> Envelope | None:
        """The torque-speed envelope in force, motor side; None without one."""
        return as_driven(self.device.simulated, self.scenario.drive).envelope

    @cached_property
    def drive(self) -> Drive:
        """The scenario's drive on the clock of the loop."""
        return drive_on_clock(self.scenario.drive, self.reference.held)

    @property
    def widens_limits(self) -> bool:
        """True if the alleviating torque widens the motors' limits."""
        widened = self.assumptions.widened
        return self.scenario.plant.kind == "axis" if widened is None else widened

    @property
    def needs_load_torque(self) -> bool:
        """True if the device needs the load torque of the reference, or a disturbance does."""
        is_disturbed = self.scenario.disturbance.amplitude > 0
        return self.assumptions.loaded and (self.scenario.plant.kind == "axis" or is_disturbed)

    # --- variants --------------------------------------------------------------------------------

    def checked(self) -> Design:
        """Check the inputs and return the design itself.

        Raises:
            InputError: if the inputs do not fit each other.
        """
        scenario = self.scenario
        check_joints(scenario, _name(scenario), self.nominal.n)
        with within(_name(scenario)):
            robot, reference = self.device.simulated, self.reference
            _ = self.windings  # each motor has to be in the catalogue
            if reference.torque is not None and scenario.inverse_dynamics != "table":
                raise InputError(
                    "online, expected table, as a learned torque needs", place="inverse_dynamics"
                )
            plant.check_reference(scenario, self.nominal, reference.tracked)
            slowest = self.i_eff if scenario.plant.kind == "axis" else self.inertia.minimum
            plant.check_poles(scenario, robot, self.tuning.gains, slowest, self.springs)
        return self

    def variant(self, scenario: Scenario) -> Design:
        """Return the design of another scenario for the same device, motion and learned reference.

        Raises:
            InputError: if the scenario does not fit them.
        """
        return replace(self, scenario=scenario).checked()

    def assuming(self, **changes: Any) -> Design:
        """Return this design with other `Assumptions`.

        Raises:
            InputError: if a prescribed motion has other samples or joints than the motion.
        """
        assumptions = replace(self.assumptions, **changes)
        return replace(self, assumptions=assumptions.checked(self.planned))

    def given(self, learned: LearnedReference) -> Design:
        """Return this design with a learned reference.

        Raises:
            InputError: if it was learned from another motion, or exceeds a limit.
        """
        return replace(self, learned=learned).checked()

    def with_feedforward(self, tau_ff: Array) -> Design:
        """Return this design with another torque feedforward instead of the controller's own.

        Its steady part is the first sample less the torque for the initial acceleration. That
        torque is taken from the controller's own feedforward, or from the nominal links and motors.

        Args:
            tau_ff: torque at the samples of the motion, motor side [N m], shape (N + 1, n).
        """
        own, motion = self.tuning.feedforward, self.reference.tracked
        if own.along is not None:
            jump = own.along[0] - own.steady
        else:
            links, nominal = plant.torques_along(self.nominal, motion), self.nominal
            motors = nominal.reflected_inertia * motion.vd[0]
            jump = (links.inertial[0] + links.reaction[0] + motors) / nominal.gear_ratio
        return replace(self, feedforward_override=Feedforward(tau_ff, tau_ff[0] - jump))

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            """Return what had this name up to 0.4."""
            if name not in _OLD_NAMES:
                raise AttributeError(f"{type(self).__name__!r} has no attribute {name!r}")
            renamed(f"design.{name}", f"design.{_OLD_NAMES[name]}")
            return attrgetter(_OLD_NAMES[name])(self)


_OLD_NAMES = {
    "robot": "device.simulated",
    "loaded_robot": "loaded",
    "model": "device.model",
    "wanted": "reference.planned",
    "motion": "reference.tracked",
    "learned_torque": "reference.torque",
    "gains": "tuning.gains",
    "omega_n": "tuning.omega_n",
    "omega_r": "tuning.omega_r",
    "inertia_share": "tuning.inertia_share",
    "position_gain": "tuning.position_gain",
    "feedforward": "tuning.feedforward.law",
    "tau_ff": "tuning.feedforward.along",
    "steady_ff": "tuning.feedforward.steady",
    "fed": "feedforward_override",
}
"""Members of a design up to 0.4, and what they are now."""


@takes(
    robot=instance_of(Robot, "sdt_drake.load_robot"),
    motion=instance_of(Motion, "sdt_drake.plan, or a design,"),
    learned=instance_of(LearnedReference, "sdt_drake.learn"),
)
def make_design(
    scenario: Scenario | str | Path,
    *,
    robot: Robot | None = None,
    motion: Motion | None = None,
    learned: LearnedReference | None = None,
) -> Design:
    """Load the robot of a scenario, plan its motion, and check that the loop can be simulated.

    Args:
        scenario: the scenario, or the name or file of one.
        robot: the chosen device without deviations; loaded by default. `scenario.device` is not
            applied to it again.
        motion: the planned motion; planned for `robot` by default.
        learned: a learned reference that replaces that of the scenario.

    Raises:
        InputError: naming file or field of any bad input.

    Examples:
        >>> design = make_design("axis_pi")
        >>> design.tuning.gains.kp.tolist()
        [267.1, 6340.0, 52000.0, 15700.0]
    """
    scenario = load_scenario(scenario) if isinstance(scenario, str | Path) else scenario
    instance_of(Scenario, "sdt_drake.load")(scenario, "scenario")
    robot = robot or load_device(scenario)
    check_joints(scenario, _name(scenario), robot.n)
    if motion is None:
        with within(_name(scenario)):  # before the motion is planned, which takes longer
            deviated(robot, scenario.plant.deviation, "plant.deviation")
            deviated(robot, scenario.controller.model, "controller.model")
        motion = plan_of(scenario, robot).motion
    return Design(scenario, robot, motion, learned).checked()


def as_design(design: Design | Scenario) -> Design:
    """Return a design after a check, or make that of a scenario.

    Raises:
        InputError: for another type, and as `make_design`.
    """
    if isinstance(design, Scenario):
        return make_design(design)
    made_by = "sdt_drake.design, or a Scenario, as sdt_drake.load"
    instance_of(Design, made_by)(design, "design")
    return design.checked()


def tune(design: Design | Scenario) -> dict[str, Array]:
    """Return `design.tuning.numbers`; deprecated, goes in 0.7.

    >>> import sdt_drake as sdt
    >>> sdt.design(sdt.load("axis_pi")).tuning.numbers["ki"].round()  # [N m/rad], motor side
    array([  4640., 107000., 867000., 273000.])

    Raises:
        InputError: if `design` is neither a scenario nor its design, or cannot be resolved.
    """
    renamed("sdt.tune(design)", "design.tuning.numbers")
    return as_design(design).tuning.numbers


# --- device ----------------------------------------------------------------------------------


def load_device(scenario: Scenario) -> Robot:
    """Load the robot of a scenario and apply its choice of motors, gears and structure.

    Raises:
        InputError: if the robot cannot be used, or fields of the scenario do not fit it.
    """
    robot = robot_of(scenario)
    check_joints(scenario, _name(scenario), robot.n)
    with within(_name(scenario)):
        return chosen_robot(robot, scenario.device).having(*PLANNING)


def _name(scenario: Scenario) -> str:
    """Return the scenario's name as error messages show it."""
    return f"scenario '{scenario.name}'" if scenario.name else "scenario"


def plan_of(scenario: Scenario, robot: Robot) -> Plan:
    """Plan the motion that a scenario names.

    Args:
        scenario: gives motion, period, planner and torque margin.
        robot: the chosen device. The drive's torque-speed envelope replaces that of its motors.

    Raises:
        InputError: if the motion cannot be used, or the device cannot follow it.
    """
    return load_plan(
        scenario.motion, as_driven(robot, scenario.drive), period=scenario.period,
        torque_margin=scenario.torque_margin, planner=scenario.planner,
    )  # fmt: skip
