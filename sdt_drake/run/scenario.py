"""A complete run as data: robot, motion, plant, controller, disturbance; YAML in and out."""

import copy
import functools
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Annotated, Any

from pydantic import GetJsonSchemaHandler
from pydantic_core import CoreSchema

from sdt_drake.io.arguments import a, a_path, takes
from sdt_drake.io.errors import InputError, one_line, whole_periods
from sdt_drake.io.fields import (
    EachJoint,
    FileOf,
    Input,
    NotNegative,
    Number,
    OneOf,
    Positive,
    Problems,
    Text,
    given,
    setting,
)
from sdt_drake.io.schema import Schema
from sdt_drake.io.shown import Shown, Summary
from sdt_drake.io.trust import trusting
from sdt_drake.io.yaml_files import load_yaml, write_yaml
from sdt_drake.motion import PLANNERS
from sdt_drake.robot.deviation import Deviation
from sdt_drake.robot.device import Drive, Elasticity, Friction
from sdt_drake.robot.dynamics import SIGNS
from sdt_drake.robot.motors import DeviceChoice
from sdt_drake.robot.robot import DEFAULT_ROBOT
from sdt_drake.run.kinds import CONTROLLERS, OPTIONS, load_controllers
from sdt_drake.systems.gains import FEEDFORWARDS, STRUCTURES

PLANTS = ("axis", "coupled")
INVERSE_DYNAMICS = ("table", "online")
HELD_SPEEDS = ("start", "mean")


@dataclass
class PlantChoice(Input):
    """What moves: axes on their own, or the whole coupled robot, with what is not ideal of them."""

    kind: Annotated[str, OneOf(PLANTS)] = "axis"
    """"axis", each motor on its own with constant inertia and the load torque of the reference
    (the paper's models), or "coupled", the MultibodyPlant."""
    i_eff: EachJoint[Positive] | None = setting(None, unit="kg m²", side="motor")
    """For "axis": inertia that each motor turns; by default the largest along the motion. The
    coupled plant has its own from the SDF."""
    friction: Friction = setting(Friction)
    """In the joints; none by default."""
    elasticity: Elasticity = setting(Elasticity)
    """Of the joints, which are rigid by default."""
    deviation: Deviation = setting(Deviation)
    """What the real links have otherwise than the SDF says; planner and controller do not know
    it. Nothing by default."""

    def problems(self) -> Problems:
        if self.kind == "coupled" and self.i_eff is not None:
            yield "i_eff", "the coupled plant has its inertia from the SDF; remove"


