"""Recordings of flights: when the motion begins in them, and whether it is that motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError
from sdt_drake.machine.learn.filter import LearningFilter, through
from sdt_drake.machine.recordings import Recorded, other_unit
from sdt_drake.motion import Motion
from sdt_drake.motion.trajectory import splined
from sdt_drake.run.design import Design

_GAP = 2.5  # usual steps of time
_SAMPLES = 4  # in a period of the bandwidth, at least
_SHORT = 0.5  # of the motion; what lasts less is of another one, or its time has another unit
_MOVES = 1e-6  # rad/s
_SAME = 1e-3  # rad; a recorded reference is one that it is near to
_OFF, _OFF_ANGLE = 0.1, 0.02  # of the joint's range, rad; positions of the same motion, RMS
_OFF_SPEED, _OFF_SLOW = 0.3, 0.02  # of the joint's speeds, rad/s; likewise
_ITERATIONS = 5  # to a part of a sample


@dataclass(frozen=True, eq=False)
class Matched:
    """A recording on the clock of the motion.

    Attributes:
        q: positions at the samples of the motion [rad], shape (N + 1, n).
        shift: when the motion begins, since the start of the recording [s].
        reference: number of the reference that was recorded, among those asked for; -1 where none
            was recorded, so that it was not seen.
    """

    q: Array
    shift: float
    reference: int


def match(
    recorded: Recorded, design: Design, filter_: LearningFilter, references: Sequence[Motion]
) -> Matched:
    """Find a motion in a recording.

    Where its reference is recorded, too, to a part of a sample, and only where it is one of
    `references`. Otherwise the last one is taken for flown, and found by the positions, to a
    sample: a shift of less could not be told from an error. For the same reason a recording that
    seems to begin within two samples of the motion is taken to begin with it.

    Args:
        recorded: positions, joint side, and perhaps their reference.
        design: of the loop.
        filter_: for it.
        references: that may have been flown; the last one is expected.

    Raises:
        InputError: naming the file: gaps, too few samples; a part of the motion that is missing;
            another motion.
    """
    first, last = _moving(recorded, references[-1])
    _check_samples(recorded, filter_, last - first)
    q_ref, number = recorded.signals.get("q_ref"), -1
    if q_ref is None or recorded.of_links:  # where `simulate` writes the planned motion
        shift = _coarse(recorded, recorded.signals["q"], _expected(filter_, references[-1]))
        near = 2.1 * max(design.motion.period, float(np.median(np.diff(recorded.time))))
        shift = 0.0 if abs(shift) < near else shift
    else:
        found = [_found(recorded, q_ref, reference) for reference in references]
        number = len(found) - 1 - int(np.argmin([one[0] for one in reversed(found)]))
        off, shift = found[number]
        if off > _SAME:
            raise InputError(
                f"{recorded.path}: its q_ref is up to {np.degrees(off):.3g} deg from the nearest "
                "reference that was to be flown, expected a recording of one"
            )
    _check_whole(recorded, references[number], shift)
    q = _at(recorded, recorded.signals["q"], references[-1], shift)
    _check_motion(recorded, q, _expected(filter_, references[number]))
    return Matched(q, shift, number)


def _moving(recorded: Recorded, motion: Motion) -> tuple[float, float]:
    """When joints begin to move in a motion, and when they come to rest [s]."""
    at = np.flatnonzero(np.any(np.abs(motion.v) > _MOVES, axis=1))
    if not len(at):
        raise InputError(f"{recorded.path}: nothing moves in the motion, so it cannot be found")
    return max(0, at[0] - 1) * motion.period, min(len(motion.v) - 1, at[-1] + 1) * motion.period


def _check_samples(recorded: Recorded, filter_: LearningFilter, moving: float) -> None:
    """Refuse gaps, too few samples, and a recording that is much shorter than the motion [s]."""
    if len(recorded.time) < _SAMPLES:
        raise InputError(
            f"{recorded.path}: {len(recorded.time)} samples, expected those of a whole motion"
        )
    steps = np.diff(recorded.time)
    usual = float(np.median(steps))
    i = int(steps.argmax())
    if steps[i] > _GAP * usual:
        raise InputError(
            f"{recorded.path}: a gap from {recorded.time[i]:.6g} to {recorded.time[i + 1]:.6g} s, "
            f"expected steps of about {usual:.3g} s"
        )
    fastest = max(bandwidth.omega for bandwidth in filter_.bandwidth)
    most = 2 * np.pi / fastest / _SAMPLES
    hint = other_unit(recorded, moving)
    if usual > most:
        raise InputError(
            f"{recorded.path}: a sample every {usual:.3g} s, expected every {most:.2g} s at least, "
            f"as errors are learned up to {fastest / (2 * np.pi):.3g} Hz{hint}"
        )
    if recorded.time[-1] < _SHORT * moving:
        raise InputError(
            f"{recorded.path}: lasts {recorded.time[-1]:.3g} s, expected all {moving:.4g} s in "
            f"which the motion moves{hint}"
        )


def _expected(filter_: LearningFilter, reference: Motion) -> Motion:
    """What the loop's model makes of a reference."""
    period = reference.period
    q = reference.q + through(reference.q, filter_.answer - 1, filter_.omega, period)
    return Motion(period, q, np.gradient(q, period, axis=0), reference.vd)


