"""A run as data (robot, motion, plant, controller, disturbance), read from and written to YAML."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field

from sdt_drake.io.arguments import a_path, instance_of, takes, whole_periods
from sdt_drake.io.errors import InputError
from sdt_drake.io.fields import (
    EachJoint,
    FileOf,
    Input,
    Integer,
    Names,
    NotNegative,
    Number,
    Positive,
    Problems,
    Text,
    field,
)
from sdt_drake.io.names import given
from sdt_drake.io.shown import Shown, Summary
from sdt_drake.io.trust import trusting
from sdt_drake.io.yaml_files import load_yaml, write_yaml
from sdt_drake.motion import Planner
from sdt_drake.robot.deviation import Deviation
from sdt_drake.robot.device import Drive, Elasticity, Friction
from sdt_drake.robot.dynamics import Sign
from sdt_drake.robot.motors import DeviceChoice
from sdt_drake.robot.robot import DEFAULT_ROBOT, Robot, load_robot
from sdt_drake.robot.stops import Stops
from sdt_drake.robot.windings import WindingChoice
from sdt_drake.run.choice import OfKind, plain_pi
from sdt_drake.run.options import ControllerOptions, in_print
from sdt_drake.run.simulation import SimulationChoice

PlantKind = Literal["axis", "coupled"]


@dataclass(frozen=True)
class PlantChoice(Input):
    """The simulated plant: single axes or the whole coupled robot, with all that is not ideal."""

    kind: PlantKind = "axis"
    """"axis": each motor turns a constant inertia against the load torque of the reference, as in
    the paper's models. "coupled": the MultibodyPlant."""
    i_eff: EachJoint[Positive] | None = field(None, unit="kg m²", side="motor")
    """Inertia that each motor turns on the plant "axis"; by default the largest along the motion.
    The coupled plant takes its inertia from the SDF."""
    friction: Friction = field(Friction)
    """Friction in the joints; none by default."""
    elasticity: Elasticity = field(Elasticity)
    """Elasticity of the joints; rigid by default."""
    gear_efficiency: EachJoint[Annotated[Number, Field(gt=0, le=1)]] | None = field(None, unit="-")
    """Share of the power that a gear transmits, in both directions; 1 by default. At rest a gear
    loses nothing."""
    stops: Stops = field(Stops)
    """Stops of the joints that push back; without them a run only says where it passes a stop."""
    windings: WindingChoice = field(WindingChoice)
    """Temperature of the motors' windings; not computed by default."""
    deviation: Deviation = field(Deviation)
    """Deviations of the simulated robot from the SDF. Planner and controller do not use them. None
    by default."""

    def problems(self) -> Problems:
        if self.kind == "coupled" and self.i_eff is not None:
            yield "i_eff", "the coupled plant has its inertia from the SDF; remove"
        if self.kind == "axis" and not self.stops.is_none:
            yield "stops", "the axis plant has none; remove, or set kind coupled"


@dataclass(frozen=True)
class DisturbanceChoice(Input):
    """Error of the load torque model: the true load is tau_LD (1 + A sin(omega_d t))."""

    amplitude: Number = field(0.0, ge=0, le=10, unit="-")
    """Amplitude A as a share of the load torque."""
    omega_d: NotNegative = field(6.283185307179586, unit="rad/s")
    """Angular frequency of the error, the same on every axis."""


@dataclass(frozen=True)
class PilotChoice(Input):
    """The pilot in the loop: sensors at the head, and the observer behind them; none by default."""

    model: Annotated[str, FileOf("perception model")] = ""
    """Perception model of the observer: a file, or the name of a shipped one. None by default."""
    force_noise: NotNegative = field(0.0, unit="m/s²")
    """Standard deviation of the noise of the head's specific force, drawn at each sample."""
    rate_noise: NotNegative = field(0.0, unit="rad/s")
    """Standard deviation of the noise of the head's angular rate, drawn at each sample."""
    seed: Integer = field(0, ge=0, le=2**32 - 1, unit="-")
    """Seed of the noise."""


