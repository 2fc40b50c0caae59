"""Times of the rows of a recording, and their likely unit."""

from pathlib import Path

import numpy as np

from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError
from sdt_drake.io.numbers import DAY, Numbers, is_number
from sdt_drake.machine.recordings.columns import Layout
from sdt_drake.machine.recordings.places import OR_DROP, missing, place_of
from sdt_drake.machine.recordings.recorded import Recorded

MIN_RATE = 5.0
"""Slowest rate of a robot's recorder [Hz]."""

_USUAL_RATE, _MAX_RATE = 300.0, 1e5  # Hz
_SLOW, _MIN_SECONDS = (0.5, 2.0), 3.0  # [Hz] of slow logs; [s] shortest one in another unit
_UNITS = {1e-9: "nanoseconds", 1e-6: "microseconds", 1e-3: "milliseconds", 1.0: "seconds",
          60.0: "minutes", 3600.0: "hours", 86400.0: "days"}  # fmt: skip
_MIN_LENGTH, _MAX_LENGTH = 0.5, 10.0  # duration of a recording over that of its motion


def times_of(numbers: Numbers, columns: Layout, least: float = MIN_RATE) -> Array:
    """Return the times of the rows, from 0 [s].

    Args:
        numbers: The file.
        columns: Its mapping.
        least: Slowest rate of its recorder [Hz].

    Raises:
        InputError: Times are missing, do not grow, or have steps that are not those of a recorder.
    """
    time = _times(numbers, columns)
    _check_rate(numbers.path, columns, time, least)
    return time


def places_of_time(numbers: Numbers, columns: Layout) -> list[int]:
    """Return the places of the columns of time that are there."""
    places = [place_of(numbers, name) for name in (columns.time, columns.nanoseconds) if name]
    return [place for place in places if place is not None]


def likely_factor(step: float, least: float) -> float:
    """Return the likely unit [s] of times with this step: 1 if the rate is that of a recorder."""
    if least <= 1 / step <= _MAX_RATE:
        return 1.0
    return min(_UNITS, key=lambda x: abs(np.log(x * step * _USUAL_RATE)))


def _times(numbers: Numbers, columns: Layout) -> Array:
    """Return the times of the rows, from 0 [s]."""
    if columns.rate is not None:
        rows = np.arange(len(numbers.data)) if numbers.kept is None else numbers.kept
        return (rows - rows[0]) / columns.rate
    place = place_of(numbers, columns.time)
    if place is None:
        raise missing(numbers, columns.time, "time")
    row, text = numbers.texts.get(place, (0, "0"))
    if not is_number(text.replace(",", ".")):
        raise InputError(
            f"{numbers.place(row)}: {columns.time} is '{text}', expected a number, a date or a "
            "time of day; or time: '' and rate: in Hz in a mapping file (columns=...)"
        )
    numbers.check_finite([place], dates=True, or_else=OR_DROP)
    time = numbers.data[:, place] - numbers.data[0, place]
    if place not in numbers.dates:
        time *= columns.time_factor
        if columns.nanoseconds:
            more = place_of(numbers, columns.nanoseconds)
            if more is None:
                raise missing(numbers, columns.nanoseconds, "nanoseconds")
            numbers.check_finite([more], or_else=OR_DROP)
            time += 1e-9 * (numbers.data[:, more] - numbers.data[0, more])
    elif columns.time_factor != 1:
        raise InputError(
            f"time_factor: {columns.time_factor:g}, expected 1, since {columns.time} of "
            f"{numbers.path} has dates or times of day"
        )
    elif numbers.data[:, place].max() < DAY:
        time = np.unwrap(time, period=DAY)  # over midnight
    bad = np.flatnonzero(np.diff(time) <= 0)
    if len(bad):
        before, after = numbers.data[bad[0] : bad[0] + 2, place]
        raise InputError(
            f"{numbers.place(bad[0] + 1)}: {columns.time} goes from "
            f"{before:.12g} to {after:.12g}, expected a growing time"
        )
    return time


def _check_rate(path: Path, columns: Layout, time: Array, least: float) -> None:
    """Refuse a rate that is not that of a recorder; the error gives a likely setting.

    Logs of 0.5 to 2 Hz are usual; another unit is likely only if they last some seconds in it.
    """
    rate = 1 / float(np.median(np.diff(time)))
    if least <= rate <= _MAX_RATE:
        return
    if columns.rate is not None:  # perhaps in kHz, or a period
        hints = {x: f"rate: {x:g}" for x in (1e3 * rate, 1e-3 * rate, 1 / rate)}
    else:
        counted = rate * columns.time_factor
        hints = {
            counted / x: f"in {unit} it would be {counted / x:.4g} Hz, time_factor: {x:g}"
            for x, unit in _UNITS.items()
        }
    better = min(hints, key=lambda x: abs(np.log(x / _USUAL_RATE)))
    is_slow = _SLOW[0] <= rate <= _SLOW[1] and len(time) < _MIN_SECONDS * better
    is_likely = MIN_RATE <= better <= _MAX_RATE and not is_slow
    raise InputError(
        f"{path}: {columns.time or 'rate'}: {len(time)} samples in {time[-1]:.4g} s, "
        f"{rate:.4g} Hz, expected {least:g} to {_MAX_RATE:g} Hz"
        + f"; {hints[better]} in the mapping file (columns=...)"
        * is_likely
    )


def other_unit(recorded: Recorded, moving: float) -> str:
    """Return a unit of time in which a recording would be as long as a motion.

    The result is the end of a sentence, or "" if no other unit fits.

    Args:
        recorded: A recording that does not fit the motion.
        moving: Time in which the motion moves [s].
    """
    if recorded.time_factor is None:
        return ""
    lasts, step = (
        float(x) / recorded.time_factor
        for x in (recorded.time[-1], np.median(np.diff(recorded.time)))
    )
    factor = min(_UNITS, key=lambda x: abs(np.log(x * lasts / moving)))
    fits = _MIN_LENGTH <= factor * lasts / moving <= _MAX_LENGTH
    is_likely = fits and MIN_RATE <= 1 / (factor * step) <= _MAX_RATE
    if factor == recorded.time_factor or not is_likely:
        return ""
    return (
        f"; in {_UNITS[factor]} it would last {factor * lasts:.4g} s, time_factor: {factor:g} in "
        "the mapping file (columns=...)"
    )
