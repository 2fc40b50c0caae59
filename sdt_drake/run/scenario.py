"""A run as data (robot, motion, plant, controller, disturbance), read from and written to YAML."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import GetJsonSchemaHandler
from pydantic_core import CoreSchema

from sdt_drake.io.arguments import a_path, instance_of, takes, whole_periods
from sdt_drake.io.errors import InputError
from sdt_drake.io.fields import (
    EachJoint,
    FileOf,
    Input,
    NotNegative,
    Number,
    Positive,
    Problems,
    Text,
    setting,
)
from sdt_drake.io.names import Schema, given
from sdt_drake.io.shown import Shown, Summary
from sdt_drake.io.trust import trusting
from sdt_drake.io.yaml_files import load_yaml, write_yaml
from sdt_drake.motion import Planner
from sdt_drake.robot.deviation import Deviation
from sdt_drake.robot.device import Drive, Elasticity, Friction
from sdt_drake.robot.dynamics import Sign
from sdt_drake.robot.motors import DeviceChoice
from sdt_drake.robot.robot import DEFAULT_ROBOT
from sdt_drake.run.kinds import CONTROLLERS, OPTIONS, load_controllers
from sdt_drake.systems.gains import FeedforwardKind, Structure

PlantKind = Literal["axis", "coupled"]


@dataclass(frozen=True)
class PlantChoice(Input):
    """The simulated plant: single axes or the whole coupled robot, with all that is not ideal."""

    kind: PlantKind = "axis"
    """"axis": each motor turns a constant inertia against the load torque of the reference, as in
    the paper's models. "coupled": the MultibodyPlant."""
    i_eff: EachJoint[Positive] | None = setting(None, unit="kg m²", side="motor")
    """Inertia that each motor turns on the plant "axis"; by default the largest along the motion.
    The coupled plant takes its inertia from the SDF."""
    friction: Friction = setting(Friction)
    """Friction in the joints; none by default."""
    elasticity: Elasticity = setting(Elasticity)
    """Elasticity of the joints; rigid by default."""
    deviation: Deviation = setting(Deviation)
    """Deviations of the simulated robot from the SDF. Planner and controller do not use them. None
    by default."""

    def problems(self) -> Problems:
        if self.kind == "coupled" and self.i_eff is not None:
            yield "i_eff", "the coupled plant has its inertia from the SDF; remove"


