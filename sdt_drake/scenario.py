"""A complete run as data: robot, motion, plant, controller, disturbance; YAML in and out."""

# Drake's YAML loader reads the annotations here: they may not be postponed, and "or None" must be
# spelled Optional[...].
from dataclasses import dataclass, field
from pathlib import Path
from typing import Optional

from pydrake.common.yaml import yaml_dump_typed

from sdt_drake.control import FEEDFORWARDS, STRUCTURES
from sdt_drake.controllers import CONTROLLERS, Controller, load_controllers
from sdt_drake.deviation import Deviation
from sdt_drake.device import DeviceChoice, Drive, Elasticity, Friction
from sdt_drake.dynamics import SIGNS
from sdt_drake.errors import InputError, checked_choice, checked_number, checked_vector, replacing
from sdt_drake.motion import PLANNERS, find_motion
from sdt_drake.robot import DEFAULT_ROBOT
from sdt_drake.yaml_files import check_types, load_yaml

PLANTS = ("axis", "coupled")
INVERSE_DYNAMICS = ("table", "online")


@dataclass
class PlantChoice:
    """What moves.

    Attributes:
        kind: "axis", each motor on its own with constant inertia and the load torque of the
            reference (the paper's models), or "coupled", the MultibodyPlant.
        i_eff: for "axis": inertia of each motor, motor side [kg m²]; by default the largest along
            the motion.
        friction: in the joints; none by default.
        elasticity: of the joints; rigid by default.
        deviation: what the real links have otherwise than the SDF says; planner and controller do
            not know it. Nothing by default.
    """

    kind: str = "axis"
    i_eff: Optional[list[float]] = None  # noqa: UP045
    friction: Optional[Friction] = None  # noqa: UP045
    elasticity: Optional[Elasticity] = None  # noqa: UP045
    deviation: Deviation = field(default_factory=Deviation)


@dataclass
class ControllerChoice:
    """What drives it.

    Attributes:
        kind: one of `sdt_drake.controllers.CONTROLLERS`.
        file: Python file that registers controllers of one's own, which is run; relative to the
            scenario's own folder. None by default.
        structure: of the PI controller: "p_in_feedback" (Figure 5) or "pi", both gains on the
            error. The kinds "pi_id" and "p_pi" always have both gains on the error.
        omega_r: lowest natural frequency of the structure [rad/s], of the SDF as it is; a chosen
            device scales it. The gains follow from it.
        omega_ratio: omega_n / omega_r at the largest inertia [-].
        zeta: damping ratio at the largest inertia [-], for each joint; 1 by default.
        kp, ki: gains, motor side [N m s/rad, N m/rad], instead of omega_r, omega_ratio and zeta.
        anti_windup: whether the integral of the PI controller follows the torque that the motor
            can give (back-calculation).
        feedforward: torque feedforward of the kinds "p_pi" and "pi_scheduled", which leave it open:
            "none" (default), "ctc" or "id".
        feedforward_gain: factor on the torque feedforward of each joint [-]; 1 by default.
        friction_compensation: whether the plant's friction, at the speed of the reference, is part
            of the feedforward.
        position_gain: K_V of the kind "p_pi" [1/s], for each joint; omega_n / 4 by default.
        model: what the controller's model of the robot gets wrong; nothing by default.
    """

    kind: str = "pi"
    file: str = ""
    structure: str = "p_in_feedback"
    omega_r: Optional[float] = None  # noqa: UP045
    omega_ratio: float = 0.5
    zeta: Optional[list[float]] = None  # noqa: UP045
    kp: Optional[list[float]] = None  # noqa: UP045
    ki: Optional[list[float]] = None  # noqa: UP045
    anti_windup: bool = False
    feedforward: Optional[str] = None  # noqa: UP045
    feedforward_gain: Optional[list[float]] = None  # noqa: UP045
    friction_compensation: bool = False
    position_gain: Optional[list[float]] = None  # noqa: UP045
    model: Deviation = field(default_factory=Deviation)

    @property
    def feedforward_in_use(self) -> str:
        """One of FEEDFORWARDS: the chosen one, or that of the kind."""
        return self.feedforward or CONTROLLERS[self.kind].feedforward

    @property
    def structure_in_use(self) -> str:
        """Of the PI controller: that of the kind, or the chosen one."""
        return CONTROLLERS[self.kind].structure or self.structure

    @property
    def label(self) -> str:
        """Short name: the kind, and the feedforward where it was chosen; "p_pi+id"."""
        chosen = self.feedforward not in (None, "none")
        return f"{self.kind}+{self.feedforward}" if chosen else self.kind


