"""Sizing: motors, structures, motions and controllers to try, and what they must keep; YAML."""

# Drake's YAML loader reads the annotations here: they may not be postponed, and "or None" must be
# spelled Optional[...].
from dataclasses import dataclass, field, replace
from itertools import product
from pathlib import Path
from typing import NamedTuple, Optional

import numpy as np

from sdt_drake.analysis.comparison import check_labels
from sdt_drake.device import Catalogue, DeviceChoice, load_catalogue
from sdt_drake.errors import InputError, checked_choice, checked_number
from sdt_drake.fields import check, setting
from sdt_drake.motion import PLANNERS, find_motion
from sdt_drake.resources import PACKAGE_PREFIX, find_file
from sdt_drake.scenario import Scenario, load_scenario
from sdt_drake.studies.study import Choice, List, Study, Variable
from sdt_drake.yaml_files import load_yaml


@dataclass
class Requirements:
    """What a device must keep in every motion: the largest value of each outcome.

    Lists have one value for all joints, or one for each.

    Attributes:
        max_abs_speed_error: joint side [rad/s].
        max_abs_position_error_deg: joint side [deg]; any by default.
        used_torque_share: of the motor's peak torque [-].
        torque_at_speed_share: of what the motor's envelope leaves at the planned speed [-].
        winding_temperature: as a share of what the rated torque gives for ever [-].
        saturated_fraction: of the time [-].
        stretch: how much longer than commanded a motion may last [-].
    """

    max_abs_speed_error: list[float] = field(default_factory=list)
    max_abs_position_error_deg: Optional[list[float]] = None
    used_torque_share: float = 1.0
    torque_at_speed_share: float = 1.0
    winding_temperature: float = 1.0
    saturated_fraction: float = 0.0
    stretch: float = 0.0

    def validate(self, n: int, where: str) -> None:
        """Check everything for n joints.

        Raises:
            InputError: naming the field below `where`.
        """
        for name in ("max_abs_speed_error", "max_abs_position_error_deg"):
            values = getattr(self, name)
            if values is None:
                continue
            if len(values) not in (1, n):
                raise InputError(
                    f"{where}.{name}: {len(values)} value(s), expected one, or {n}, one for each "
                    "joint"
                )
            for value in values:
                checked_number(value, f"{where}.{name}", minimum=0, exclusive=True)
        for name in ("used_torque_share", "torque_at_speed_share", "winding_temperature"):
            checked_number(getattr(self, name), f"{where}.{name}", minimum=0, exclusive=True)
        for name in ("saturated_fraction", "stretch"):
            checked_number(getattr(self, name), f"{where}.{name}", minimum=0)

    def limits(self, n: int) -> dict[str, float]:
        """Largest value of each outcome of a run by its name, what matters first; in its unit."""
        position = self.max_abs_position_error_deg
        by_family = {
            "torque_at_speed_share": [self.torque_at_speed_share],
            "used_torque_share": [self.used_torque_share],
            "winding_temperature": [self.winding_temperature],
            "saturated_fraction": [self.saturated_fraction],
            "max_abs_speed_error": self.max_abs_speed_error,
            "max_abs_position_error": [] if position is None else np.radians(position).tolist(),
        }
        limits = {"stretch": self.stretch}
        for family, values in by_family.items():
            for k, value in enumerate(values * n if len(values) == 1 else values):
                limits[f"{family}_{k + 1}"] = value
        return limits


