"""Recordings of robots: what their files call the columns, and the same for all from there on."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field

from sdt_drake.io.arrays import Array, Index
from sdt_drake.io.errors import InputError
from sdt_drake.io.fields import EachJoint, Input, Number, OneOf, Positive, Problems, Some, setting
from sdt_drake.io.shown import listed
from sdt_drake.io.tables import Numbers, read_numbers
from sdt_drake.io.yaml_files import load_yaml
from sdt_drake.motion.trajectory import interpolated
from sdt_drake.robot.robot import Robot

SIDES = ("joint", "motor")
DELIMITERS = {"comma": ",", "semicolon": ";", "tab": "\t", "space": None}
_ANGLES = ("q", "v", "q_ref", "v_ref", "vd_ref")
_TORQUES = ("tau", "tau_mean", "tau_ff")
RECORDED_SIGNALS = (*_ANGLES, *_TORQUES)
"""Of each joint: position, speed, torque of the motor, its mean over the period that ends there;
what was asked for; torque fed forward."""

_GAP = 4.0  # of the usual step
_LEAST_RATE, _USUAL_RATE, _MOST_RATE = 5.0, 300.0, 1e5  # Hz; of samples of a robot that moves
_UNITS = {1e-9: "nanoseconds", 1e-6: "microseconds", 1e-3: "milliseconds", 1.0: "seconds",
          60.0: "minutes", 3600.0: "hours", 86400.0: "days"}  # fmt: skip
_SHORTEST, _LONGEST = 0.5, 10.0  # of a motion, that a recording of it lasts
_OWN = ("tau_cmd", "tau_limited", "load_torque")  # columns that `simulate` writes


@dataclass
class Layout(Input):
    """How a file of columns is read, and how it says when its rows are."""

    delimiter: Annotated[str, OneOf(tuple(DELIMITERS))] = "comma"
    """Between columns: comma, semicolon, tab or space (any blanks)."""
    header: bool = True
    """Whether a line with names comes first."""
    skip: int = setting(0, ge=0, le=1000, unit="-")
    """Lines before that."""
    time: str = "time"
    """Column of the time; "" where there is none, but a rate."""
    time_factor: Positive = setting(1.0, unit="s")
    """What a 1 in that column is."""
    rate: Positive | None = setting(None, unit="Hz")
    """Samples in a second, where there is no time."""

    def problems(self) -> Problems:
        if (self.time == "") == (self.rate is None):
            text = (
                "missing, expected one where time is empty" if not self.time else "needs time: ''"
            )
            yield "rate", text


@dataclass
class Columns(Layout):
    """How a recording's file says what it holds; the default is that of this package.

    A signal is a list of columns, one for each joint from the base to the tip, by their names or,
    counted from 1, their numbers; or one text in which {k} stands for the number of the joint. What
    is not there has none: [].
    """

    q: Some[str] = setting(["q_{k}"])
    """Columns of the positions."""
    v: list[str] = setting(["v_{k}"])
    """Columns of the speeds, which are not needed."""
    tau: Some[str] = setting(["tau_{k}"])
    """Columns of the torques."""
    tau_mean: list[str] = setting(["tau_mean_{k}"])
    """Columns of the mean torques since the sample before; `identify` prefers them."""
    q_ref: list[str] = setting(["q_ref_{k}"])
    """Columns of the position reference, for `replay`."""
    v_ref: list[str] = setting(["v_ref_{k}"])
    """Columns of the speed reference, likewise."""
    vd_ref: list[str] = setting(["vd_ref_{k}"])
    """Columns of the acceleration reference, likewise."""
    tau_ff: list[str] = setting(["tau_ff_{k}"])
    """Columns of the torque feedforward, likewise."""
    angle: Annotated[str, OneOf(("rad", "deg"))] = "rad"
    """"rad" or "deg", of positions and speeds."""
    side: Annotated[str, OneOf(SIDES)] | None = None
    """"joint" or "motor", of torques. That of a recording of `simulate` is known."""
    position_offset: EachJoint[Number] | None = setting(None, unit="rad", side="joint")
    """Added to q and q_ref; 0 by default."""
    direction: EachJoint[Annotated[Number, Field(ge=-1, le=1)]] | None = setting(None, unit="-")
    """1, or -1 for a joint whose positions, speeds and torques are counted the other way than
    in the robot's file; 1 by default."""
    torque_delay: Number = setting(0.0, ge=-1, le=1, unit="s")
    """By how much tau is recorded later than positions, as half the period of a drive that
    holds it."""
    torque_factor: EachJoint[Number] | None = setting(None, unit="N m per unit")
    """What turns the columns of torques, perhaps currents, into torques; 1 by default."""

    def problems(self) -> Problems:
        yield from Layout.problems(self)
        if any(abs(x) != 1 for x in self.direction or []):
            yield "direction", f"{self.direction}, expected 1 and -1"
        if any(x == 0 for x in self.torque_factor or []):
            yield "torque_factor", f"{self.torque_factor}, expected no 0"