@dataclass
class Disturbance:
    """Error of the load torque model: the true load is tau_LD (1 + A sin(omega_d t)).

    Attributes:
        amplitude: A, share of the load torque [-].
        omega_d: [rad/s], on every axis.
    """

    amplitude: float = 0.0
    omega_d: float = 6.283185307179586


@dataclass
class Scenario:
    """A run.

    Attributes:
        name: short name.
        robot: SDF file, relative to the scenario's own folder, or package://sdt/...
        device: motors, gears and structure other than those of the SDF; none by default.
        motion: what is commanded (.yaml, will be planned) or a planned motion (.csv), likewise; or
            the name of a motion that ships with the package.
        period: interpolation period of planner, hold and log [s].
        torque_margin: share of the motors' torque that the planner may use, in (0, 1].
        planner: "limiter", the paper's, which keeps the time where it can, or "retiming", which
            keeps the path and slows down.
        algorithm: sign of Algorithm 1's third branch, "consistent" or "printed".
        inverse_dynamics: "table", load torques computed before the run, or "online", by a block.
        accuracy: of the integrator: speeds are good to it [rad/s], positions to a tenth [rad].
        plant: what moves.
        drive: of the motors; ideal by default.
        controller: what drives it.
        disturbance: what the model does not know.
    """

    name: str = ""
    robot: str = DEFAULT_ROBOT
    device: Optional[DeviceChoice] = None  # noqa: UP045
    motion: str = "package://sdt/motions/reference.yaml"
    period: float = 0.005
    torque_margin: float = 1.0
    planner: str = "limiter"
    algorithm: str = "consistent"
    inverse_dynamics: str = "table"
    accuracy: float = 1e-4
    plant: PlantChoice = field(default_factory=PlantChoice)
    drive: Drive = field(default_factory=Drive)
    controller: ControllerChoice = field(default_factory=ControllerChoice)
    disturbance: Disturbance = field(default_factory=Disturbance)

    def validate(self) -> None:
        """Check all that does not need the robot.

        Raises:
            InputError: naming the field and what would be right.
        """
        check_types(self, Scenario)
        for name in ("robot", "motion"):
            if not getattr(self, name):
                raise InputError(f"{name}: empty, expected a file")
        checked_number(self.period, "period", minimum=0, exclusive=True)
        checked_number(self.torque_margin, "torque_margin", minimum=0, exclusive=True)
        if self.torque_margin > 1:
            raise InputError(f"torque_margin: {self.torque_margin:g}, expected a share in (0, 1]")
        checked_choice(self.planner, tuple(PLANNERS), "planner")
        checked_choice(self.algorithm, SIGNS, "algorithm")
        checked_choice(self.inverse_dynamics, INVERSE_DYNAMICS, "inverse_dynamics")
        check_accuracy(self.accuracy)
        checked_choice(self.plant.kind, PLANTS, "plant.kind")
        if self.controller.file:
            load_controllers(self.controller.file)
        checked_choice(self.controller.kind, tuple(CONTROLLERS), "controller.kind")
        checked_choice(self.controller.structure, STRUCTURES, "controller.structure")
        checked_number(self.disturbance.amplitude, "disturbance.amplitude", minimum=0)
        checked_number(self.disturbance.omega_d, "disturbance.omega_d", minimum=0)
        for name, most, unit in (("amplitude", 10, ""), ("omega_d", 100 / self.period, " rad/s")):
            value = getattr(self.disturbance, name)
            if value > most:  # the integrator would have to follow it
                raise InputError(
                    f"disturbance.{name}: {value:g}{unit}, expected at most {most:g}{unit}"
                )
        if self.plant.kind == "coupled" and self.plant.i_eff is not None:
            raise InputError("plant.i_eff: the coupled plant has its inertia from the SDF; remove")
        if self.plant.friction is not None:
            self.plant.friction.validate("plant.friction")
        if self.plant.elasticity is not None:
            self.plant.elasticity.validate("plant.elasticity")
        if self.device is not None:
            self.device.validate("device")
        self.drive.validate("drive", self.period)
        self.plant.deviation.validate("plant.deviation")
        self.controller.model.validate("controller.model")
        self._validate_gains()
        self._validate_options()

    def _validate_gains(self) -> None:
        controller = self.controller
        given = controller.kp is not None, controller.ki is not None
        if any(given) and not all(given):
            raise InputError("controller: kp and ki must be given together")
        if all(given) and (controller.omega_r is not None or controller.zeta is not None):
            raise InputError("controller: give either kp and ki, or omega_r and zeta")
        if all(given) and controller.omega_ratio != 0.5:
            raise InputError("controller: give either kp and ki, or omega_ratio")
        checked_number(controller.omega_ratio, "controller.omega_ratio", minimum=0, exclusive=True)
        if not any(given) and controller.omega_r is None:
            raise InputError("controller.omega_r: missing; the gains need it, or kp and ki")
        if controller.omega_r is not None:
            checked_number(controller.omega_r, "controller.omega_r", minimum=0, exclusive=True)

    def _validate_options(self) -> None:
        """Refuse what the chosen kind of controller would not use."""
        controller, kind = self.controller, CONTROLLERS[self.controller.kind]
        if self.plant.kind not in kind.plants:
            raise InputError(
                f"controller.kind {controller.kind}: needs plant.kind {' or '.join(kind.plants)}"
            )
        for name in Controller.OPTIONS:
            given = getattr(controller, name) != getattr(ControllerChoice, name)
            if given and name not in kind.options:
                taking = [k for k, c in CONTROLLERS.items() if name in c.options]
                raise InputError(
                    f"controller.{name}: {controller.kind} takes none, only {', '.join(taking)}"
                )
        if controller.feedforward is not None:
            checked_choice(controller.feedforward, FEEDFORWARDS, "controller.feedforward")
        if controller.feedforward_gain is not None and controller.feedforward_in_use == "none":
            raise InputError(f"controller.feedforward_gain: {controller.kind} has no feedforward")
        if controller.friction_compensation and self.plant.friction is None:
            raise InputError("controller.friction_compensation: needs plant.friction")

    def validate_sizes(self, n: int) -> None:
        """Check that every list has one good value for each of the n joints.

        Raises:
            InputError: naming the field.
        """
        for name, values in (
            ("plant.i_eff", self.plant.i_eff),
            ("controller.zeta", self.controller.zeta),
            ("controller.kp", self.controller.kp),
            ("controller.ki", self.controller.ki),
            ("controller.position_gain", self.controller.position_gain),
        ):
            if values is not None:
                checked_vector(values, n, name, positive=True)
        if self.controller.feedforward_gain is not None:
            checked_vector(self.controller.feedforward_gain, n, "controller.feedforward_gain")
        if self.plant.friction is not None:
            self.plant.friction.validate_sizes(n, "plant.friction")
        if self.plant.elasticity is not None:
            self.plant.elasticity.validate_sizes(n, "plant.elasticity")
        if self.device is not None:
            self.device.validate_sizes(n, "device")
        self.drive.validate_sizes(n, "drive")


