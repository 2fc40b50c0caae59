"""Find the motion in a recording of a trial, and check that it is the expected one."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.signal import correlate

from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError
from sdt_drake.machine.diagnose import constants as c
from sdt_drake.machine.learn.filter import LearningFilter, through
from sdt_drake.machine.recordings.recorded import Recorded
from sdt_drake.machine.recordings.times import other_unit
from sdt_drake.motion import Motion
from sdt_drake.run.design import Design

_ITERATIONS = 5  # Gauss-Newton steps to find the start to a fraction of a sample


@dataclass(frozen=True, eq=False)
class Matched:
    """A recording at the samples of the motion."""

    q: Array
    """Positions at the samples of the motion [rad], shape (N + 1, n)."""
    shift: float
    """Start of the motion in the recording's time [s]."""
    reference: int
    """Index of the recorded reference among the given ones; -1 if no reference was recorded."""


def match(
    recorded: Recorded, design: Design, filter_: LearningFilter, references: Sequence[Motion]
) -> Matched:
    """Find a motion in a recording.

    A recorded reference is compared with all `references`, and gives the start to a fraction of a
    sample. Without one, the last of `references` is assumed. Its start follows from the positions,
    to one sample, since a smaller shift looks like a tracking error. For the same reason, a start
    within two samples of the recording's start is rounded to it.

    Args:
        recorded: recording with positions, joint side, and possibly their reference.
        design: design of the loop.
        filter_: learning filter for the loop.
        references: references that may have been flown; the last one is expected.

    Raises:
        InputError: with the file, for gaps, too few samples, an incomplete motion, or another one.
    """
    first, last = _moving(recorded, references[-1])
    _check_samples(recorded, filter_, last - first)
    q_ref, number = recorded.signals.get("q_ref"), -1
    if q_ref is None or recorded.of_links:  # files of `simulate` have the planned motion as q_ref
        shift = _coarse(recorded, recorded.signals["q"], _expected(filter_, references[-1]))
        near = 2.1 * max(design.reference.tracked.period, recorded.period)
        shift = 0.0 if abs(shift) < near else shift
    else:
        found = [found_reference(recorded, q_ref, reference) for reference in references]
        number = len(found) - 1 - int(np.argmin([one[0] for one in reversed(found)]))
        off, shift = found[number]
        if off > c.MAX_REFERENCE_ERROR:
            raise InputError(
                f"{recorded.path}: q_ref is up to {np.degrees(off):.3g} deg from the nearest "
                "reference that could be flown, expected a recording of one"
            )
    _check_whole(recorded, references[number], shift)
    q = _at(recorded, recorded.signals["q"], references[-1], shift)
    _check_motion(recorded, q, _expected(filter_, references[number]))
    return Matched(q, shift, number)


def _moving(recorded: Recorded, motion: Motion) -> tuple[float, float]:
    """Return the times at which a motion starts and stops moving [s]."""
    at = np.flatnonzero(np.any(np.abs(motion.v) > c.STANDS, axis=1))
    if not len(at):
        raise InputError(f"{recorded.path}: no joint moves in the motion, expected one that moves")
    return max(0, at[0] - 1) * motion.period, min(len(motion.v) - 1, at[-1] + 1) * motion.period


def _check_samples(recorded: Recorded, filter_: LearningFilter, moving: float) -> None:
    """Raise InputError for gaps, too few samples, or a recording shorter than `moving` [s]."""
    if len(recorded.time) < c.MIN_SAMPLES:
        raise InputError(
            f"{recorded.path}: {len(recorded.time)} samples, expected those of a whole motion"
        )
    steps = np.diff(recorded.time)
    usual = float(np.median(steps))
    i = int(steps.argmax())
    if steps[i] > c.MAX_GAP * usual:
        raise InputError(
            f"{recorded.path}: a gap from {recorded.time[i]:.6g} to {recorded.time[i + 1]:.6g} s, "
            f"expected steps of about {usual:.3g} s"
        )
    fastest = max(bandwidth.omega for bandwidth in filter_.bandwidth)
    longest = 2 * np.pi / fastest / c.MIN_SAMPLES
    hint = other_unit(recorded, moving)
    if usual > longest:
        raise InputError(
            f"{recorded.path}: a sample every {usual:.3g} s, expected at most {longest:.2g} s, "
            f"as errors are learned up to {fastest / (2 * np.pi):.3g} Hz{hint}"
        )
    if recorded.time[-1] < c.MIN_RECORDED * moving:
        raise InputError(
            f"{recorded.path}: lasts {recorded.time[-1]:.3g} s, expected the whole motion of "
            f"{moving:.4g} s{hint}"
        )