@dataclass
class Sizing:
    """Candidates for the motors of a device, and what they must do.

    Attributes:
        name: short name.
        scenario: file of the base, with the coupled plant; relative to the file's own folder, or
            package://sdt/...
        device: what all candidates share: `fitted`, `catalogue`, `gear_ratio`, `payload`,
            `stiffness_exponent`. Its motors and its scale are those of the candidates.
        motors: ids for each joint, base to tip; every combination is a motor set.
        structure_scales: every motor set is tried with each [-].
        motions: names of shipped ones, or files; every candidate must do all of them.
        controllers: labels: "pi", "p_pi+id"; each gets its own recommendation.
        planner: of the motions; with "limiter" a motor set that is too weak for a motion is out,
            with "retiming" the motion takes longer, which `stretch` limits.
        torque_margin: share of the motors' torque that the planner may use, in (0, 1].
        pause: rest between two runs of a motion, for the temperature of the windings [s].
        requirements: what every candidate must keep.
        accuracy: of the integrator: speeds are good to half of it [rad/s].
        timeout: what a run may take before it is given up [s].
    """

    name: str = ""
    scenario: str = ""
    device: DeviceChoice = field(default_factory=DeviceChoice)
    motors: list[list[str]] = field(default_factory=list)
    structure_scales: list[float] = field(default_factory=lambda: [1.0])
    motions: list[str] = field(default_factory=list)
    controllers: list[str] = field(default_factory=list)
    planner: str = "limiter"
    torque_margin: float = 1.0
    pause: float = 0.0
    requirements: Requirements = field(default_factory=Requirements)
    accuracy: float = setting(1e-3, minimum=1e-12, maximum=0.01, unit="rad/s")
    timeout: float = 300.0

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.motors)

    @property
    def catalogue(self) -> Catalogue:
        """The motors to choose from."""
        return load_catalogue(self.device.catalogue)

    def validate(self, base: Scenario) -> None:
        """Check everything but the robot.

        Raises:
            InputError: naming the field and what would be right.
        """
        if base.plant.kind != "coupled":
            raise InputError(
                f"scenario: plant.kind {base.plant.kind}, expected coupled: the masses of motors "
                "load the other joints"
            )
        if not base.plant.elasticity.is_rigid:
            raise InputError("scenario: plant.elasticity: expected rigid joints, for their torques")
        if not self.motors:
            raise InputError("motors: none, expected a list of ids for each joint")
        catalogue = self.catalogue
        for k, ids in enumerate(self.motors):
            for id_ in _checked_list(ids, f"motors[{k + 1}]"):
                catalogue.motor(id_, f"motors[{k + 1}]")
        if any(self.device.motors) or self.device.structure_scale != 1:
            raise InputError(
                "device: motors and structure_scale are those of the candidates; remove"
            )
        check(self.device, "device", self.n)
        for k, id_ in enumerate(self.device.fitted):
            if id_:
                catalogue.motor(id_, f"device.fitted[{k + 1}]")
        check(self.shared_device, "device")
        for scale in self.structure_scales:
            checked_number(scale, "structure_scales", minimum=0, exclusive=True)
        # Two that are told as the same number could not be told apart.
        _checked_list([f"{scale:g}" for scale in self.structure_scales], "structure_scales")
        _checked_list([short_name(motion) for motion in self.motions], "motions")
        for motion in self.motions:
            find_motion(motion)
        check_labels(self.controllers)
        checked_choice(self.planner, tuple(PLANNERS), "planner")
        checked_number(self.torque_margin, "torque_margin", minimum=0, exclusive=True)
        checked_number(self.pause, "pause", minimum=0)
        if not self.requirements.max_abs_speed_error:
            raise InputError("requirements.max_abs_speed_error: missing, expected a list [rad/s]")
        self.requirements.validate(self.n, "requirements")

    @property
    def shared_device(self) -> DeviceChoice:
        """The device as it is: with the fitted motors, or else the first of each joint."""
        fitted = self.device.fitted or [""] * self.n
        motors = [now or ids[0] for now, ids in zip(fitted, self.motors, strict=False)]
        return replace(self.device, motors=motors)

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


def _checked_list(values: list, where: str) -> list:
    if not values:
        raise InputError(f"{where}: empty, expected at least one")
    if len(set(values)) < len(values):
        raise InputError(f"{where}: {values} has a value twice")
    return values


def load_sizing(path: str | Path) -> tuple[Sizing, Scenario]:
    """A sizing from YAML, and the base scenario of its study.

    Raises:
        InputError: naming the file, the field, and what would be right.
    """
    sizing, file = load_yaml(Sizing, path)
    folder = file.resolve().parent
    sizing.name = sizing.name or file.stem

    def placed(name: str) -> str:
        return name if name.startswith(PACKAGE_PREFIX) else str(folder / name)

    try:
        if not sizing.scenario:
            raise InputError("scenario: missing, expected the file of the base scenario")
        sizing.scenario = placed(sizing.scenario)
        sizing.device.catalogue = placed(sizing.device.catalogue)
        # A path is its own, the name of a shipped motion is not.
        sizing.motions = [m if find_motion(m) != m else placed(m) for m in sizing.motions]
        scenario = load_scenario(sizing.scenario)
        sizing.validate(scenario)
        for motion in sizing.motions:
            find_file(find_motion(motion))
        base = sizing.base(scenario)
        check(base)
        sizing.study().validate(base)
    except InputError as error:
        text = str(error)
        raise InputError(text if text.startswith(str(file)) else f"{file}: {text}") from None
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
    """All of them, in the order of the study."""
    return [Candidate(c[:-1], c[-1]) for c in product(*sizing.motors, sizing.structure_scales)]
