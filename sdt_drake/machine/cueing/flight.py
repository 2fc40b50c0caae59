"""Recordings of flights, read from files with any columns and units into motion of the head."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field
from scipy.integrate import cumulative_trapezoid

from sdt_drake.io.arguments import finite, takes
from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError
from sdt_drake.io.fields import Number, Positive, Problems, Values, field
from sdt_drake.io.numbers import Numbers, read_numbers
from sdt_drake.io.resources import find_file, shipped
from sdt_drake.io.shown import higher
from sdt_drake.io.yaml_files import load_yaml
from sdt_drake.machine.cueing.cleaning import (
    FORCE_NOISE,
    RATE_NOISE,
    at_finer_times,
    forward_force,
    rates_of,
    without_noise,
)
from sdt_drake.machine.recordings.columns import Layout
from sdt_drake.machine.recordings.places import OR_DROP, place_of
from sdt_drake.machine.recordings.places import missing as missing_column
from sdt_drake.machine.recordings.times import places_of_time, times_of
from sdt_drake.motion.trajectory import interpolated
from sdt_drake.pilot.head import GRAVITY

FORCE_UNITS = {"m/s2": 1.0, "g": GRAVITY, "ft/s2": 0.3048}
"""Units of forces in m/s²."""

_RATES = {"rad/s": 1.0, "deg/s": np.pi / 180}
_AXES = {"flu": (1.0, 1.0, 1.0), "frd": (1.0, -1.0, -1.0)}
_MAX_DURATION = 3600.0  # s
_MIN_SAMPLE_RATE = 2.0  # Hz
MIN_RATE = 0.5
"""Slowest rate of a flight's recorder [Hz]; slower times are in another unit."""


_THREE: dict[str, Any] = {"min_length": 3, "max_length": 3}
_Direction = Annotated[Number, Field(ge=-1, le=1)]


@dataclass(frozen=True)
class FlightColumns(Layout):
    """The columns of a flight recording's file, with their units and axes.

    The default is the package's own format. Columns are given by name, or by number from 1.
    """

    force: Values[str] = field(("f_x", "f_y", "f_z"), **_THREE)
    """Columns of specific force along x, y, z, as accelerometers measure it; "" for a forward one
    that is found from pitch and speed."""
    omega: Values[str] = field(("omega_x", "omega_y", "omega_z"), max_length=3)
    """Columns of angular rate about x, y, z; [] for rates from the attitude."""
    attitude: Values[str] = field(("bank_deg", "pitch_deg"), max_length=3)
    """Columns of bank (right positive), pitch (up positive) and heading, optional where rates are
    there."""
    attitude_unit: Literal["deg", "rad"] = "deg"
    """Unit of the attitude: "deg" or "rad"."""
    speed: str = ""
    """Column of airspeed, for a missing forward force; "" for none."""
    speed_factor: Positive = field(1.0, unit="m/s")
    """Unit of the airspeed: 0.5144 for knots."""
    force_offset: Values[Number] = field((0.0,) * 3, unit="force_unit", **_THREE)
    """Values added to the force columns: 1 for a load factor in g that is 0 in level
    flight."""
    force_unit: Literal["m/s2", "g", "ft/s2"] = "m/s2"
    """Unit of forces: "m/s2", "g" or "ft/s2"."""
    omega_unit: Literal["rad/s", "deg/s"] = "rad/s"
    """Unit of rates: "rad/s" or "deg/s"."""
    force_factor: Positive = field(1.0, unit="-")
    """Factor on forces before their unit counts: 0.001 with "g" for thousandths of g."""
    omega_factor: Positive = field(1.0, unit="-")
    """Factor on rates before their unit counts: such as 1/16.4 with "deg/s" for raw counts."""
    axes: Literal["flu", "frd"] = "flu"
    """Axes: "flu" (x forward, y left, z up) or "frd" (x forward, y right, z down)."""
    force_direction: Values[_Direction] = field((1.0,) * 3, unit="-", **_THREE)
    """Direction of each force column: 1, or -1 for the opposite sign of `axes`, such as a load
    factor that is positive upwards with axes "frd"."""
    omega_direction: Values[_Direction] = field((1.0,) * 3, unit="-", **_THREE)
    """Direction of each rate column: 1, or -1 for the opposite sign of `axes`."""
    lever: Values[Number] = field((0.0,) * 3, unit="m", **_THREE)
    """Position of the sensor relative to the pilot's head, x forward, y left, z up; 0 by
    default."""

    def problems(self) -> Problems:
        yield from Layout.problems(self)
        if len(self.omega) not in (0, 3):
            yield "omega", f"{len(self.omega)} column(s), expected 3, or [] for rates from attitude"
        if len(self.attitude) < (2 if self.omega and self.force[0] else 3 - bool(self.omega)):
            yield "attitude", f"{[*self.attitude]}, expected bank, pitch and heading"
        if not all(self.force[1:]):
            yield "force", f"{[*self.force]}, expected columns along y and z"
        for name in ("force_direction", "omega_direction"):
            if any(abs(x) != 1 for x in getattr(self, name)):
                yield name, f"{[*getattr(self, name)]}, expected 1 and -1"

    def force_of(self, values: Array) -> Array:
        """Return specific force [m/s²], x forward, y left, z up, of its columns, shape (N, 2 or 3).

        Two columns are those along y and z.
        """
        own = slice(3 - values.shape[1], 3)
        signs = np.array(_AXES[self.axes]) * self.force_direction
        scale = self.force_factor * FORCE_UNITS[self.force_unit]
        return np.asarray((values + self.force_offset[own]) * signs[own] * scale)

    def rate_of(self, values: Array) -> Array:
        """Return the rate [rad/s], x forward, y left, z up, of its columns, shape (N, 3)."""
        signs = np.array(_AXES[self.axes]) * self.omega_direction
        return np.asarray(values * signs * self.omega_factor * _RATES[self.omega_unit])


