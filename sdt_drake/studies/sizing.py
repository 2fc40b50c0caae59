"""Sizing: the candidates for a device's motors and the requirements that they must meet."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from sdt_drake.analysis.comparison import check_labels
from sdt_drake.analysis.stopping import Stopping
from sdt_drake.io import fields
from sdt_drake.io.errors import InputError, within
from sdt_drake.io.resources import find_file
from sdt_drake.io.yaml_files import load_yaml
from sdt_drake.motion import Planner
from sdt_drake.robot.motors import Catalogue, DeviceChoice, load_catalogue
from sdt_drake.run.scenario import Scenario, load_scenario
from sdt_drake.studies.distributions import Choice, List
from sdt_drake.studies.fields import check_changes
from sdt_drake.studies.study import QUICK_ACCURACY, Study, Variable


@dataclass(frozen=True)
class Requirements(fields.Input):
    """The requirements of a device: the largest allowed value of each outcome, in every motion.

    A list has one value for all joints, or one for each joint.
    """

    max_abs_speed_error: fields.NonEmpty[fields.Positive] = fields.field(unit="rad/s", side="joint")
    """Largest speed error."""
    max_abs_position_error_deg: fields.NonEmpty[fields.Positive] | None = fields.field(
        None, unit="deg", side="joint"
    )
    """Largest position error; unlimited by default."""
    used_torque_share: fields.Positive = fields.field(1.0, unit="-")
    """Largest torque over the motor's peak torque."""
    torque_at_speed_share: fields.Positive = fields.field(1.0, unit="-")
    """Largest torque of the planned motion over the torque that the motor has at that speed."""
    winding_temperature: fields.Positive = fields.field(1.0, unit="-")
    """Largest temperature rise of the winding over the rise at constant rated torque."""
    saturated_fraction: fields.NotNegative = fields.field(0.0, unit="-")
    """Largest share of time in which a motor is at its torque limit."""
    stretch: fields.NotNegative = fields.field(0.0, unit="-")
    """Largest extra duration of a planned motion over its commanded duration."""
    stops: Stopping | None = fields.field(None)
    """Emergency stop whose limits are kept from every instant of each run; none by default. The
    brakes are those of the candidate's motors."""

    def problems(self) -> fields.Problems:
        if self.stops is not None and self.stops.limits.is_none:
            yield "stops.limits", "none, expected a limit that the stops keep"

    def limits(self, n: int) -> dict[str, float]:
        """Return the largest allowed value [SI] by name of the outcome, most important first."""
        position = self.max_abs_position_error_deg
        by_family: dict[str, ArrayLike] = {
            "torque_at_speed_share": self.torque_at_speed_share,
            "used_torque_share": self.used_torque_share,
            "winding_temperature": self.winding_temperature,
            "saturated_fraction": self.saturated_fraction,
            "max_abs_speed_error": self.max_abs_speed_error,
        }
        if position is not None:
            by_family["max_abs_position_error"] = np.radians(position)
        limits = {"stretch": self.stretch}
        for family, values in by_family.items():
            for k, value in enumerate(np.broadcast_to(values, n).tolist()):
                limits[f"{family}_{k + 1}"] = value
        return limits | ({} if self.stops is None else {"stop_share": 1.0})


