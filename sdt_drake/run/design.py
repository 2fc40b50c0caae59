"""A design: a scenario and everything that its loop needs, computed on first use."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from sdt_drake.io.arguments import instance_of, takes
from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError, within
from sdt_drake.io.fields import check_joints
from sdt_drake.io.shown import Shown, Summary, higher, of_joints
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
from sdt_drake.run.assumptions import Assumptions
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
    """A resolved scenario. Everything else follows from these inputs and is computed on first use.

    `dataclasses.replace` with another input returns a complete design of it. The inputs are checked
    when the loop is made.
    """

    scenario: Scenario
    """The scenario that is resolved."""
    nominal: Robot
    """The chosen device without deviations; planner and controller use it."""
    wanted: Motion
    """The planned motion, feasible for the nominal robot. Errors are measured against it."""
    learned: LearnedReference | None = None
    """A learned reference; by default that of the scenario's file, if it names one."""
    fed: Feedforward | None = None
    """A torque feedforward that replaces the controller's own; by default the controller's own."""
    assumptions: Assumptions = field(default_factory=Assumptions)
    """Assumptions of an analysis about the device, unlike the scenario."""

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
        """Return a figure of the effective inertia along the motion, motor side."""
        robot, title = self.robot, f"{self.scenario.name}: effective inertia, motor side"
        i_eff = effective_inertia(robot, self.torques.d_kk)
        draw = higher("show.figures.runs:effective_inertia")
        return draw(title, self.motion.time, i_eff, robot.joint_names)

    def linear(self, sample: int = 0) -> LinearModel:
        """Return the closed loop linearised at rest at a sample; see `sdt_drake.linear`."""
        return higher("analysis.linear:linear")(self, sample)

    # --- plant -------------------------------------------------------------------------------

    @cached_property
    def robot(self) -> Robot:
        """The simulated robot: `nominal` with the plant's deviations."""
        return deviated(self.nominal, self.scenario.plant.deviation, "plant.deviation")

    @property
    def loaded_robot(self) -> Robot:
        """Robot of the load torque: the simulated one on axes, the nominal one if coupled."""
        return self.robot if self.scenario.plant.kind == "axis" else self.nominal

    @property
    def torques(self) -> TorqueGroups:
        """Inverse dynamics of the links of `loaded_robot` along the reference, joint side."""
        return torques_along(self.loaded_robot, self.motion)

    @cached_property
    def loads(self) -> Loads:
        """Loads of each motor by Algorithm 1 with the scenario's sign, motor side."""
        return self.loads_along(self.motion)

    def loads_along(self, motion: Motion) -> Loads:
        """Return the loads of each motor along any motion, as `loads` along the reference."""
        torques = torques_along(self.loaded_robot, motion)
        ratio, algorithm = self.nominal.gear_ratio, self.scenario.algorithm
        return decouple(torques.inertial, torques.coupled, ratio, algorithm)

    @cached_property
    def inertia(self) -> InertiaRange:
        """Range of the effective inertia along the reference, motor side."""
        return InertiaRange.of(effective_inertia(self.loaded_robot, self.torques.d_kk))

    @property
    def i_eff(self) -> Array:
        """Inertia of the axis process, motor side [kg m²], shape (n,)."""
        own = self.scenario.plant.i_eff
        return self.inertia.maximum if own is None else np.array(own)

    @cached_property
    def springs(self) -> Springs | None:
        """Springs of the joints; None if all joints are rigid."""
        return springs_along(self.scenario, self.nominal, self.motion)

    @cached_property
    def friction(self) -> FrictionParameters | None:
        """Friction of the joints; None without friction."""
        friction = self.scenario.plant.friction
        return None if friction.is_none else friction_parameters(friction, self.nominal.n)

    @property
    def envelope(self) -> Envelope | None:
        """The torque-speed envelope in force, motor side; None without one."""
        return as_driven(self.robot, self.scenario.drive).envelope

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

    # --- controller ----------------------------------------------------------------------------

    @property
    def omega_r(self) -> float | None:
        """Lowest natural frequency of the device's structure [rad/s]; None if gains are given."""
        omega_r = self.scenario.controller.omega_r
        return None if omega_r is None else omega_r * self.nominal.frequency_factor

    @cached_property
    def model(self) -> Robot:
        """The controller's model of the robot; `nominal` itself if the model is exact."""
        return deviated(self.nominal, self.scenario.controller.model, "controller.model")

    @cached_property
    def _modelled_torques(self) -> TorqueGroups:
        """Inverse dynamics of the links of `model` along the reference, joint side."""
        return torques_along(self.model, self.motion)

    @cached_property
    def _largest_inertia(self) -> Array:
        """Largest effective inertia of `model` along the reference, motor side [kg m²], (n,)."""
        return effective_inertia(self.model, self._modelled_torques.d_kk.max(axis=0))

    @cached_property
    def gains(self) -> SpeedGains:
        """Gains of the PI speed controllers, motor side, tuned to the model's largest inertia."""
        return gains_of(self.scenario, self._largest_inertia, self.nominal)

    @cached_property
    def omega_n(self) -> Array:
        """Natural frequency of the speed loops at the model's largest inertia [rad/s], (n,)."""
        return natural_frequency(self.gains, self._largest_inertia)

    @cached_property
    def inertia_share(self) -> Array:
        """I_eff of the model over its largest value along the reference [-], shape (N + 1, n)."""
        i_eff = effective_inertia(self.model, self._modelled_torques.d_kk)
        return i_eff / self._largest_inertia

    @property
    def position_gain(self) -> Array:
        """K_V of the position loops [1/s], shape (n,)."""
        k_v = getattr(self.scenario.controller, "position_gain", None)
        return self.omega_n / 4 if k_v is None else np.array(k_v)

    @property
    def feedforward(self) -> FeedforwardLaw | None:
        """Law of the controller's own torque feedforward; None without one or if it is replaced."""
        return None if self.fed is not None else feedforward_of(self.scenario, self.model)

    @cached_property
    def tau_ff(self) -> Array | None:
        """Total torque feedforward, motor side [N m], shape (N + 1, n); None without one."""
        if self.fed is not None:
            return self.fed.along
        law, torque = self.feedforward, self.learned_torque
        if law is None:
            return torque
        own = law_along(law, self._modelled_torques, self.motion)
        return own if torque is None else torque + own

    @cached_property
    def steady_ff(self) -> Array | float:
        """Feedforward in steady motion at the initial speed, without learned torque [N m], (n,)."""
        return self.steady_ff_at(steady(self.motion)) if self.fed is None else self.fed.steady

    def steady_ff_at(self, start: Motion) -> Array | float:
        """Return the controller's own feedforward in steady motion at a sample [N m], (n,)."""
        if self.feedforward is None:
            return 0.0
        return law_along(self.feedforward, torques_along(self.model, start), start)[0]

    @property
    def feeds_load_torque(self) -> bool:
        """True if the feedforward is exactly the load torque of the loop (Figure 6)."""
        choice = self.scenario.controller
        has_no_more = choice.feedforward_gain is None and not choice.friction_compensation
        has_no_more &= self.learned_torque is None
        is_ctc = choice.feedforward_in_use == "ctc"
        is_exact = self.feedforward is not None and self.model is self.loaded_robot
        return is_ctc and has_no_more and is_exact

    # --- reference -----------------------------------------------------------------------------

    @cached_property
    def _taught(self) -> LearnedReference:
        """The learned reference in force; the planned motion if nothing was learned."""
        return taught_reference(self.scenario, self.nominal, self.wanted, self.learned)

    @property
    def motion(self) -> Motion:
        """The reference: the planned motion, or the learned one, which is feasible, too."""
        return self._taught.motion

    @property
    def learned_torque(self) -> Array | None:
        """Learned torque, added to the feedforward; motor side [N m], shape (N + 1, n)."""
        return self._taught.torque

    @cached_property
    def reference(self) -> Motion:
        """The motion that the loop holds: `motion` with the held speeds, on the loop's clock."""
        return held_reference(self.scenario, self.motion)

    @cached_property
    def drive(self) -> Drive:
        """The scenario's drive on the clock of the loop."""
        return drive_on_clock(self.scenario.drive, self.reference)

    # --- other inputs --------------------------------------------------------------------------

    def checked(self) -> Design:
        """Check the inputs and return the design itself.

        Raises:
            InputError: if the inputs do not fit each other.
        """
        scenario = self.scenario
        check_joints(scenario, _name(scenario), self.nominal.n)
        with within(_name(scenario)):
            robot, _ = self.robot, self.model
            if self.learned_torque is not None and scenario.inverse_dynamics != "table":
                raise InputError(
                    "online, expected table, as a learned torque needs", place="inverse_dynamics"
                )
            check_reference(scenario, self.nominal, self.motion)
            slowest = self.i_eff if scenario.plant.kind == "axis" else self.inertia.minimum
            check_poles(scenario, robot, self.gains, slowest, self.springs)
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
        return replace(self, assumptions=assumptions.checked(self.motion))

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
        if self.tau_ff is not None:
            jump = self.tau_ff[0] - self.steady_ff
        else:
            links, nominal = torques_along(self.nominal, self.motion), self.nominal
            motors = nominal.reflected_inertia * self.motion.vd[0]
            jump = (links.inertial[0] + links.reaction[0] + motors) / nominal.gear_ratio
        return replace(self, fed=Feedforward(tau_ff, tau_ff[0] - jump))