@dataclass(frozen=True, eq=False)
class Flight:
    """The motion of a pilot's head in flight, in axes x forward, y left, z up."""

    name: str
    """Name in reports."""
    time: Array
    """Increasing times from 0 [s], shape (N,)."""
    specific_force: Array
    """Acceleration minus gravity, (0, 0, +9.81) in level flight [m/s²], shape (N, 3)."""
    angular_rate: Array
    """Angular rate [rad/s], shape (N, 3)."""
    attitude: Array | None = None
    """Bank and pitch for figures [rad], shape (N, 2); None if the file has none."""
    notes: tuple[str, ...] = ()
    """Parts of the file that are not used, as sentences."""
    columns: FlightColumns | None = None
    """Mapping of its file; None for arrays."""

    @property
    def duration(self) -> float:
        """Time of the last sample [s]."""
        return float(self.time[-1])

    @property
    def resultant_g(self) -> Array:
        """Size of the specific force divided by gravity [-], shape (N,)."""
        return np.asarray(np.linalg.norm(self.specific_force, axis=1) / GRAVITY)

    def at(self, time: Array) -> tuple[Array, Array]:
        """Return specific force and angular rate at times [s], shape (M, 3) each.

        Before and after the flight they are those of the first and last sample.
        """
        return (
            interpolated(time, self.time, self.specific_force),
            interpolated(time, self.time, self.angular_rate),
        )

    def means(self, time: Array, width: float) -> tuple[Array, Array]:
        """Return means of force and rate over `width` [s] around each time, shape (M, 3) each."""
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
    """Make a flight from arrays.

        >>> import numpy as np
        >>> time = np.arange(0.0, 3.0, 0.1)
        >>> level = np.tile([0.0, 0.0, 9.81], (30, 1))
        >>> round(make_flight(time, level, 0 * level).duration, 3)
        2.9

    Args:
        time: Increasing times [s], shape (N,).
        specific_force: Acceleration minus gravity [m/s²], shape (N, 3), axes x forward, y left,
            z up.
        angular_rate: Angular rate [rad/s], shape (N, 3), in the same axes.
        name: Name in reports.
        attitude: Bank and pitch for figures [rad], shape (N, 2).

    Raises:
        InputError: Shapes differ, times do not increase, samples are too far apart, or the flight
            lasts more than an hour.
    """
    for what, values in (("specific_force", specific_force), ("angular_rate", angular_rate)):
        if values.shape != (len(time), 3):
            raise InputError(f"shape {values.shape}, expected ({len(time)}, 3)", place=what)
    steps = np.diff(time)
    if len(time) < 2 or steps.min() <= 0:
        raise InputError(
            "expected at least 2 samples, each later than the one before", place="time"
        )
    if steps.max() > 1 / _MIN_SAMPLE_RATE:
        i, most = int(steps.argmax()), 1 / _MIN_SAMPLE_RATE
        raise InputError(
            f"{steps[i]:g} s between samples at {time[i]:g} s, expected at most {most:g} s",
            place="time",
        )
    if time[-1] - time[0] > _MAX_DURATION:
        raise InputError(
            f"{time[-1] - time[0]:g} s, expected at most {_MAX_DURATION:g} s", place="time"
        )
    return Flight(name, time - time[0], specific_force, angular_rate, attitude)


def load_flight_columns(path: str | Path) -> FlightColumns:
    """Load the mapping file of a flight recording.

    Raises:
        InputError: A field is bad; the error gives the file, the field and the accepted values.
    """
    return load_yaml(FlightColumns, path, "columns of a flight")[0]


