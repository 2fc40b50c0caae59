"""Sizing: motors, structures, motions and controllers to try, and what they must keep; YAML."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from sdt_drake.analysis.comparison import check_labels
from sdt_drake.io.errors import InputError, at, within
from sdt_drake.io.fields import (
    FileOf,
    Input,
    NotNegative,
    Number,
    OneOf,
    Positive,
    Problems,
    Some,
    Text,
    check,
    setting,
)
from sdt_drake.io.resources import find_file
from sdt_drake.io.yaml_files import load_yaml
from sdt_drake.motion import PLANNERS
from sdt_drake.robot.motors import Catalogue, DeviceChoice, load_catalogue
from sdt_drake.run.scenario import Scenario, load_scenario
from sdt_drake.studies.distributions import Choice, List
from sdt_drake.studies.fields import check_changes
from sdt_drake.studies.study import Study, Variable


@dataclass
class Requirements(Input):
    """What a device must keep in every motion: the largest value of each outcome.

    Lists have one value for all joints, or one for each.
    """

    max_abs_speed_error: Some[Positive] = setting(unit="rad/s", side="joint")
    """Largest speed error."""
    max_abs_position_error_deg: Some[Positive] | None = setting(None, unit="deg", side="joint")
    """Largest position error; any by default."""
    used_torque_share: Positive = setting(1.0, unit="-")
    """Largest share of the motor's peak torque."""
    torque_at_speed_share: Positive = setting(1.0, unit="-")
    """Of what the motor's envelope leaves at the planned speed."""
    winding_temperature: Positive = setting(1.0, unit="-")
    """As a share of what the rated torque gives for ever."""
    saturated_fraction: NotNegative = setting(0.0, unit="-")
    """Share of the time at a limit."""
    stretch: NotNegative = setting(0.0, unit="-")
    """How much longer than commanded a motion may last, as a share of its time."""

    def limits(self, n: int) -> dict[str, float]:
        """Largest value of each outcome of a run by its name, what matters first; in its unit."""
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
        return limits