@dataclass(frozen=True, kw_only=True)
class Sizing(fields.Input):
    """A sizing: candidates for the motors of a device, and their requirements."""

    name: str = ""
    """Short name; the name of the file by default."""
    scenario: Annotated[fields.Text, fields.FileOf("scenario")]
    """Base scenario, with the coupled plant: a file relative to this file's folder, or the name
    of a shipped one."""
    device: DeviceChoice = fields.field(DeviceChoice)
    """Device settings of all candidates: `fitted`, `catalogue`, `gear_ratio`, `payload`,
    `stiffness_exponent`. Leave `motors` and `structure_scale` out."""
    motors: fields.NonEmpty[fields.NonEmpty[str]]
    """Motor ids for each joint, base to tip; every combination is a motor set."""
    structure_scales: fields.NonEmpty[fields.Positive] = fields.field((1.0,), unit="-")
    """Structure scales; every motor set is tried with each of them."""
    motions: fields.NonEmpty[Annotated[str, fields.FileOf("motion")]]
    """Motions that every candidate must do: files, or names of shipped ones."""
    controllers: fields.NonEmpty[str]
    """Controller labels: "pi", "p_pi+id"; each gets its own recommendation."""
    planner: Planner = "limiter"
    """Planner of the motions. With "limiter" a motor set that is too weak for a motion is
    infeasible. With "retiming" the motion takes longer, which `stretch` limits."""
    torque_margin: fields.Number = fields.field(1.0, gt=0, le=1, unit="-")
    """Share of the motors' torque that the planner may use."""
    pause: fields.NotNegative = fields.field(0.0, unit="s")
    """Rest between two runs of a motion, in which the windings cool; back to back by default."""
    requirements: Requirements
    """Requirements that every candidate must meet."""
    accuracy: fields.Number = fields.field(0.001, ge=1e-12, le=0.01, unit="rad/s")
    """Accuracy of simulated speeds."""
    timeout: fields.Positive = fields.field(300.0, unit="s")
    """Longest computing time of a run; a longer run is stopped and counts as timed out."""

    def problems(self) -> fields.Problems:
        lists = {f"motors[{k + 1}]": ids for k, ids in enumerate(self.motors)}
        # Reports show scales in this format and motions by short name: both must differ.
        lists["structure_scales"] = [f"{scale:g}" for scale in self.structure_scales]
        lists["motions"] = [short_name(motion) for motion in self.motions]
        for name, values in lists.items():
            if len(set(values)) < len(values):
                yield name, f"{[*values]} has a value twice, expected each once"
        for name in ("max_abs_speed_error", "max_abs_position_error_deg"):
            limits = getattr(self.requirements, name)
            if limits is not None and len(limits) not in (1, self.n):
                text = f"{len(limits)} values, expected one, or {self.n}, one for each joint"
                yield f"requirements.{name}", text
        if any(self.device.motors) or self.device.structure_scale != 1:
            yield "device", "motors and structure_scale come from the candidates; remove them here"
        if not self.device.fitted:
            yield "device.fitted", "missing, expected the motors of the robot file, '' for none"
        with within(place="device"):
            fields.check_joints(self.device, "", self.n)
        catalogue = self.catalogue
        for k, ids in enumerate(self.motors):
            fitted = self.device.fitted[k] if self.device.fitted else ""
            for id_ in ids:
                if not id_:
                    known = f"'{fitted}', which is fitted" if fitted else "ids of the catalogue"
                    yield f"motors[{k + 1}]", f"'' names no motor, expected {known}"
                else:
                    catalogue.motor(id_, f"motors[{k + 1}]")
        for k, id_ in enumerate(self.device.fitted):
            if id_:
                catalogue.motor(id_, f"device.fitted[{k + 1}]")

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.motors)

    @property
    def catalogue(self) -> Catalogue:
        """The catalogue of the motors."""
        return load_catalogue(self.device.catalogue)

    @cached_property
    def limits(self) -> dict[str, float]:
        """Limits of the requirements, see `Requirements.limits`."""
        return self.requirements.limits(self.n)

    @cached_property
    def masses(self) -> dict[str, float]:
        """Masses of the catalogue's motors [kg], by id."""
        return {motor.id: motor.mass for motor in self.catalogue.motors}

    @property
    def shared_device(self) -> DeviceChoice:
        """The device of the base scenario: fitted motors, or else the strongest of each joint.

        The base scenario must be feasible: with too weak motors no candidate could be tried.
        """
        fitted, torque = self.device.fitted or [""] * self.n, self._torque
        motors = [
            now or max(ids, key=torque) for now, ids in zip(fitted, self.motors, strict=False)
        ]
        return replace(self.device, motors=motors)

    def _torque(self, id_: str) -> float:
        """Return a motor's peak torque behind its gearbox, joint side [N m]."""
        motor = self.catalogue.motor(id_, "motors")
        return motor.peak_torque * motor.gear_ratio

    def base(self, scenario: Scenario) -> Scenario:
        """Return the base scenario of the study, with `shared_device` and this planner."""
        own = {"planner": self.planner, "torque_margin": self.torque_margin}
        return scenario.changed({"device": self.shared_device, **own})

    def study(self) -> Study:
        """Return the study of all candidates, motions and controllers."""

        def choice(name: str, target: str, values: Sequence[str]) -> Variable:
            return Variable(name, [target], "value", Choice(values))

        motors = [
            choice(f"motor_{k + 1}", f"device.motors[{k + 1}]", ids)
            for k, ids in enumerate(self.motors)
        ]
        scales = List(self.structure_scales)
        return Study(
            name=self.name,
            scenario=self.scenario,
            accuracy=self.accuracy,
            timeout=self.timeout,
            pause=self.pause,
            stops=self.requirements.stops,
            variables=[
                *motors,
                Variable("structure_scale", ["device.structure_scale"], "value", scales),
                choice("motion", "motion", self.motions),
                choice("controller", "controller", self.controllers),
            ],
        )