def check_accuracy(accuracy: float) -> None:
    """Refuse what the integrator cannot reach, and what says nothing.

    Raises:
        InputError: unless it is a number from 1e-12 to 0.01.
    """
    checked_number(accuracy, "accuracy", minimum=1e-12)
    if accuracy > 0.01:
        raise InputError(f"accuracy: {accuracy:g}, expected 1e-12 to 0.01")


def load_scenario(path: str | Path) -> Scenario:
    """A scenario from YAML; relative paths in it start from its folder, and become absolute.

    Raises:
        InputError: naming the file, the field, and what would be right.
    """
    scenario, file = load_yaml(Scenario, path)
    folder = file.resolve().parent
    if scenario.controller.file:
        scenario.controller.file = str(folder / scenario.controller.file)
    try:
        scenario.validate()
        has_shipped_motion = find_motion(scenario.motion) != scenario.motion
    except InputError as error:
        raise InputError(f"{file}: {error}") from None
    for name in ("robot", "motion"):
        value = getattr(scenario, name)
        by_name = name == "motion" and has_shipped_motion
        if not by_name and not value.startswith("package://"):
            setattr(scenario, name, str(folder / value))
    device = scenario.device
    if device is not None and not device.catalogue.startswith("package://"):
        device.catalogue = str(folder / device.catalogue)
    scenario.name = scenario.name or file.stem
    return scenario


def save_scenario(scenario: Scenario, path: str | Path) -> None:
    """Write a scenario as YAML that `load_scenario` reads."""
    text = yaml_dump_typed(scenario, schema=Scenario)
    with replacing(Path(path)) as partial:
        partial.write_text(text, encoding="utf-8")