@dataclass(frozen=True)
class ControllerChoice(Input):
    """The controller: kind, gains, feedforward and model."""

    kind: Text = setting("pi", examples=[*CONTROLLERS])
    """Name of a controller: a shipped one, or one that `file` registers."""
    file: Annotated[str, FileOf("controllers")] = ""
    """Python file that registers your own controllers, relative to the scenario's folder. It is run
    once it is trusted. None by default."""
    structure: Structure = "p_in_feedback"
    """Structure of the PI controller: "p_in_feedback" (Figure 5), or "pi" with both gains on the
    error. The kinds "pi_id" and "p_pi" always use "pi"."""
    omega_r: Positive | None = setting(None, unit="rad/s")
    """Lowest natural frequency of the robot's structure, for the SDF without changes. A chosen
    device scales it. The gains are tuned to it."""
    omega_ratio: Positive = setting(0.5, unit="-")
    """Ratio omega_n / omega_r at the largest inertia."""
    zeta: EachJoint[Positive] | None = setting(None, unit="-")
    """Damping ratio at the largest inertia; 1 by default."""
    kp: EachJoint[Positive] | None = setting(None, unit="N m s/rad", side="motor")
    """Proportional gain K_PS. kp and ki replace omega_r, omega_ratio and zeta."""
    ki: EachJoint[Positive] | None = setting(None, unit="N m/rad", side="motor")
    """Integral gain K_IS."""
    anti_windup: bool = False
    """Anti-windup: whether back-calculation limits the integral of the PI controller while
    the motor saturates."""
    feedforward: FeedforwardKind | None = None
    """Torque feedforward of the kinds "p_pi" and "pi_scheduled": "none" (default), "ctc",
    "id"."""
    feedforward_gain: EachJoint[Number] | None = setting(None, unit="-")
    """Factor on the torque feedforward; 1 by default."""
    friction_compensation: bool = False
    """Friction compensation: whether the feedforward includes the plant's friction at the speed of
    the reference."""
    position_gain: EachJoint[Positive] | None = setting(None, unit="1/s")
    """Position gain K_V of the kind "p_pi"; omega_n / 4 by default."""
    model: Deviation = setting(Deviation)
    """Errors of the controller's model of the robot; none by default."""

    @classmethod
    def __get_pydantic_json_schema__(
        cls, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> Schema:
        """Require a file in the JSON Schema for kinds that are not shipped."""
        made = handler(schema)
        own = handler.resolve_ref_schema(made)
        own["if"] = {"required": ["file"]}
        own["else"] = {"properties": {"kind": {"enum": [*CONTROLLERS]}}}
        return made

    def problems(self) -> Problems:
        if self.file:
            load_controllers(self.file)
        if self.kind not in CONTROLLERS:
            yield "kind", f"'{self.kind}', expected one of {', '.join(CONTROLLERS)}"
            return
        yield from self._gain_problems()
        # Options that the chosen kind would not use.
        for option in fields(self):
            takers = [kind for kind, c in CONTROLLERS.items() if option.name in c.options]
            is_option = option.name in OPTIONS and self.kind not in takers
            if is_option and getattr(self, option.name) != option.default:
                yield option.name, f"{self.kind} takes none, only {', '.join(takers)}"
        if self.feedforward_gain is not None and self.feedforward_in_use == "none":
            yield "feedforward_gain", f"{self.kind} has no feedforward"

    def _gain_problems(self) -> Problems:
        if (self.kp is None) != (self.ki is None):
            yield "kp" if self.kp is None else "ki", "missing, expected kp and ki or neither"
        elif self.kp is not None:
            for name, default in (("omega_r", None), ("omega_ratio", 0.5), ("zeta", None)):
                if getattr(self, name) != default:
                    yield name, "kp and ki are given; remove one or the other"

    @property
    def feedforward_in_use(self) -> str:
        """The feedforward in use, one of FEEDFORWARDS: the chosen one, or that of the kind."""
        return self.feedforward or CONTROLLERS[self.kind].feedforward

    @property
    def takes_feedforward(self) -> bool:
        """True if any torque feedforward can be added to the command, as in PI loops."""
        return CONTROLLERS[self.kind].takes_feedforward

    @property
    def structure_in_use(self) -> str:
        """The structure of the PI controller in use: that of the kind, or the chosen one."""
        return CONTROLLERS[self.kind].structure or self.structure

    @property
    def label(self) -> str:
        """Short name of the controller: kind and chosen feedforward, such as "p_pi+id"."""
        chosen = self.feedforward not in (None, "none")
        return f"{self.kind}+{self.feedforward}" if chosen else self.kind


@dataclass(frozen=True)
class DisturbanceChoice(Input):
    """Error of the load torque model: the true load is tau_LD (1 + A sin(omega_d t))."""

    amplitude: Number = setting(0.0, ge=0, le=10, unit="-")
    """Amplitude A as a share of the load torque."""
    omega_d: NotNegative = setting(6.283185307179586, unit="rad/s")
    """Angular frequency of the error, the same on every axis."""


@dataclass(frozen=True, repr=False)
class Scenario(Input, Shown):
    """A run: robot, motion, controller, drive and plant."""

    name: str = ""
    """Short name; the name of the file by default."""
    robot: Annotated[Text, FileOf("robot")] = DEFAULT_ROBOT
    """SDF or URDF file, relative to the scenario's folder, or the name of a shipped robot."""
    device: DeviceChoice = setting(DeviceChoice)
    """Motors, gears and structure that replace those of the SDF."""
    motion: Annotated[Text, FileOf("motion")] = "package://sdt/motions/reference.yaml"
    """Motion profile (.yaml), which is planned, or planned motion (.csv), relative to the
    scenario's folder, or the name of a shipped motion."""
    learned: Annotated[str, FileOf("learned")] = ""
    """CSV file of a learned reference for that motion, written by `sdt-drake learn`. The controller
    tracks it in place of the motion. Errors are still measured against the motion. None by
    default."""
    period: Positive = setting(0.005, unit="s")
    """Interpolation period, used by planner, hold and log."""
    held_speed: Literal["start", "mean"] = "start"
    """Speed of the reference within each period. "start" is the speed at its start, as in the
    paper; it lags by half a period while joints accelerate. "mean" is (q_ref of the next
    sample - q_ref) / period, as in set points of drives. Errors are measured against the motion in
    both cases."""
    torque_margin: Number = setting(1.0, gt=0, le=1, unit="-")
    """Share of the motors' torque limit that the planner may use."""
    planner: Planner = "limiter"
    """"limiter": the paper's planner, which keeps the timing where the limits allow it. "retiming":
    keeps the path and slows down."""
    algorithm: Sign = "consistent"
    """Sign of the third branch of Algorithm 1: "consistent", or "printed" as in the paper, with
    sign(0) = 0."""
    inverse_dynamics: Literal["table", "online"] = "table"
    """"table": load torques are computed before the run. "online": a block computes them."""
    accuracy: Number = setting(0.0001, ge=1e-12, le=0.01, unit="rad/s")
    """Accuracy of simulated speeds. Positions are accurate to a tenth of its value in rad."""
    plant: PlantChoice = setting(PlantChoice)
    """The simulated plant."""
    drive: Drive = setting(Drive)
    """Drives of the motors; ideal by default."""
    controller: ControllerChoice = setting(ControllerChoice)
    """The controller of the plant."""
    disturbance: DisturbanceChoice = setting(DisturbanceChoice)
    """Load torque that is missing in the model; none by default."""

    def problems(self) -> Problems:
        controller, fastest = self.controller, 100 / self.period
        if controller.kp is None and controller.omega_r is None:
            yield "controller.omega_r", "missing, the gains need it, or kp and ki"
        if self.disturbance.omega_d > fastest:  # the integrator would need tiny steps
            yield (
                "disturbance.omega_d",
                f"{self.disturbance.omega_d:g}, expected at most {fastest:g} [rad/s]",
            )
        plants = CONTROLLERS[controller.kind].plants
        if self.plant.kind not in plants:
            yield "controller.kind", f"{controller.kind} needs plant.kind {' or '.join(plants)}"
        if controller.friction_compensation and self.plant.friction.is_none:
            yield "controller.friction_compensation", "needs plant.friction"
        if self.drive.period is not None:
            try:
                whole_periods(self.period, self.drive.period, "")
            except InputError:
                text = f"{self.drive.period:g}, does not divide the interpolation period"
                yield "drive.period", f"{text}, {self.period:g} [s]"

    def summary(self) -> Summary:
        title = f"{self.name}: {self.controller.label} on the {self.plant.kind} plant"
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