def _coarse(recorded: Recorded, values: Array, motion: Motion) -> float:
    """When a motion begins in recorded positions, to a sample of the recording [s]."""
    step = float(np.median(np.diff(recorded.time)))
    first, last = np.divide(_moving(recorded, motion), step)
    own = np.arange(int(recorded.time[-1] / step) + 1.0) * step
    sought = np.arange(np.floor(first), last + 1) * step
    length = 2 ** (len(own) + len(sought) - 3).bit_length()
    alike = np.zeros(length // 2 + 1, dtype=complex)
    for x, q in zip(values.T, motion.q.T, strict=True):  # a joint at a time: a file may be long
        spectrum = np.fft.rfft(np.diff(np.interp(sought, motion.time, q)), length).conj()
        spectrum *= np.fft.rfft(np.diff(np.interp(own, recorded.time, x)), length)
        alike += spectrum
    lag = int(np.fft.irfft(alike, length).argmax())
    return float((lag - length if lag >= len(own) - 1 else lag) - np.floor(first)) * step


def _found(recorded: Recorded, q_ref: Array, reference: Motion) -> tuple[float, float]:
    """How far a recorded reference is from this one [rad], of what was recorded; and when it begins
    [s], to a part of a sample, by Gauss and Newton."""
    shift, tried = _coarse(recorded, q_ref, reference), []
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
    """Recorded values at the samples of a motion; at rest before and after the recording."""
    time = np.clip(motion.time + shift, recorded.time[0], recorded.time[-1])
    return splined(time, recorded.time, values)


def _missing(recorded: Recorded, motion: Motion, shift: float) -> NDArray[np.bool_]:
    """Which samples of a motion were not recorded, shape (N + 1,)."""
    first, last = recorded.time[[0, -1]] - shift
    slack = motion.period / 1000
    return (motion.time < first - slack) | (motion.time > last + slack)


def _check_whole(recorded: Recorded, motion: Motion, shift: float) -> None:
    """Refuse a motion that moves where it was not recorded."""
    if np.any(np.abs(motion.v[_missing(recorded, motion, shift)]) > _MOVES):
        first, last = recorded.time[[0, -1]] - shift
        raise InputError(
            f"{recorded.path}: has {first:.3f} to {last:.3f} s of the motion, or another one; "
            f"expected all of its {motion.duration:g} s"
        )


def _check_motion(recorded: Recorded, q: Array, expected: Motion) -> None:
    """Refuse another motion, joints in another order, another unit."""
    off = np.sqrt(np.mean((q - expected.q) ** 2, axis=0))
    v = np.gradient(q, expected.period, axis=0)
    off_speed = np.sqrt(np.mean((v - expected.v) ** 2, axis=0))
    allowed = _OFF * np.ptp(expected.q, axis=0) + _OFF_ANGLE
    allowed_speed = _OFF_SPEED * np.sqrt(np.mean(expected.v**2, axis=0)) + _OFF_SLOW
    bad = (off > allowed) | (off_speed > allowed_speed)
    if bad.any():
        k = int(bad.argmax())
        raise InputError(
            f"{recorded.path}: joint {k + 1} is {np.degrees(off[k]):.3g} deg and "
            f"{np.degrees(off_speed[k]):.3g} deg/s (RMS) from what its reference makes of it, "
            f"allowed are {np.degrees(allowed[k]):.3g} deg and {np.degrees(allowed_speed[k]):.3g} "
            "deg/s: another motion, another order of the joints, or another unit"
        )