@dataclass(frozen=True, repr=False)
class Scenario(Input, Shown):
    """A run: robot, motion, controller, drive and plant."""

    name: str = ""
    """Short name; the name of the file by default."""
    robot: Annotated[Text, FileOf("robot")] = DEFAULT_ROBOT
    """SDF or URDF file, relative to the scenario's folder, or the name of a shipped robot."""
    hold: Names = field(())
    """Joints of the robot that are held, with their links as load, such as those of a gripper: each
    by its name, with its position [rad, m] if it is not 0: finger=0.02. None by default."""
    tip: str = ""
    """Link that ends the chain; all joints beside and beyond it are held. By default the robot must
    be one chain."""
    device: DeviceChoice = field(DeviceChoice)
    """Motors, gears and structure that replace those of the SDF."""
    motion: Annotated[Text, FileOf("motion")] = "package://sdt/motions/reference.yaml"
    """Motion profile (.yaml), which is planned, or planned motion (.csv), relative to the
    scenario's folder, or the name of a shipped motion."""
    learned: Annotated[str, FileOf("learned")] = ""
    """CSV file of a learned reference for that motion, written by `sdt-drake learn`. The controller
    tracks it in place of the motion. Errors are still measured against the motion. None by
    default."""
    period: Positive = field(0.005, unit="s")
    """Interpolation period, used by planner, hold and log."""
    held_speed: Literal["start", "mean"] = "start"
    """Speed of the reference within each period. "start" is the speed at its start, as in the
    paper; it lags by half a period while joints accelerate. "mean" is (q_ref of the next
    sample - q_ref) / period, as in set points of drives. Errors are measured against the motion in
    both cases."""
    torque_margin: Number = field(1.0, gt=0, le=1, unit="-")
    """Share of the motors' torque limit that the planner may use."""
    planner: Planner = "limiter"
    """"limiter": the paper's planner, which keeps the timing where the limits allow it. "retiming":
    keeps the path and slows down."""
    algorithm: Sign = "consistent"
    """Sign of the third branch of Algorithm 1: "consistent", or "printed" as in the paper, with
    sign(0) = 0."""
    inverse_dynamics: Literal["table", "online"] = "table"
    """"table": load torques are computed before the run. "online": a block computes them."""
    accuracy: Number = field(0.0001, ge=1e-12, le=0.01, unit="rad/s")
    """Accuracy of simulated speeds. Positions are accurate to a tenth of its value in rad."""
    simulation: SimulationChoice = field(SimulationChoice)
    """The integrator of a run."""
    plant: PlantChoice = field(PlantChoice)
    """The simulated plant."""
    drive: Drive = field(Drive)
    """Drives of the motors; ideal by default."""
    controller: Annotated[ControllerOptions, OfKind()] = field(plain_pi)
    """The controller of the plant."""
    disturbance: DisturbanceChoice = field(DisturbanceChoice)
    """Load torque that is missing in the model; none by default."""
    pilot: PilotChoice = field(PilotChoice)
    """The pilot in the loop; none by default."""
    probes: Names = field(())
    """Outputs of blocks that `simulate` records, too: paths, or their ends, such as tau_fb or
    device.friction.friction. `sdt-drake diagram SCENARIO --ports` lists them. None by default."""

    def complete(self) -> None:
        own, default = self.simulation, type(self).accuracy
        if own.accuracy is not None and self.accuracy in (default, own.accuracy):
            vars(self).update(accuracy=own.accuracy, simulation=replace(own, accuracy=None))

    def problems(self) -> Problems:
        if self.simulation.accuracy is not None:
            text = f"{self.simulation.accuracy:g}, but accuracy is {self.accuracy:g}"
            yield "simulation.accuracy", f"{text}; expected one of them"
        controller, fastest = self.controller, 100 / self.period
        if controller.kp is None and controller.omega_r is None:
            yield "controller.omega_r", "missing, the gains need it, or kp and ki"
        if self.disturbance.omega_d > fastest:  # the integrator would need tiny steps
            yield (
                "disturbance.omega_d",
                f"{self.disturbance.omega_d:g}, expected at most {fastest:g} [rad/s]",
            )
        if self.plant.kind not in controller.plants:
            plants = " or ".join(controller.plants)
            yield "controller.kind", f"{controller.kind} needs plant.kind {plants}"
        if self.pilot.model and self.plant.kind != "coupled":
            yield "pilot.model", "needs plant.kind coupled, which moves the head"
        if controller.friction_compensation and self.plant.friction.is_none:
            yield "controller.friction_compensation", "needs plant.friction"
        filters = getattr(controller, "filters", None)
        for name, values in (filters.frequencies if filters else {}).items():
            nyquist = 0.5 / (self.drive.period or 1e-9)
            if max(values) >= nyquist:
                text = f"{max(values):g} Hz, expected less than half the rate of the drives"
                yield f"controller.filters.{name}", f"{text}, {nyquist:g} Hz"
        if self.drive.period is not None:
            try:
                whole_periods(self.period, self.drive.period, "")
            except InputError:
                text = f"{self.drive.period:g}, does not divide the interpolation period"
                yield "drive.period", f"{text}, {self.period:g} [s]"

    def summary(self) -> Summary:
        title = f"{self.name}: {in_print(self.controller.label)} on the {self.plant.kind} plant"
        values = ((name, x) for name, x in given(self) if name != "name")
        rows = [(name, f"{[*x] if isinstance(x, tuple) else x}") for name, x in values]
        return Summary(title, ("field", "value"), rows)


@takes(path=a_path)
def load_scenario(
    path: str | Path, changes: Mapping[str, Any] | None = None, *, trust: bool = False
) -> Scenario:
    """Load a scenario from YAML by file or short name.

    Relative paths in the file start from its folder and become absolute. `changed` of a scenario
    returns a copy with other values, by the same names.

    Args:
        path: YAML file, or short name of a shipped scenario.
        changes: values of fields by dotted names, which replace those of the file or are added:
            {"controller.kind": "p_pi", "controller.zeta[2]": 0.9}. Relative paths in them start
            from the working directory.
        trust: whether to run the Python file that `controller.file` names without asking.

    Raises:
        InputError: with a line for each problem: file, field, what was found, what is accepted.

    Examples:
        >>> from sdt_drake.run.scenario import load_scenario
        >>> load_scenario("coupled_pi", {"controller.kind": "p_pi"}).controller.label
        'p_pi'
    """
    with trusting(trust):
        return load_yaml(Scenario, path, "scenario", changes)[0]


@takes(scenario=instance_of(Scenario, "sdt_drake.load"), path=a_path)
def save_scenario(scenario: Scenario, path: str | Path) -> None:
    """Write a scenario as YAML that `load_scenario` reads.

    Raises:
        InputError: if `scenario` is no scenario, or the file cannot be written.

    Examples:
        >>> save_scenario(load_scenario("axis_pi", {"period": 0.002}), "mine.yaml")
        >>> load_scenario("mine.yaml").period
        0.002
    """
    write_yaml(path, scenario)


def robot_of(scenario: Scenario) -> Robot:
    """Load the robot of a scenario, with the joints that it holds, without its device.

    Raises:
        InputError: if the robot cannot be used.
    """
    return load_robot(scenario.robot, hold=scenario.hold or "", tip=scenario.tip)