@dataclass(kw_only=True)
class Sizing(Input):
    """Candidates for the motors of a device, and what they must do."""

    name: str = ""
    """Short name; that of the file by default."""
    scenario: Annotated[Text, FileOf("scenario")]
    """File of the base, with the coupled plant; relative to the file's own folder, or the name
    of one that ships with the package."""
    device: DeviceChoice = setting(DeviceChoice)
    """What all candidates share: `fitted`, `catalogue`, `gear_ratio`, `payload`,
    `stiffness_exponent`. Its motors and its scale are those of the candidates."""
    motors: Some[Some[str]]
    """Ids for each joint, base to tip; every combination is a motor set."""
    structure_scales: Some[Positive] = setting([1.0], unit="-")
    """Every motor set is tried with each."""
    motions: Some[Annotated[str, FileOf("motion")]]
    """Names of shipped ones, or files; every candidate must do all of them."""
    controllers: Some[str]
    """Labels: "pi", "p_pi+id"; each gets its own recommendation."""
    planner: Annotated[str, OneOf(tuple(PLANNERS))] = "limiter"
    """Of the motions; with "limiter" a motor set that is too weak for a motion is out, with
    "retiming" the motion takes longer, which `stretch` limits."""
    torque_margin: Number = setting(1.0, gt=0, le=1, unit="-")
    """Share of the motors' torque that the planner may use."""
    pause: NotNegative = setting(0.0, unit="s")
    """Rest between two runs of a motion, for the temperature of the windings."""
    requirements: Requirements
    """What every candidate must keep."""
    accuracy: Number = setting(0.001, ge=1e-12, le=0.01, unit="rad/s")
    """Of the integrator: speeds are good to it."""
    timeout: Positive = setting(300.0, unit="s")
    """What a run may take before it is given up."""

    def problems(self) -> Problems:
        lists = {f"motors[{k + 1}]": ids for k, ids in enumerate(self.motors)}
        # Two that are told as the same could not be told apart.
        lists["structure_scales"] = [f"{scale:g}" for scale in self.structure_scales]
        lists["motions"] = [short_name(motion) for motion in self.motions]
        for name, values in lists.items():
            if len(set(values)) < len(values):
                yield name, f"{values} has a value twice"
        for name in ("max_abs_speed_error", "max_abs_position_error_deg"):
            limits = getattr(self.requirements, name)
            if limits is not None and len(limits) not in (1, self.n):
                text = f"{len(limits)} value(s), expected one, or {self.n}, one for each joint"
                yield f"requirements.{name}", text
        if any(self.device.motors) or self.device.structure_scale != 1:
            yield "device", "motors and structure_scale are those of the candidates; remove"
        with at("device"):
            check(self.device, n=self.n)
        catalogue = self.catalogue
        for k, ids in enumerate(self.motors):
            fitted = self.device.fitted[k] if self.device.fitted else ""
            for id_ in ids:
                if not id_:
                    known = f"'{fitted}', which is fitted" if fitted else "ids of the catalogue"
                    yield f"motors[{k + 1}]", f"'' has no numbers to judge, expected {known}"
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
        """The motors to choose from."""
        return load_catalogue(self.device.catalogue)

    @property
    def masses(self) -> dict[str, float]:
        """Masses of the motors to choose from [kg], by id."""
        return {motor.id: motor.mass for motor in self.catalogue.motors}

    @property
    def shared_device(self) -> DeviceChoice:
        """The device as it is: with the fitted motors, or else the strongest of each joint, as
        one that is too weak for the motions would let nothing be tried."""
        fitted, torque = self.device.fitted or [""] * self.n, self._torque
        motors = [
            now or max(ids, key=torque) for now, ids in zip(fitted, self.motors, strict=False)
        ]
        return replace(self.device, motors=motors)

    def _torque(self, id_: str) -> float:
        """Peak torque behind the gearbox [N m]."""
        motor = self.catalogue.motor(id_, "motors")
        return motor.peak_torque * motor.gear_ratio

    def base(self, scenario: Scenario) -> Scenario:
        """The base scenario, with the device as it is."""
        return replace(
            scenario,
            device=self.shared_device,
            planner=self.planner,
            torque_margin=self.torque_margin,
        )

    def study(self) -> Study:
        """All candidates, motions and controllers as a study of `base`."""

        def choice(name: str, target: str, values: list[str]) -> Variable:
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
    """A sizing from YAML, and the base scenario of its study, with arguments as of `load_scenario`.

    Raises:
        InputError: with a line for each problem: file, field, and what would be right.
    """
    sizing, file = load_yaml(Sizing, path, "study")
    sizing.name = sizing.name or file.stem
    own = ["device", "planner", "torque_margin", "accuracy", *sizing.study().replaced]
    check_changes(changes or {}, own, file)
    scenario = load_scenario(sizing.scenario, changes, trust=trust)
    with within(file):
        if scenario.plant.kind != "coupled":
            raise InputError(
                f"scenario: plant.kind {scenario.plant.kind}, expected coupled: the masses of "
                "motors load the other joints"
            )
        if not scenario.plant.elasticity.is_rigid:
            raise InputError("scenario: plant.elasticity: expected rigid joints, for their torques")
        check_labels(sizing.controllers)
        for motion in sizing.motions:
            find_file(motion, "motion")
        base = sizing.base(scenario)
        check(base, n=sizing.n)
        sizing.study().validate(base)
    return sizing, base


def short_name(motion: str) -> str:
    """The name of a motion, from its path too."""
    return Path(motion).stem


class Candidate(NamedTuple):
    """A motor set in a structure.

    Attributes:
        motors: ids, base to tip.
        structure_scale: [-].
    """

    motors: tuple[str, ...]
    structure_scale: float

    def __str__(self) -> str:
        return f"{', '.join(self.motors)} at structure scale {self.structure_scale:g}"


def candidates(sizing: Sizing) -> list[Candidate]:
    """All candidates of a sizing, in the order of the study."""
    motor_sets = product(*sizing.motors)
    return [Candidate(ids, scale) for ids in motor_sets for scale in sizing.structure_scales]
