"""The motors to choose from, torque motors and geared motors; and the drives that feed them."""

# Real annotations, for the check of the fields (sdt_drake.fields): they may not be postponed.
from collections.abc import Iterator
from dataclasses import dataclass
from math import pi
from pathlib import Path
from typing import Optional

from sdt_drake.errors import InputError
from sdt_drake.fields import nearest, setting
from sdt_drake.yaml_files import load_yaml

DEFAULT_CATALOGUE = "package://sdt/motors.yaml"

MOTOR_KINDS = ("torque motor", "geared motor")
"""Direct drive, or with a gearbox that its numbers contain."""

_RPM = 2 * pi / 60  # rad/s


@dataclass(kw_only=True, slots=True)
class Motor:
    """A motor, with its gearbox if it has one; **motor side**.

    Attributes:
        id: short name.
        kind: direct drive, or with a gearbox.
        peak_torque: largest torque.
        rated_torque: torque that it can give for ever (S1), at a standstill or low speed.
        rotor_inertia: of motor and gearbox.
        n1_rpm: speed up to which it gives its peak torque.
        n0_rpm: speed at which none is left to drive with; linear between the two.
        mass: of motor and gearbox.
        gear_ratio: motor speed over joint speed; of a geared motor by default, unless a device
            chooses another.
        thermal_time_constant: of the winding, first order.
        source: where the numbers are from.
    """

    id: str = setting()
    kind: str = setting(choices=MOTOR_KINDS)
    peak_torque: float = setting(above=0, unit="N m", side="motor")
    rated_torque: float = setting(above=0, unit="N m", side="motor")
    rotor_inertia: float = setting(above=0, unit="kg m²", side="motor")
    n1_rpm: float = setting(above=0, unit="rpm", side="motor")
    n0_rpm: float = setting(above=0, unit="rpm", side="motor")
    mass: float = setting(above=0, unit="kg")
    gear_ratio: float = setting(1.0, above=0, unit="-")
    thermal_time_constant: float = setting(above=0, unit="s")
    source: str = setting()

    @property
    def n1(self) -> float:
        """`n1_rpm` in rad/s."""
        return self.n1_rpm * _RPM

    @property
    def n0(self) -> float:
        """`n0_rpm` in rad/s."""
        return self.n0_rpm * _RPM

    def problems(self) -> Iterator[tuple[str, str]]:
        if self.rated_torque > self.peak_torque:
            yield (
                "rated_torque",
                f"{self.rated_torque:g}, expected at most peak_torque, {self.peak_torque:g}",
            )
        if self.n0_rpm <= self.n1_rpm:
            yield "n0_rpm", f"{self.n0_rpm:g}, expected more than n1_rpm, {self.n1_rpm:g}"
        if not self.takes_gear(self.gear_ratio):
            yield "gear_ratio", f"{self.gear_ratio:g}, but a torque motor drives directly: 1"

    def takes_gear(self, gear_ratio: float) -> bool:
        """Whether it can have a gear: a torque motor has none."""
        return self.kind != "torque motor" or gear_ratio == 1


@dataclass(kw_only=True, slots=True)
class Catalogue:
    """Motors by their ids.

    Attributes:
        notes: for people.
        motors: in any order.
    """

    notes: str = ""
    motors: list[Motor] = setting()

    @property
    def ids(self) -> list[str]:
        """Ids of all motors in the catalogue."""
        return [motor.id for motor in self.motors]

    def motor(self, id_: str, where: str) -> Motor:
        """The motor of this id.

        Raises:
            InputError: naming `where`, and ids like this one.
        """
        for motor in self.motors:
            if motor.id == id_:
                return motor
        raise InputError(f"{where}: no motor '{id_}' in the catalogue, {nearest(id_, self.ids)}")

    def problems(self) -> Iterator[tuple[str, str]]:
        for i, id_ in enumerate(self.ids):
            if id_ in self.ids[:i]:
                yield f"motors[{i + 1}].id", f"'{id_}' is given twice"


def load_catalogue(path: str | Path = DEFAULT_CATALOGUE) -> Catalogue:
    """A catalogue from YAML.

    Raises:
        InputError: with a line for each problem: file, field, and what would be right.
    """
    return load_yaml(Catalogue, path, "motors")[0]


# --- drives ----------------------------------------------------------------------------------

SHORTEST_PERIOD = 125e-6  # s; the speed loop of SINAMICS S120, servo control at 4 kHz


@dataclass(slots=True)
class Drive:
    """What lies between the controller's law and the torque of the motors.

    Everything is ideal unless given. Lists have one value for each joint.

    Attributes:
        period: sampling period of the speed loop; 125 µs to the interpolation period, which it
            must divide. Continuous by default.
        torque_bandwidth: -3 dB frequency of the torque loop, a first-order lag.
        torque_error: the motors give (1 + torque_error) of the torque they should.
        encoder_resolution: increments of each encoder per revolution **of the motor**; speed is
            then the difference of positions over `period`.
        n1: motor speed up to which the full torque is available.
        n0: motor speed at which none is left to accelerate any more.
        reference_delay: how late the reference and all that is computed from it arrives.
    """

    period: Optional[float] = setting(None, minimum=SHORTEST_PERIOD, unit="s")
    torque_bandwidth: Optional[float] = setting(None, above=0, unit="Hz")
    torque_error: Optional[list[float]] = setting(None, above=-1, below=1, per_joint=True, unit="-")
    encoder_resolution: Optional[list[float]] = setting(
        None, minimum=1, per_joint=True, unit="1/rev", side="motor"
    )
    n1: Optional[list[float]] = setting(None, above=0, per_joint=True, unit="rad/s", side="motor")
    n0: Optional[list[float]] = setting(None, above=0, per_joint=True, unit="rad/s", side="motor")
    reference_delay: float = setting(0.0, minimum=0, unit="s")

    def problems(self) -> Iterator[tuple[str, str]]:
        if self.encoder_resolution is not None and self.period is None:
            yield "encoder_resolution", "needs period, to take the speed"
        if (self.n1 is None) != (self.n0 is None):
            yield "n1" if self.n1 is None else "n0", "missing, expected n1 and n0 or neither"
        elif self.n1 and self.n0 and any(a >= b for a, b in zip(self.n1, self.n0, strict=False)):
            yield "n0", f"{self.n0}, expected more than n1, {self.n1}, everywhere"
