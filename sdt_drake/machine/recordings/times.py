"""Times of the rows of a recording, and units that they may be in."""

from pathlib import Path

import numpy as np

from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError
from sdt_drake.io.numbers import Numbers
from sdt_drake.machine.recordings.columns import Layout
from sdt_drake.machine.recordings.places import missing, place_of
from sdt_drake.machine.recordings.recorded import Recorded

_LEAST_RATE, _USUAL_RATE, _MOST_RATE = 5.0, 300.0, 1e5  # Hz; of samples of a robot that moves
_UNITS = {1e-9: "nanoseconds", 1e-6: "microseconds", 1e-3: "milliseconds", 1.0: "seconds",
          60.0: "minutes", 3600.0: "hours", 86400.0: "days"}  # fmt: skip
_SHORTEST, _LONGEST = 0.5, 10.0  # of a motion, that a recording of it lasts


def times_of(numbers: Numbers, columns: Layout) -> Array:
    """Times of the rows, from 0 [s].

    Raises:
        InputError: naming the file and the line, for a time that is missing, does not grow, or goes
            in steps that nobody records in.
    """
    time = _times(numbers, columns)
    _check_rate(numbers.path, columns, time)
    return time


def likely_factor(step: float) -> float:
    """The unit that times in such steps are in [s]: seconds, if a robot may be recorded so."""
    if _LEAST_RATE <= 1 / step <= _MOST_RATE:
        return 1.0
    return min(_UNITS, key=lambda x: abs(np.log(x * step * _USUAL_RATE)))


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