@dataclass(frozen=True, eq=False)
class Recorded:
    """A recording of a robot, **joint side**, as it was sampled.

    Attributes:
        path: of the file.
        time: growing, not always in equal steps [s], shape (N,).
        signals: those of RECORDED_SIGNALS that there are [rad, rad/s, rad/s², N m], each of shape
            (N, n).
        of_links: whether q and v are those of the links, as `simulate` writes them, and not of what
            encoders are on.
        time_factor: what a 1 in the column of times was taken for [s]; None without such a column.
    """

    path: Path
    time: Array
    signals: dict[str, Array]
    of_links: bool = False
    time_factor: float | None = 1.0

    @property
    def gaps(self) -> Index:
        """Rows, from 0, after which nobody knows what happened until the next one."""
        steps = np.diff(self.time)
        return np.flatnonzero(steps > _GAP * np.median(steps))

    @property
    def gaps_in_words(self) -> str:
        """How many gaps there are, and where the longest one is; "" for none."""
        if not len(self.gaps):
            return ""
        steps = np.diff(self.time)
        i = self.gaps[steps[self.gaps].argmax()]
        longest = f"the longest {steps[i]:.3g} s at {self.time[i]:.3g} s"
        return f"{len(self.gaps)} gap(s) in time, {longest}"


def load_columns(path: str | Path) -> Columns:
    """The mapping file of a recording.

    Raises:
        InputError: naming the file, the field, and what would be right.
    """
    return load_yaml(Columns, path)[0]


def read_recording(
    path: str | Path,
    robot: Robot,
    columns: Columns | None = None,
    *,
    needs: Sequence[str] = ("q", "tau"),
    side: str | None = None,
) -> Recorded:
    """Read a recording.

    Args:
        path: of the file.
        robot: whose joints it has; gives the gear ratios.
        columns: what its file calls them.
        needs: of RECORDED_SIGNALS, what must be there; others are read if they are.
        side: of the torques, whatever `columns` say; where neither says it, that of the motors if
            `simulate` has written the file, else the joints'.

    Raises:
        InputError: naming the file, and the column or line: what `read_numbers` refuses, a column
            that is missing, or there twice, another number of joints, a time that does not grow,
            or in steps that nobody records in, a number that is not finite.
    """
    columns = columns or Columns()
    numbers = read_numbers(
        path,
        delimiter=DELIMITERS[columns.delimiter],
        header=columns.header,
        skip=columns.skip,
        texts=True,
    )
    own = all(f"{name}_1" in numbers.names for name in _OWN)
    side = side or columns.side or ("motor" if own else "joint")
    time = times_of(numbers, columns)
    conversions = _conversions(robot, columns, side)
    signals = {}
    for name in RECORDED_SIGNALS:
        names = getattr(columns, name)
        is_named = bool(names) and names != getattr(Columns(), name)
        found = _found(numbers, names, name, robot.n, needed=is_named or name in needs)
        if found:
            numbers.check_finite(found)
            signals[name] = numbers.data[:, found]
            if name == "tau" and columns.torque_delay != 0:
                signals[name] = interpolated(time + columns.torque_delay, time, signals[name])
            signals[name] *= conversions[name][0]  # in place: a file may be long
            signals[name] += conversions[name][1]
    factor = columns.time_factor if columns.rate is None else None
    return Recorded(numbers.path, time, signals, own, factor)