def load_sizing(
    path: str | Path, changes: Mapping[str, Any] | None = None, *, trust: bool = False
) -> tuple[Sizing, Scenario]:
    """Load a sizing and the base scenario of its study.

    Args:
        path: a file, or the name of a shipped sizing.
        changes: values of scenario fields by dotted name, as in `load_scenario`.
        trust: whether the Python file of a controller is run without a question.

    Raises:
        InputError: with a line for each problem: file, field, and what is accepted.
    """
    sizing, file = load_yaml(Sizing, path, "study")
    own = ["device", "planner", "torque_margin", "accuracy", *sizing.study().replaced]
    check_changes(changes or {}, own, file)
    scenario = load_scenario(sizing.scenario, changes, trust=trust)
    with within(file):
        if scenario.plant.kind != "coupled":
            raise InputError(
                f"scenario: plant.kind {scenario.plant.kind}, expected coupled, as the mass of a "
                "motor loads the other joints"
            )
        if not scenario.plant.elasticity.is_rigid:
            raise InputError("scenario: plant.elasticity: elastic joints, expected rigid ones")
        check_labels(sizing.controllers)
        for motion in sizing.motions:
            find_file(motion, "motion")
        base = sizing.base(scenario)
        fields.check_joints(base, "", sizing.n)
        sizing.study().validate(base)
    return sizing, base


def first_look(sizing: Sizing) -> Sizing:
    """Return a sizing for its first motion and controller alone, with the coarsest accuracy."""
    return replace(
        sizing,
        motions=sizing.motions[:1],
        controllers=sizing.controllers[:1],
        accuracy=QUICK_ACCURACY,
    )


def short_name(motion: str) -> str:
    """Return the short name of a motion: the stem of its path.

    >>> short_name("motions/post_roll.csv")
    'post_roll'
    """
    return Path(motion).stem


class Candidate(NamedTuple):
    """A motor set in a structure."""

    motors: tuple[str, ...]
    """Ids of the motors, base to tip."""
    structure_scale: float
    """Scale of the structure's masses and inertias [-]."""

    def __str__(self) -> str:
        return f"{', '.join(self.motors)} at structure scale {self.structure_scale:g}"


def candidates(sizing: Sizing) -> list[Candidate]:
    """Return all candidates of a sizing, in the order of the study."""
    motor_sets = product(*sizing.motors)
    return [Candidate(ids, scale) for ids in motor_sets for scale in sizing.structure_scales]