def read_flight(path: str | Path, columns: FlightColumns | str | Path | None = None) -> Flight:
    """Read a recording of a flight.

    With a lever l from the head to the sensor, the head's force is f - alpha x l - omega x (omega x
    l). The angular acceleration alpha follows from differences of the rate.

        >>> read_flight("turn").duration
        73.9

    Args:
        path: Path of the file, or the name of a shipped flight.
        columns: Names and units of the columns, a mapping file, or the name of a shipped one.
            Without them and with other names in the file, the error contains a proposal.

    Raises:
        InputError: The file cannot be read; the error gives the file, and the column or line.
    """
    if isinstance(columns, str | Path):
        columns = load_flight_columns(columns)
    if columns is None:
        try:
            return read_flight(path, FlightColumns())
        except InputError as error:
            raise _with_proposal(error, path) from None
    numbers = read_numbers(find_file(path, "flight"), columns.style, logged=True)
    places = {
        x: _places(numbers, [c for c in getattr(columns, x) if c], x) for x in ("force", "omega")
    }
    if columns.drop_incomplete:
        numbers = numbers.complete([*places_of_time(numbers, columns), *chain(*places.values())])
    time = times_of(numbers, columns, MIN_RATE)
    attitude = _attitude(numbers, columns)
    notes = list(numbers.notes)
    force = columns.force_of(_values(numbers, places["force"]))
    if not columns.force[0]:
        speed = None
        if columns.speed:
            place = _places(numbers, [columns.speed], "speed")
            speed = columns.speed_factor * _values(numbers, place)[:, 0]
        assert attitude is not None
        force = np.column_stack([forward_force(time, attitude[:, 1], speed), force])
        notes.append("the forward force is from pitch" + " and airspeed" * bool(columns.speed))
    if columns.omega:
        rates = columns.rate_of(_values(numbers, places["omega"]))
    else:
        assert attitude is not None
        rates = rates_of(time, attitude)
        notes.append("rates are from the attitude")
    lever = np.array(columns.lever)
    flight = make_flight(*_cleaned(time, force, rates, lever, notes), numbers.path.stem)
    if attitude is not None:
        flight = replace(flight, attitude=interpolated(flight.time, time - time[0], attitude))
    return replace(flight, notes=tuple(notes), columns=columns)


def _attitude(numbers: Numbers, columns: FlightColumns) -> Array | None:
    """Return bank, pitch and perhaps heading [rad]; None if there is none and none is needed."""
    is_needed = not columns.omega or not columns.force[0]
    is_there = all(place_of(numbers, name) is not None for name in columns.attitude)
    if not (is_needed or (is_there and columns.attitude)):
        return None
    angles = _values(numbers, _places(numbers, columns.attitude, "attitude"))
    return np.radians(angles) if columns.attitude_unit == "deg" else angles


def _cleaned(
    time: Array, force: Array, rates: Array, lever: Array, notes: list[str]
) -> tuple[Array, Array, Array]:
    """Return time, force and rate of the head, without noise; append what was done to the notes."""
    finer, both = at_finer_times(time, np.hstack([force, rates]))
    if len(finer) != len(time):
        was, now = 1 / np.median(np.diff(time)), 1 / np.median(np.diff(finer))
        notes.append(f"its {was:.3g} Hz are interpolated to {now:.3g} Hz; what is quicker is lost")
    time, force, rates = finer, both[:, :3], both[:, 3:]
    # Noise of a gyro grows with the lever, as its differences are angular accelerations.
    step, arm = float(np.median(np.diff(time))), float(np.linalg.norm(lever))
    least = min(RATE_NOISE, FORCE_NOISE * step * 2**0.5 / arm) if arm else RATE_NOISE
    force, of_force = without_noise(time, force, FORCE_NOISE)
    rates, of_rates = without_noise(time, rates, least)
    for taken, what, unit in ((of_force, "force", "m/s²"), (of_rates, "rates", "rad/s")):
        if taken.any():
            sizes = ", ".join(f"{size:.3g}" for size in taken)
            said = f"white noise of {sizes} {unit} RMS is taken out of its {what}"
            notes.append(f"{said} by a smoothing spline")
    if arm:
        alpha = np.gradient(rates, time, axis=0)
        force = force - np.cross(alpha, lever) - np.cross(rates, np.cross(rates, lever))
    return time, force, rates


def _with_proposal(error: InputError, path: str | Path) -> InputError:
    """Return the error with a mapping that was tried, or the name of a shipped one that reads."""
    with suppress(InputError):  # no such file
        file = find_file(path, "flight")
        proposed = higher("machine.cueing.flight_proposal:proposal")(file)
        if proposed is not None:
            return proposed.after(error)
        for name in shipped("columns of a flight"):
            with suppress(InputError):
                text = f"{read_flight(file, name).duration:.4g} s of flight"
                first, *others = error.problems
                hint = f"{first.found}; the shipped mapping {name} (columns=...) reads {text}"
                return InputError(first._replace(found=hint), *others)
    return error


def _places(numbers: Numbers, names: Sequence[str], what: str) -> list[int]:
    """Return the places of columns given by names or numbers."""
    places = []
    for name in names:
        place = place_of(numbers, name)
        if place is None:
            raise missing_column(numbers, name, what)
        places.append(place)
    return places


def _values(numbers: Numbers, places: Sequence[int]) -> Array:
    """Return columns, shape (N, len(places))."""
    numbers.check_finite(places, or_else=OR_DROP)
    return np.asarray(numbers.data[:, places])