def check_different(recordings: Sequence[Recorded]) -> None:
    """Refuse a recording that says what another one does, whatever their files are called.

    Raises:
        InputError: naming both files.
    """
    for i, one in enumerate(recordings):
        for other in recordings[:i]:
            pairs = ((values, other.signals.get(name)) for name, values in one.signals.items())
            if len(one.signals) == len(other.signals) and all(
                x is y or (y is not None and np.array_equal(x, y)) for x, y in pairs
            ):
                raise InputError(
                    f"{one.path}: holds the same as {other.path}, expected another recording"
                )


def other_unit(recorded: Recorded, moving: float) -> str:
    """A unit of time in which a recording of a motion would be as long as that, as the end of a
    sentence; "" for none, or if it is.

    Args:
        recorded: what seems to be of another motion.
        moving: how long the motion moves [s].
    """
    if recorded.time_factor is None:
        return ""
    lasts, step = (
        float(x) / recorded.time_factor
        for x in (recorded.time[-1], np.median(np.diff(recorded.time)))
    )
    factor = min(_UNITS, key=lambda x: abs(np.log(x * lasts / moving)))
    fits = _SHORTEST <= factor * lasts / moving <= _LONGEST
    is_likely = fits and _LEAST_RATE <= 1 / (factor * step) <= _MOST_RATE
    if factor == recorded.time_factor or not is_likely:
        return ""
    return (
        f"; in {_UNITS[factor]} it would last {factor * lasts:.4g} s, time_factor: {factor:g} in "
        "the mapping file (--columns)"
    )


def times_of(numbers: Numbers, columns: Layout) -> Array:
    """Times of the rows, from 0 [s].

    Raises:
        InputError: naming the file and the line, for a time that is missing, does not grow, or goes
            in steps that nobody records in.
    """
    time = _times(numbers, columns)
    _check_rate(numbers.path, columns, time)
    return time


def _times(numbers: Numbers, columns: Layout) -> Array:
    if columns.rate is not None:
        return np.arange(len(numbers.data)) / columns.rate
    place = place_of(numbers, columns.time)
    if place is None:
        raise missing(numbers, columns.time, "time")
    numbers.check_finite([place])
    time = (numbers.data[:, place] - numbers.data[0, place]) * columns.time_factor
    bad = np.flatnonzero(np.diff(time) <= 0)
    if len(bad):
        before, after = numbers.data[bad[0] : bad[0] + 2, place]
        raise InputError(
            f"{numbers.place(bad[0] + 1)}: {columns.time} goes from "
            f"{before:.12g} to {after:.12g}, expected a growing time"
        )
    return time


def _check_rate(path: Path, columns: Layout, time: Array) -> None:
    """Refuse samples that are much slower or faster than those of a robot, naming the setting of
    `Columns` that would make sense."""
    rate = 1 / float(np.median(np.diff(time)))
    if _LEAST_RATE <= rate <= _MOST_RATE:
        return
    if columns.rate is not None:  # in kHz, or a period
        hints = {x: f"rate: {x:g}" for x in (1e3 * rate, 1e-3 * rate, 1 / rate)}
    else:
        counted = rate * columns.time_factor
        hints = {
            counted / x: f"in {unit} it would be {counted / x:.4g} Hz, time_factor: {x:g}"
            for x, unit in _UNITS.items()
        }
    better = min(hints, key=lambda x: abs(np.log(x / _USUAL_RATE)))
    is_likely = _LEAST_RATE <= better <= _MOST_RATE
    raise InputError(
        f"{path}: {columns.time or 'rate'}: {len(time)} samples in {time[-1]:.4g} s, "
        f"{rate:.4g} Hz, expected {_LEAST_RATE:g} to {_MOST_RATE:g} Hz"
        + f"; {hints[better]} in the mapping file (--columns)"
        * is_likely
    )


