"""The motors to choose from: a catalogue of torque motors and of geared motors."""

# Drake's YAML loader reads the annotations: not postponed.
import difflib
from dataclasses import dataclass, field
from math import isnan, nan, pi
from pathlib import Path

from sdt_drake.errors import InputError, checked_choice, checked_number
from sdt_drake.yaml_files import load_yaml

DEFAULT_CATALOGUE = "package://sdt/motors.yaml"

MOTOR_KINDS = ("torque motor", "geared motor")
"""Direct drive, or with a gearbox that its numbers contain."""

_RPM = 2 * pi / 60  # rad/s


@dataclass
class Motor:
    """A motor, with its gearbox if it has one; **motor side**.

    Attributes:
        id: short name.
        kind: one of MOTOR_KINDS.
        peak_torque: largest torque [N m].
        rated_torque: torque that it can give for ever (S1), at a standstill or low speed [N m].
        rotor_inertia: of motor and gearbox [kg m²].
        n1_rpm: speed up to which it gives its peak torque [rpm].
        n0_rpm: speed at which none is left to drive with [rpm]; linear between the two.
        mass: of motor and gearbox [kg].
        gear_ratio: motor speed over joint speed [-]; of a geared motor by default, unless a device
            chooses another.
        thermal_time_constant: of the winding, first order [s].
        source: where the numbers are from.
    """

    id: str = ""
    kind: str = ""
    peak_torque: float = nan
    rated_torque: float = nan
    rotor_inertia: float = nan
    n1_rpm: float = nan
    n0_rpm: float = nan
    mass: float = nan
    gear_ratio: float = 1.0
    thermal_time_constant: float = nan
    source: str = ""

    @property
    def n1(self) -> float:
        """`n1_rpm` in rad/s."""
        return self.n1_rpm * _RPM

    @property
    def n0(self) -> float:
        """`n0_rpm` in rad/s."""
        return self.n0_rpm * _RPM

    def validate(self, where: str) -> None:
        """Check all numbers; `where` names this motor.

        Raises:
            InputError: naming the field below `where`.
        """
        checked_choice(self.kind, MOTOR_KINDS, f"{where}: kind")
        for name in _NUMBERS:
            value = getattr(self, name)
            if isnan(value):
                raise InputError(f"{where}: {name}: missing, expected a number > 0")
            checked_number(value, f"{where}: {name}", minimum=0, exclusive=True)
        if self.rated_torque > self.peak_torque:
            raise InputError(
                f"{where}: rated_torque: {self.rated_torque:g} N m, expected at most peak_torque, "
                f"{self.peak_torque:g}"
            )
        if self.n0_rpm <= self.n1_rpm:
            raise InputError(
                f"{where}: n0_rpm: {self.n0_rpm:g}, expected more than n1_rpm, {self.n1_rpm:g}"
            )
        self.check_gear_ratio(self.gear_ratio, f"{where}: gear_ratio")
        if not self.source.strip():
            raise InputError(
                f"{where}: source: missing, expected where the numbers are from, or 'illustrative'"
            )

    def check_gear_ratio(self, gear_ratio: float, where: str) -> None:
        """Refuse a gear behind a torque motor.

        Raises:
            InputError: naming `where`.
        """
        if self.kind == "torque motor" and gear_ratio != 1:
            raise InputError(f"{where}: {gear_ratio:g}, but {self.id} drives directly, expected 1")


_NUMBERS = (
    "peak_torque", "rated_torque", "rotor_inertia", "n1_rpm", "n0_rpm", "mass", "gear_ratio",
    "thermal_time_constant",
)  # fmt: skip


@dataclass
class Catalogue:
    """Motors by their ids.

    Attributes:
        notes: for people.
        motors: in any order.
    """

    notes: str = ""
    motors: list[Motor] = field(default_factory=list)

    @property
    def ids(self) -> list[str]:
        """Of all motors."""
        return [motor.id for motor in self.motors]

    def motor(self, id_: str, where: str) -> Motor:
        """The motor of this id.

        Raises:
            InputError: naming `where`, and ids like this one.
        """
        for motor in self.motors:
            if motor.id == id_:
                return motor
        near = difflib.get_close_matches(id_, self.ids, n=3)
        meant = f"did you mean {' or '.join(near)}?" if near else "expected one of"
        known = "" if near else f" {', '.join(self.ids)}"
        raise InputError(f"{where}: no motor '{id_}' in the catalogue, {meant}{known}")

    def validate(self) -> None:
        """Check every motor, and that no id is there twice.

        Raises:
            InputError: naming the motor and the field.
        """
        if not self.motors:
            raise InputError("motors: empty, expected at least one")
        for i, motor in enumerate(self.motors):
            if not motor.id:
                raise InputError(f"motors[{i + 1}].id: missing, expected a short name")
            if motor.id in self.ids[:i]:
                raise InputError(f"motors[{i + 1}].id: '{motor.id}' is given twice")
            motor.validate(f"motor '{motor.id}'")


def load_catalogue(path: str | Path = DEFAULT_CATALOGUE) -> Catalogue:
    """A catalogue from YAML.

    Raises:
        InputError: naming the file, the motor, the field, and what would be right.
    """
    catalogue, file = load_yaml(Catalogue, path)
    try:
        catalogue.validate()
    except InputError as error:
        raise InputError(f"{file}: {error}") from None
    return catalogue
