"""Recordings of flights: what their files call the columns, and head motion from there on."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import Field
from scipy.integrate import cumulative_trapezoid

from sdt_drake.io.arguments import finite, takes
from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError
from sdt_drake.io.fields import Number, OneOf, Problems, setting
from sdt_drake.io.numbers import Numbers, read_numbers
from sdt_drake.io.resources import find_file
from sdt_drake.io.yaml_files import load_yaml
from sdt_drake.machine.recordings import Layout, place_of, times_of
from sdt_drake.machine.recordings import missing as missing_column
from sdt_drake.motion.trajectory import interpolated
from sdt_drake.robot.head import GRAVITY

_FORCES = {"m/s2": 1.0, "g": GRAVITY, "ft/s2": 0.3048}
_RATES = {"rad/s": 1.0, "deg/s": np.pi / 180}
_AXES = {"flu": (1.0, 1.0, 1.0), "frd": (1.0, -1.0, -1.0)}
_ATTITUDE = ("bank_deg", "pitch_deg")
_FASTEST, _TYPICAL = 2 * np.pi, 1.0  # rad/s; at most, and in the mean: faster is no aircraft
_LONGEST = 3600.0  # s
_SLOWEST = 2.0  # Hz


_THREE: dict[str, Any] = {"min_length": 3, "max_length": 3}
_Direction = Annotated[Number, Field(ge=-1, le=1)]


@dataclass
class FlightColumns(Layout):
    """How a flight recording's file says what it holds; the default is that of this package.

    A column is named by its name or, counted from 1, its number.
    """

    force: list[str] = setting(["f_x", "f_y", "f_z"], **_THREE)
    """Columns of specific force (what accelerometers show) along x, y, z."""
    omega: list[str] = setting(["omega_x", "omega_y", "omega_z"], **_THREE)
    """Columns of angular rate about x, y, z."""
    force_unit: Annotated[str, OneOf(tuple(_FORCES))] = "m/s2"
    """"m/s2", "g" or "ft/s2"."""
    omega_unit: Annotated[str, OneOf(tuple(_RATES))] = "rad/s"
    """"rad/s" or "deg/s"."""
    axes: Annotated[str, OneOf(tuple(_AXES))] = "flu"
    """"flu", x forward, y left, z up; or "frd", x forward, y right, z down."""
    force_direction: list[_Direction] = setting([1.0] * 3, unit="-", **_THREE)
    """1, or -1 where a column counts the other way than `axes` say, as the load factor of
    recorders, which is positive upwards."""
    omega_direction: list[_Direction] = setting([1.0] * 3, unit="-", **_THREE)
    """Likewise."""
    lever: list[Number] = setting([0.0] * 3, unit="m", **_THREE)
    """Where it was measured, from the pilot's head, x forward, y left, z up; 0 by default."""

    def problems(self) -> Problems:
        yield from Layout.problems(self)
        for name in ("force_direction", "omega_direction"):
            if any(abs(x) != 1 for x in getattr(self, name)):
                yield name, f"{getattr(self, name)}, expected 1 and -1"


@dataclass(frozen=True, eq=False)
class Flight:
    """Motion of a pilot's head in flight, in its axes: x forward, y left, z up.

    Attributes:
        name: for people.
        time: growing [s], from 0, shape (N,).
        specific_force: a - g, (0, 0, +9.81) in level flight [m/s²], shape (N, 3).
        angular_rate: [rad/s], shape (N, 3).
        attitude: bank and pitch [rad], shape (N, 2), where the file has them; for pictures alone.
        notes: what was left out of its file, in sentences.
    """

    name: str
    time: Array
    specific_force: Array
    angular_rate: Array
    attitude: Array | None = None
    notes: tuple[str, ...] = ()

    @property
    def duration(self) -> float:
        """Time of the last sample [s]."""
        return float(self.time[-1])

    def at(self, time: Array) -> tuple[Array, Array]:
        """Specific force and angular rate, the first before the flight, the last after it; shape
        (M, 3) each."""
        return (
            interpolated(time, self.time, self.specific_force),
            interpolated(time, self.time, self.angular_rate),
        )

    def means(self, time: Array, width: float) -> tuple[Array, Array]:
        """The same, as means over `width` [s] around each time."""
        longer = np.concatenate([[time[0] - width], self.time, [time[-1] + width]])
        values = np.hstack(self.at(longer))
        sums = np.asarray(cumulative_trapezoid(values, longer, axis=0, initial=0))
        ahead, behind = (interpolated(time + x, longer, sums) for x in (width / 2, -width / 2))
        means = (ahead - behind) / width
        return means[:, :3], means[:, 3:]