def _found(
    numbers: Numbers, names: list[str], signal: str, n: int, *, needed: bool
) -> list[int] | None:
    """The columns of a signal; None if it has none and need not."""
    if not names and not needed:
        return None
    pattern = names[0] if len(names) == 1 and "{k}" in names[0] else None
    said = [pattern.replace("{k}", str(k + 1)) for k in range(n + 1)] if pattern else names
    places = [place_of(numbers, name) for name in said]
    if pattern:
        one_more = places.pop() is not None
        if one_more or (places[0] is not None and None in places):
            count = n + 1 if one_more else n - places.count(None)
            told = (
                f"{count} {'or more ' if one_more else ''}column(s) {pattern.replace('{k}', 'k')}"
            )
            raise InputError(f"{numbers.path}: {told} ({signal}), but the robot has {n} joint(s)")
    elif len(places) != n:
        raise InputError(f"{signal}: {len(names)} column(s), but the robot has {n} joint(s)")
    found = [place for place in places if place is not None]
    if len(found) == n:
        twice = [name for name, place in zip(said, places, strict=False) if places.count(place) > 1]
        if twice:
            raise InputError(
                f"{numbers.path}: {signal}: {listed(twice)} are one column, expected one for each "
                "joint"
            )
        return found
    if needed or found:
        raise missing(numbers, said[places.index(None)], signal)
    return None


def place_of(numbers: Numbers, name: str) -> int | None:
    """Place of a column, by its name or number; None if there is none."""
    if numbers.names.count(name) > 1:
        raise InputError(
            f"{numbers.path}: {numbers.names.count(name)} columns '{name}', expected one; a "
            "mapping file (--columns) may name it by its number"
        )
    if name in numbers.names:
        return numbers.names.index(name)
    is_number = name.isdecimal() and 0 < int(name) <= len(numbers.names)
    return int(name) - 1 if is_number else None


def missing(numbers: Numbers, name: str, signal: str) -> InputError:
    """The error of a column that is not there."""
    there = ", ".join(numbers.names[:12]) + (", ..." if len(numbers.names) > 12 else "")
    return InputError(
        f"{numbers.path}: no column '{name}' ({signal}), there are {there}; a mapping file "
        "(--columns) names others"
    )


def _conversions(robot: Robot, columns: Columns, side: str) -> dict[str, tuple[Array, Array]]:
    """Factor and offset of each signal to SI units, joint side, counted as in the robot's file,
    shapes (n,)."""
    n, angle = robot.n, np.pi / 180 if columns.angle == "deg" else 1.0
    direction, offset, torque = (
        np.full(n, default) if values is None else _each(values, name, n)
        for name, values, default in (
            ("direction", columns.direction, 1.0),
            ("position_offset", columns.position_offset, 0.0),
            ("torque_factor", columns.torque_factor, 1.0),
        )
    )
    torque = torque * (robot.gear_ratio if side == "motor" else 1.0)
    factors = dict.fromkeys(_ANGLES, angle * direction) | dict.fromkeys(
        _TORQUES, torque * direction
    )
    return {
        name: (factor, offset if name in ("q", "q_ref") else np.zeros(n))
        for name, factor in factors.items()
    }


def _each(values: list[float], name: str, n: int) -> Array:
    if len(values) != n:
        raise InputError(f"{name}: {len(values)} value(s), but the robot has {n} joint(s)")
    return np.array(values)
