"""A scenario with everything computed that its loop needs."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from sdt_drake.io.arguments import a, takes
from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError, checked_type, within
from sdt_drake.io.fields import check
from sdt_drake.io.shown import Shown, Summary, face, of_joints
from sdt_drake.motion import LearnedReference, Motion, Plan, load_plan
from sdt_drake.robot.deviation import deviated
from sdt_drake.robot.device import Drive, FrictionParameters, Springs, friction_parameters
from sdt_drake.robot.dynamics import (
    InertiaRange,
    Loads,
    TorqueGroups,
    decouple,
    effective_inertia,
)
from sdt_drake.robot.envelope import Envelope
from sdt_drake.robot.motors import as_driven, chosen_robot
from sdt_drake.robot.robot import Robot, load_robot
from sdt_drake.run.plant import (
    check_poles,
    check_reference,
    springs_along,
    steady,
    torques_along,
)
from sdt_drake.run.reference import drive_on_clock, held_reference, taught_reference
from sdt_drake.run.scenario import Scenario
from sdt_drake.run.tuning import Feedforward, FeedforwardLaw, feedforward_of, gains_of, law_along
from sdt_drake.systems.gains import SpeedGains, natural_frequency
from sdt_drake.systems.state_space import LinearModel

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, eq=False, repr=False)
class Design(Shown):
    """A scenario, resolved: its loop follows from these inputs, each part computed on first use.

    `dataclasses.replace` with another input gives a whole design of that; it is checked where its
    loop is made.

    Attributes:
        scenario: what was asked for.
        nominal: the chosen device without deviations, which planner and controller know.
        wanted: the planned motion, feasible for the nominal robot; errors are against it.
        learned: the learned reference; by default that of the scenario's file, if there is one.
        fed: a torque feedforward in place of the controller's own; by default its own.
    """

    scenario: Scenario
    nominal: Robot
    wanted: Motion
    learned: LearnedReference | None = None
    fed: Feedforward | None = None

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

    # --- plant -------------------------------------------------------------------------------

    @cached_property
    def robot(self) -> Robot:
        """The simulated robot: `nominal` with the plant's deviation."""
        return deviated(self.nominal, self.scenario.plant.deviation, "plant.deviation")

    @property
    def loaded_robot(self) -> Robot:
        """The robot whose load torque is that of the loop: on the axis plant the simulated one; on
        the coupled plant, whose load is physical, the nominal one."""
        return self.robot if self.scenario.plant.kind == "axis" else self.nominal

    @property
    def torques(self) -> TorqueGroups:
        """Inverse dynamics of the links of `loaded_robot` along the motion, joint side."""
        return torques_along(self.loaded_robot, self.motion)

    @cached_property
    def loads(self) -> Loads:
        """Loads of each motor by Algorithm 1 with the scenario's sign, motor side."""
        return self._loads(self.torques)

    def steady_load(self, start: Motion) -> Array:
        """Load torque in steady motion at a sample, where a run starts; motor side [N m], (n,)."""
        return self._loads(torques_along(self.loaded_robot, start)).load_torque[0]

    def _loads(self, torques: TorqueGroups) -> Loads:
        ratio, algorithm = self.nominal.gear_ratio, self.scenario.algorithm
        return decouple(torques.inertial, torques.coupled, ratio, algorithm)

    @cached_property
    def inertia(self) -> InertiaRange:
        """Range of the effective inertia along the motion, motor side."""
        return InertiaRange.of(effective_inertia(self.loaded_robot, self.torques.d_kk))

    @property
    def i_eff(self) -> Array:
        """Inertia of the axis process, motor side [kg m²], shape (n,)."""
        own = self.scenario.plant.i_eff
        return self.inertia.maximum if own is None else np.array(own)

    @cached_property
    def springs(self) -> Springs | None:
        """Springs of the joints; None if all are rigid."""
        return springs_along(self.scenario, self.nominal, self.motion)

    @cached_property
    def friction(self) -> FrictionParameters | None:
        """Friction of the joints; None if they have none."""
        friction = self.scenario.plant.friction
        return None if friction.is_none else friction_parameters(friction, self.nominal.n)

    @property
    def envelope(self) -> Envelope | None:
        """The torque-speed envelope in force, motor side; None where nothing gives one."""
        return as_driven(self.robot, self.scenario.drive).envelope

    # --- controller ----------------------------------------------------------------------------

    @property
    def omega_r(self) -> float | None:
        """Lowest natural frequency of the structure of the device [rad/s]; None where the scenario
        gives the gains instead."""
        omega_r = self.scenario.controller.omega_r
        return None if omega_r is None else omega_r * self.nominal.frequency_factor

    @cached_property
    def model(self) -> Robot:
        """The controller's model of the robot; `nominal` itself if the model is exact."""
        return deviated(self.nominal, self.scenario.controller.model, "controller.model")

    @cached_property
    def _modelled_torques(self) -> TorqueGroups:
        """Inverse dynamics of the links of `model` along the motion, joint side."""
        return torques_along(self.model, self.motion)

    @cached_property
    def _largest_inertia(self) -> Array:
        """Largest effective inertia of the model along the motion, motor side [kg m²], (n,)."""
        return effective_inertia(self.model, self._modelled_torques.d_kk.max(axis=0))

    @cached_property
    def gains(self) -> SpeedGains:
        """Gains of the PI speed controllers, motor side; tuned to the model's largest inertia."""
        return gains_of(self.scenario, self._largest_inertia, self.nominal)

    @cached_property
    def omega_n(self) -> Array:
        """Natural frequency of the speed loops at the model's largest inertia [rad/s], (n,)."""
        return natural_frequency(self.gains, self._largest_inertia)

    @cached_property
    def inertia_share(self) -> Array:
        """I_eff of the model along the motion over its largest [-], shape (N + 1, n)."""
        i_eff = effective_inertia(self.model, self._modelled_torques.d_kk)
        return i_eff / self._largest_inertia

    @property
    def position_gain(self) -> Array:
        """K_V of a position loop [1/s], shape (n,)."""
        k_v = self.scenario.controller.position_gain
        return self.omega_n / 4 if k_v is None else np.array(k_v)

    @property
    def feedforward(self) -> FeedforwardLaw | None:
        """Law of the controller's own torque feedforward; None without one."""
        return None if self.fed is not None else feedforward_of(self.scenario, self.model)

    @cached_property
    def tau_ff(self) -> Array | None:
        """All torque feedforward along the motion, motor side [N m], (N + 1, n); None for none."""
        if self.fed is not None:
            return self.fed.along
        law, torque = self.feedforward, self.learned_torque
        if law is None:
            return torque
        own = law_along(law, self._modelled_torques, self.motion)
        return own if torque is None else torque + own

    @cached_property
    def steady_ff(self) -> Array | float:
        """Torque feedforward in steady motion at the first speed, without the learned torque;
        motor side [N m], shape (n,). 0 for none."""
        return self.steady_ff_at(steady(self.motion)) if self.fed is None else self.fed.steady

    def steady_ff_at(self, start: Motion) -> Array | float:
        """The same of the controller's own law, in steady motion at a sample."""
        if self.feedforward is None:
            return 0.0
        return law_along(self.feedforward, torques_along(self.model, start), start)[0]

    @property
    def feeds_load_torque(self) -> bool:
        """Whether the feedforward is just the load torque of the loop (Figure 6)."""
        choice = self.scenario.controller
        has_no_more = choice.feedforward_gain is None and not choice.friction_compensation
        has_no_more &= self.learned_torque is None
        is_ctc = choice.feedforward_in_use == "ctc"
        is_exact = self.feedforward is not None and self.model is self.loaded_robot
        return is_ctc and has_no_more and is_exact

    # --- reference -----------------------------------------------------------------------------

    @cached_property
    def _taught(self) -> LearnedReference:
        """The learned reference in force; the planned motion where nothing was learned."""
        return taught_reference(self.scenario, self.nominal, self.wanted, self.learned)

    @property
    def motion(self) -> Motion:
        """The reference: `wanted` itself, or the learned motion, feasible, too."""
        return self._taught.motion

    @property
    def learned_torque(self) -> Array | None:
        """The learned torque, which is fed forward beside the controller's own; motor side [N m],
        shape (N + 1, n)."""
        return self._taught.torque

    @cached_property
    def reference(self) -> Motion:
        """What the loop holds: the motion, with the speeds that the scenario says, on its clock."""
        return held_reference(self.scenario, self.motion)

    @cached_property
    def drive(self) -> Drive:
        """The drive of the scenario, on the clock of the loop."""
        return drive_on_clock(self.scenario.drive, self.reference)

    # --- other inputs --------------------------------------------------------------------------

    def checked(self) -> Design:
        """Return the design itself.

        Raises:
            InputError: for inputs that do not fit each other.
        """
        scenario = self.scenario
        check(scenario, _name(scenario), self.nominal.n)
        with within(_name(scenario)):
            robot, _ = self.robot, self.model
            if self.learned_torque is not None and scenario.inverse_dynamics != "table":
                raise InputError(
                    "online, but a learned torque needs table", place="inverse_dynamics"
                )
            check_reference(scenario, self.nominal, self.motion)
            slowest = self.i_eff if scenario.plant.kind == "axis" else self.inertia.minimum
            check_poles(scenario, robot, self.gains, slowest, self.springs)
        return self

    def variant(self, scenario: Scenario) -> Design:
        """The design of another scenario with the same device and planned motion.

        Raises:
            InputError: for what does not fit them.
        """
        return Design(scenario, self.nominal, self.wanted).checked()

    def given(self, learned: LearnedReference) -> Design:
        """The same design with what flights have taught.

        Raises:
            InputError: for what was learned of another motion, or is beyond a limit.
        """
        return Design(self.scenario, self.nominal, self.wanted, learned).checked()

    def with_feedforward(self, tau_ff: Array) -> Design:
        """The same design with this torque feedforward instead of the controller's own, motor side
        [N m], shape (N + 1, n).

        What it had been before is taken for the same without what the first acceleration takes: of
        the controller's own, or of the nominal links and motors.
        """
        if self.tau_ff is not None:
            jump = self.tau_ff[0] - self.steady_ff
        else:
            links, nominal = torques_along(self.nominal, self.motion), self.nominal
            motors = nominal.reflected_inertia * self.motion.vd[0]
            jump = (links.inertial[0] + links.reaction[0] + motors) / nominal.gear_ratio
        return replace(self, fed=Feedforward(tau_ff, tau_ff[0] - jump))


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
    learned: LearnedReference | None = None,
) -> Design:
    """Load, plan and tune what a scenario names: device, plan, model, gains, feedforward.

    Args:
        scenario: checked here once more: it may be made or changed in Python.
        robot, motion: of the SDF without any deviation; used instead of loading and planning the
            scenario's own, to save time where many scenarios share them. `robot` is the chosen
            device: `scenario.device` is not applied to it once more.
        learned: in place of that of the scenario.

    Raises:
        InputError: for any bad input on the way.
    """
    checked_type(scenario, Scenario, "scenario", "sdt_drake.load")
    robot = robot or load_device(scenario)
    check(scenario, _name(scenario), robot.n)
    if motion is None:
        with within(_name(scenario)):  # before a motion is planned in vain
            deviated(robot, scenario.plant.deviation, "plant.deviation")
            deviated(robot, scenario.controller.model, "controller.model")
        motion = plan_of(scenario, robot).motion
    return Design(scenario, robot, motion, learned).checked()


def as_design(design: Design | Scenario) -> Design:
    """A design itself, or that of a scenario.

    Raises:
        InputError: for anything else, and for what `make_design` refuses.
    """
    if isinstance(design, Scenario):
        return make_design(design)
    made_by = "sdt_drake.design, or a Scenario, as sdt_drake.load"
    checked_type(design, Design, "design", made_by)
    return design.checked()


# --- device ----------------------------------------------------------------------------------


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