def _expected(filter_: LearningFilter, reference: Motion) -> Motion:
    """Return the positions that the loop's model reaches with a reference, as a motion."""
    period = reference.period
    q = reference.q + through(reference.q, filter_.answer - 1, filter_.omega, period)
    return Motion(period, q, np.gradient(q, period, axis=0), reference.vd)


def _coarse(recorded: Recorded, values: Array, motion: Motion) -> float:
    """Return the start of a motion in recorded positions, to one sample, by correlation [s]."""
    step = recorded.period
    first, last = np.divide(_moving(recorded, motion), step)
    own = np.arange(int(recorded.time[-1] / step) + 1.0) * step
    sought = np.arange(np.floor(first), last + 1) * step
    steps = (np.diff(np.interp(own, recorded.time, x)) for x in values.T)
    wanted = (np.diff(np.interp(sought, motion.time, q)) for q in motion.q.T)
    alike = sum(map(partial(correlate, method="fft"), steps, wanted))
    return float(np.argmax(alike) - (len(sought) - 2) - np.floor(first)) * step


def found_reference(
    recorded: Recorded, q_ref: Array, reference: Motion, near: float | None = None
) -> tuple[float, float]:
    """Return the largest distance of a recorded reference from this one [rad], and its start [s].

    The start is found to a fraction of a sample by Gauss-Newton iteration from `near` [s], by
    default from the largest correlation.
    """
    shift, tried = _coarse(recorded, q_ref, reference) if near is None else near, []
    for _ in range(_ITERATIONS):
        there = ~_missing(recorded, reference, shift)
        v = reference.v[there]
        if not v.any():
            break
        off = (reference.q - _at(recorded, q_ref, reference, shift))[there]
        tried.append((float(np.abs(off).max()), shift))
        shift += float(np.sum(v * off) / np.sum(v * v))
    return min(tried, default=(np.inf, shift))


def _at(recorded: Recorded, values: Array, motion: Motion, shift: float) -> Array:
    """Return recorded values at the samples of a motion; constant beyond the recording."""
    time = np.clip(motion.time + shift, recorded.time[0], recorded.time[-1])
    return CubicSpline(recorded.time, values)(time)


def _missing(recorded: Recorded, motion: Motion, shift: float) -> NDArray[np.bool_]:
    """Return the mask of a motion's samples that were not recorded, shape (N + 1,)."""
    first, last = recorded.time[[0, -1]] - shift
    slack = motion.period / 1000
    return (motion.time < first - slack) | (motion.time > last + slack)


def _check_whole(recorded: Recorded, motion: Motion, shift: float) -> None:
    """Raise InputError if the motion moves before or after the recording."""
    if np.any(np.abs(motion.v[_missing(recorded, motion, shift)]) > c.STANDS):
        first, last = recorded.time[[0, -1]] - shift
        raise InputError(
            f"{recorded.path}: contains {first:.3f} to {last:.3f} s of the motion, or another "
            f"motion; expected all of its {motion.duration:g} s"
        )


def _check_motion(recorded: Recorded, q: Array, expected: Motion) -> None:
    """Raise InputError for another motion, another order of joints, or another unit."""
    off = np.sqrt(np.mean((q - expected.q) ** 2, axis=0))
    v = np.gradient(q, expected.period, axis=0)
    off_speed = np.sqrt(np.mean((v - expected.v) ** 2, axis=0))
    allowed = c.MAX_RANGE_SHARE * np.ptp(expected.q, axis=0) + c.MAX_ANGLE
    allowed_speed = c.MAX_SPEED_SHARE * np.sqrt(np.mean(expected.v**2, axis=0)) + c.MAX_SPEED_ERROR
    bad = (off > allowed) | (off_speed > allowed_speed)
    if bad.any():
        k = int(bad.argmax())
        raise InputError(
            f"{recorded.path}: joint {k + 1} is {np.degrees(off[k]):.3g} deg and "
            f"{np.degrees(off_speed[k]):.3g} deg/s (RMS) from the motion that the model expects, "
            f"allowed are {np.degrees(allowed[k]):.3g} deg and {np.degrees(allowed_speed[k]):.3g} "
            "deg/s; check the motion, the order of the joints and the units"
        )
