"""Motions from CSV files of any sample period, at the interpolation period; what that loses."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pydrake.trajectories import PiecewisePolynomial

from sdt_drake.arrays import Array
from sdt_drake.errors import InputError, whole_periods
from sdt_drake.motion.trajectory import COLUMNS, Motion
from sdt_drake.tables import read_table

# What a joint may lose by resampling, of its speeds and of its angles:
_LOSS = 0.01  # of their range, and
_LOSS_SIZE = 1e-3  # rad/s, rad


@dataclass(frozen=True, eq=False)
class Loss:
    """Largest differences between a file and the resampled motion, at the samples of the file.

    Attributes:
        speed: [rad/s], shape (n,).
        speed_time: when that is, since the first sample [s], shape (n,).
        position: [rad], shape (n,).
        position_time: when that is [s], shape (n,).
    """

    speed: Array
    speed_time: Array
    position: Array
    position_time: Array


def import_motion(path: str | Path, period: float) -> tuple[Motion, Loss | None]:
    """A motion from CSV: as it is if it is one of `Motion.to_csv` at `period`, else resampled.

    Of any other file `time` and v_ref_k or q_ref_k are read. Its times grow, in steps of any
    length, from any start. Speeds are linear between their samples; positions without speeds lie on
    a cubic spline. Without positions the motion starts at 0. It ends at the last sample or within a
    period after it.

    Args:
        path: the file.
        period: interpolation period [s].

    Raises:
        InputError: naming the file, and the line where there is one: what `read_table` or
            `Motion.from_csv` refuse; neither v_ref nor q_ref; a joint whose speeds or angles lose
            more than 1 % of their range and 1e-3 rad/s or rad.
    """
    time, columns = read_table(path, even=False)
    is_motion = all(name in columns for name in COLUMNS)
    if is_motion and np.all(np.abs(np.diff(time) - period) <= 1e-6 * period):
        return Motion.from_csv(path), None
    return resampled(path, time, columns.get("q_ref"), columns.get("v_ref"), period)


def resampled(
    where: str | Path, time: Array, q: Array | None, v: Array | None, period: float
) -> tuple[Motion, Loss]:
    """The same of samples: q [rad] or v [rad/s] or both, shape (N, n), at growing times [s].

    Raises:
        InputError: as `import_motion`, naming `where`.
    """
    if v is not None and q is not None and v.shape != q.shape:
        raise InputError(f"{where}: q_ref and v_ref differ in their number of joints")
    time = time - time[0]
    last = np.ceil(time[-1] / period - 1e-6) * period
    t = np.arange(whole_periods(last, period, str(where)) + 1.0) * period
    if v is not None:
        if q is None:
            steps = np.diff(time)[:, None] * (v[1:] + v[:-1]) / 2
            q = np.vstack([np.zeros_like(v[:1]), np.cumsum(steps, axis=0)])
        motion = Motion.from_speeds(period, q[0], interpolated(t, time, v))
    elif q is not None:
        v, motion = _from_positions(time, q, t, period)
    else:
        raise InputError(f"{where}: neither v_ref_1 nor q_ref_1, expected time and one for a joint")
    return motion, _checked_loss(where, motion, time, q, v)


def interpolated(t: Array, time: Array, values: Array) -> Array:
    """Columns of samples at `time`, shape (N, n), linearly at `t`, shape (M,): shape (M, n)."""
    return np.stack([np.interp(t, time, column) for column in values.T], axis=1)


def _from_positions(time: Array, q: Array, t: Array, period: float) -> tuple[Array, Motion]:
    """Speeds at the samples, and the motion."""
    if len(time) < 4:  # too few for a spline
        course = PiecewisePolynomial.FirstOrderHold(time, q.T)
    else:
        course = PiecewisePolynomial.CubicWithContinuousSecondDerivatives(time, q.T)
    v = course.derivative().vector_values(time).T
    within = np.minimum(t, time[-1])
    positions = course.vector_values(within).T + (t - within)[:, None] * v[-1]
    # What gives the central differences the speeds of the course at its ends.
    before, after = positions[1] - 2 * period * v[0], positions[-2] + 2 * period * v[-1]
    return v, Motion.from_positions(period, np.vstack([before, positions, after]))


def _checked_loss(where: str | Path, motion: Motion, time: Array, q: Array, v: Array) -> Loss:
    found = []
    for what, unit, given, got in (
        ("speed", "rad/s", v, interpolated(time, motion.time, motion.v)),
        ("position", "rad", q, motion.trajectory.vector_values(list(time)).T),
    ):
        off = np.abs(got - given)
        size, at = off.max(axis=0), time[off.argmax(axis=0)]
        allowed = _LOSS * np.ptp(given, axis=0) + _LOSS_SIZE
        if np.any(size > allowed):
            k = int(np.argmax(size / allowed))
            raise InputError(
                f"{where}: resampled at {motion.period:g} s joint {k + 1} loses {size[k]:.3g} "
                f"{unit} of {what} at {at[k]:.6g} s, allowed are {allowed[k]:.3g} {unit} (1 % of "
                f"its range + {_LOSS_SIZE:g}); expected a smoother motion or a shorter period"
            )
        found += [size, at]
    return Loss(*found)