@takes(time=finite("(N,)"), specific_force=finite("(N, 3)"), angular_rate=finite("(N, 3)"))
def make_flight(
    time: Array,
    specific_force: Array,
    angular_rate: Array,
    name: str = "flight",
    attitude: Array | None = None,
) -> Flight:
    """A flight of arrays, as `Flight` describes them.

    Raises:
        InputError: for arrays that do not fit, samples too far apart, or more than an hour.
    """
    for what, values in (("specific_force", specific_force), ("angular_rate", angular_rate)):
        if values.shape != (len(time), 3):
            raise InputError(f"of shape {values.shape}, expected ({len(time)}, 3)", place=what)
    steps = np.diff(time)
    if len(time) < 2 or steps.min() <= 0:
        raise InputError(
            "expected at least 2 samples, each later than the one before", place="time"
        )
    if steps.max() > 1 / _SLOWEST:
        i = int(steps.argmax())
        raise InputError(
            f"{steps[i]:g} s between samples at {time[i]:g} s, expected at most {1 / _SLOWEST:g} s",
            place="time",
        )
    if time[-1] - time[0] > _LONGEST:
        raise InputError(f"{time[-1] - time[0]:g} s, expected at most {_LONGEST:g} s", place="time")
    return Flight(name, time - time[0], specific_force, angular_rate, attitude)


def load_flight_columns(path: str | Path) -> FlightColumns:
    """The mapping file of a flight recording.

    Raises:
        InputError: naming the file, the field, and what would be right.
    """
    return load_yaml(FlightColumns, path, "columns of a flight")[0]


def read_flight(path: str | Path, columns: FlightColumns | str | Path | None = None) -> Flight:
    """Read a recording of a flight.

    Where it was measured with a lever l from the head, the head has f - alpha x l - omega x (omega
    x l), with alpha from differences of the rate.

    Args:
        path: of the file, or the name of a flight that ships.
        columns: what its file calls them, a mapping file, or the name of one that ships.

    Raises:
        InputError: naming the file, and the column or line.
    """
    if isinstance(columns, str | Path):
        columns = load_flight_columns(columns)
    columns = columns or FlightColumns()
    numbers = read_numbers(find_file(path, "flight"), columns.style, logged=True)
    time = times_of(numbers, columns)
    axes = np.array(_AXES[columns.axes])
    force = _columns(numbers, columns.force, "force") * axes * columns.force_direction
    omega = _columns(numbers, columns.omega, "omega") * axes * columns.omega_direction
    force, omega = force * _FORCES[columns.force_unit], omega * _RATES[columns.omega_unit]
    lever = np.array(columns.lever)
    if lever.any():
        alpha = np.gradient(omega, time, axis=0)
        force = force - np.cross(alpha, lever) - np.cross(omega, np.cross(omega, lever))
    attitude = None
    if all(name in numbers.names for name in _ATTITUDE):
        attitude = np.radians(_columns(numbers, list(_ATTITUDE), "attitude"))
    flight = make_flight(time, force, omega, numbers.path.stem, attitude)
    return replace(flight, notes=numbers.notes)


def suspicious_flight(flight: Flight) -> Iterator[str]:
    """What looks wrong in a flight, in sentences."""
    yield from (f"{flight.name}: {note}" for note in flight.notes)
    f, omega = flight.specific_force, flight.angular_rate
    size, mean = np.linalg.norm(f, axis=1), f.mean(axis=0)
    low, usual = np.quantile(size, [0.1, 0.5])
    k = int(np.argmax(np.abs(mean)))
    told = ""
    if 0.5 < usual < 4 and low > 0.3 and size.max() < GRAVITY:
        told = f"its force is {usual:.3g} m/s² for most of the time: in g? (force_unit: g)"
    elif low < GRAVITY / 2:
        told = (
            f"its force is below {low:.3g} m/s² for a tenth of the time: was gravity taken off? An "
            "accelerometer shows 9.81 m/s² at rest; add it before"
        )
    elif low > 2 * GRAVITY:
        told = f"its force is never below {low / GRAVITY:.3g} G: in ft/s²? (force_unit: ft/s2)"
    elif k != 2:
        told = (
            f"its mean force is along {'xyz'[k]}, {mean[k]:.3g} m/s²: are force's columns in "
            "another order? Expected are the pilot's x forward, y left, z up"
        )
    elif mean[2] < 0:
        told = f"its mean force along z is {mean[2]:.3g} m/s²: is z down? (axes: frd)"
    if told:
        yield f"{flight.name}: {told}"
    fastest, typical = np.abs(omega).max(), np.linalg.norm(omega, axis=1).mean()
    if fastest > _FASTEST or typical > _TYPICAL:
        yield (
            f"{flight.name}: it turns at up to {fastest:.3g} rad/s, {typical:.3g} rad/s in the "
            "mean: in degrees? (omega_unit: deg/s)"
        )


def _columns(numbers: Numbers, names: list[str], what: str) -> Array:
    """Columns by their names or numbers, shape (N, len(names))."""
    places = []
    for name in names:
        place = place_of(numbers, name)
        if place is None:
            raise missing_column(numbers, name, what)
        places.append(place)
    numbers.check_finite(places)
    return np.asarray(numbers.data[:, places])