@dataclass
class ControllerChoice(Input):
    """What drives the plant: kind, gains, feedforward and model of the controller."""

    kind: Text = setting("pi", examples=[*CONTROLLERS])
    """Name of a controller; one of the package, or one that `file` registers."""
    file: Annotated[str, FileOf("controllers")] = ""
    """Python file that registers controllers of one's own, which is run once it is trusted;
    relative to the scenario's own folder. None by default."""
    structure: Annotated[str, OneOf(STRUCTURES)] = "p_in_feedback"
    """Of the PI controller: "p_in_feedback" (Figure 5) or "pi", both gains on the error. The
    kinds "pi_id" and "p_pi" always have both gains on the error."""
    omega_r: Positive | None = setting(None, unit="rad/s")
    """Lowest natural frequency of the structure, of the SDF as it is; a chosen device scales
    it. The gains follow from it."""
    omega_ratio: Positive = setting(0.5, unit="-")
    """omega_n / omega_r at the largest inertia."""
    zeta: EachJoint[Positive] | None = setting(None, unit="-")
    """Damping ratio at the largest inertia; 1 by default."""
    kp: EachJoint[Positive] | None = setting(None, unit="N m s/rad", side="motor")
    """Proportional gain K_PS; with ki instead of omega_r, omega_ratio and zeta."""
    ki: EachJoint[Positive] | None = setting(None, unit="N m/rad", side="motor")
    """Integral gain K_IS."""
    anti_windup: bool = False
    """Whether the integral of the PI controller follows the torque that the motor can give
    (back-calculation)."""
    feedforward: Annotated[str, OneOf(FEEDFORWARDS)] | None = None
    """Torque feedforward of the kinds "p_pi" and "pi_scheduled", which leave it open: "none"
    (default), "ctc" or "id"."""
    feedforward_gain: EachJoint[Number] | None = setting(None, unit="-")
    """Factor on the torque feedforward; 1 by default."""
    friction_compensation: bool = False
    """Whether the plant's friction, at the speed of the reference, is part of the feedforward."""
    position_gain: EachJoint[Positive] | None = setting(None, unit="1/s")
    """K_V of the kind "p_pi"; omega_n / 4 by default."""
    model: Deviation = setting(Deviation)
    """What the controller's model of the robot gets wrong; nothing by default."""

    @classmethod
    def __get_pydantic_json_schema__(
        cls, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> Schema:
        """State in the JSON Schema that other kinds than the package's need a file."""
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
        # What the chosen kind of controller would not use.
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
        elif self.kp is None and self.omega_r is None:
            yield "omega_r", "missing, the gains need it, or kp and ki"
        elif self.kp is not None:
            for name, default in (("omega_r", None), ("omega_ratio", 0.5), ("zeta", None)):
                if getattr(self, name) != default:
                    yield name, "kp and ki are given; remove one or the other"

    @property
    def feedforward_in_use(self) -> str:
        """The feedforward, one of FEEDFORWARDS: the chosen one, or that of the kind."""
        return self.feedforward or CONTROLLERS[self.kind].feedforward

    @property
    def takes_feedforward(self) -> bool:
        """Whether it has a place for any torque feedforward, as PI loops have."""
        return CONTROLLERS[self.kind].takes_feedforward

    @property
    def structure_in_use(self) -> str:
        """The structure of the PI controller: that of the kind, or the chosen one."""
        return CONTROLLERS[self.kind].structure or self.structure

    @property
    def label(self) -> str:
        """Short name of the controller: the kind, and the feedforward where it was chosen;
        "p_pi+id"."""
        chosen = self.feedforward not in (None, "none")
        return f"{self.kind}+{self.feedforward}" if chosen else self.kind


@dataclass
class DisturbanceChoice(Input):
    """Error of the load torque model: the true load is tau_LD (1 + A sin(omega_d t))."""

    amplitude: Number = setting(0.0, ge=0, le=10, unit="-")
    """A, share of the load torque."""
    omega_d: NotNegative = setting(6.283185307179586, unit="rad/s")
    """Frequency of the error, the same on every axis."""


@dataclass(repr=False)
class Scenario(Input, Shown):
    """A run: robot, motion, controller, drive and plant."""

    name: str = ""
    """Short name; that of the file by default."""
    robot: Annotated[Text, FileOf("robot")] = DEFAULT_ROBOT
    """SDF or URDF file, relative to the scenario's own folder; or the name of one that ships
    with the package."""
    device: DeviceChoice = setting(DeviceChoice)
    """Motors, gears and structure other than those of the SDF."""
    motion: Annotated[Text, FileOf("motion")] = "package://sdt/motions/reference.yaml"
    """What is commanded (.yaml, will be planned) or a planned motion (.csv), likewise."""
    learned: Annotated[str, FileOf("learned")] = ""
    """CSV file of what flights of that motion have taught (`sdt-drake learn`): the reference
    that the controller gets in its place. Errors are still those against the motion. None by
    default."""
    period: Positive = setting(0.005, unit="s")
    """Interpolation period of planner, hold and log."""
    held_speed: Annotated[str, OneOf(HELD_SPEEDS)] = "start"
    """Of the reference, which the controller gets for each period: "start", that of the sample
    that begins it, as in the paper, and so late by half a period where joints accelerate; or
    "mean", (q_ref of the next sample - q_ref) / period, as set points of drives have it. Errors
    are against the motion either way."""
    torque_margin: Number = setting(1.0, gt=0, le=1, unit="-")
    """Share of the motors' torque that the planner may use."""
    planner: Annotated[str, OneOf(tuple(PLANNERS))] = "limiter"
    """"limiter", the paper's, which keeps the time where it can, or "retiming", which keeps the
    path and slows down."""
    algorithm: Annotated[str, OneOf(SIGNS)] = "consistent"
    """Sign of Algorithm 1's third branch, "consistent" or "printed"."""
    inverse_dynamics: Annotated[str, OneOf(INVERSE_DYNAMICS)] = "table"
    """"table", load torques computed before the run, or "online", by a block."""
    accuracy: Number = setting(0.0001, ge=1e-12, le=0.01, unit="rad/s")
    """Of the integrator: speeds are good to it, positions to a tenth of it in rad."""
    plant: PlantChoice = setting(PlantChoice)
    """What moves."""
    drive: Drive = setting(Drive)
    """Of the motors; ideal by default."""
    controller: ControllerChoice = setting(ControllerChoice)
    """What drives it."""
    disturbance: DisturbanceChoice = setting(DisturbanceChoice)
    """What the model does not know."""

    def problems(self) -> Problems:
        controller, fastest = self.controller, 100 / self.period
        if self.disturbance.omega_d > fastest:  # the integrator would have to follow it
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
        rows = [(name, f"{value}") for name, value in given(self) if name != "name"]
        return Summary(title, ("field", "value"), rows)


@takes(path=a_path)
def load_scenario(
    path: str | Path, changes: Mapping[str, Any] | None = None, *, trust: bool = False
) -> Scenario:
    """A scenario from YAML, or the shipped one of a name; relative paths in the file start from its
    folder, and become absolute.

    Args:
        path: name or file.
        changes: values to be had instead of the file's, or besides, by their dotted names:
            {"controller.kind": "p_pi", "controller.zeta[2]": 0.9}; checked as if they stood in the
            file, but relative paths start from the working directory.
        trust: whether the Python file that it may name as `controller.file` is run unasked.

    Raises:
        InputError: with a line for each problem: file, field, and what would be right.
    """
    changes = {} if changes is None else changes
    if not isinstance(changes, Mapping) or not all(isinstance(name, str) for name in changes):
        text = "expected values by dotted names, {'controller.kind': 'p_pi'}"
        raise InputError(f"{one_line(changes)}, {text}", place="changes")
    with trusting(trust):
        scenario, file = load_yaml(Scenario, path, "scenario", changes)
    scenario.name = scenario.name or file.stem
    return scenario


def with_fields(scenario: Scenario, values: Mapping[str, object]) -> Scenario:
    """A copy of a scenario with other values in its fields, by their dotted names; unchecked."""
    made = copy.deepcopy(scenario)
    for name, value in values.items():
        *owners, field = name.split(".")
        setattr(functools.reduce(getattr, owners, made), field, copy.deepcopy(value))
    return made


@takes(scenario=a(Scenario, "sdt_drake.load"), path=a_path)
def save_scenario(scenario: Scenario, path: str | Path) -> None:
    """Write a scenario as YAML that `load_scenario` reads.

    Raises:
        InputError: if it is none, or the file cannot be written.
    """
    write_yaml(path, scenario)