@takes(
    robot=instance_of(Robot, "sdt_drake.load_robot"),
    motion=instance_of(Motion, "sdt_drake.plan, or a design,"),
    learned=instance_of(LearnedReference, "sdt_drake.learn"),
)
def make_design(
    scenario: Scenario,
    *,
    robot: Robot | None = None,
    motion: Motion | None = None,
    learned: LearnedReference | None = None,
) -> Design:
    """Load the robot of a scenario, plan its motion, and check that the loop can be simulated.

    Args:
        scenario: the scenario.
        robot: the chosen device without deviations; loaded by default. `scenario.device` is not
            applied to it again.
        motion: the planned motion; planned for `robot` by default.
        learned: a learned reference that replaces that of the scenario.

    Raises:
        InputError: naming file or field of any bad input.

    Examples:
        >>> from sdt_drake.run.scenario import load_scenario
        >>> design = make_design(load_scenario("axis_pi", {"motion": "leans"}))
        >>> design.gains.kp.tolist()
        [267.1, 6340.0, 52000.0, 15700.0]
    """
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


# --- device ----------------------------------------------------------------------------------


def load_device(scenario: Scenario) -> Robot:
    """Load the robot of a scenario and apply its choice of motors, gears and structure.

    Raises:
        InputError: if the robot cannot be used, or fields of the scenario do not fit it.
    """
    robot = load_robot(scenario.robot)
    check_joints(scenario, _name(scenario), robot.n)
    with within(_name(scenario)):
        return chosen_robot(robot, scenario.device)


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
        scenario.motion,
        as_driven(robot, scenario.drive),
        period=scenario.period,
        torque_margin=scenario.torque_margin,
        planner=scenario.planner,
    )
