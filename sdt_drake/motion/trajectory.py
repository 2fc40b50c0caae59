"""Motions of all joints at the interpolation period, and motion files of any sample period."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pydrake.trajectories import PiecewisePolynomial, Trajectory

from sdt_drake.io.arguments import a_path, finite, positive, takes, whole_periods
from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError
from sdt_drake.io.shown import DataFrame, Figure, Shown, Summary, higher, joint_count, of_joints
from sdt_drake.io.tables import check_columns, data_frame, read_table, write_table

MOTION_COLUMNS = ("q_ref", "v_ref", "vd_ref")


@dataclass(frozen=True, eq=False, repr=False)
class Motion(Shown):
    """Joint positions, speeds and accelerations at times i * period, i = 0..N; joint side.

    The acceleration of sample i holds until sample i + 1: speeds are piecewise linear and positions
    piecewise quadratic.

    >>> motion = Motion.from_speeds(0.5, [0.0], [[0.0], [1.0], [1.0]])
    >>> motion.q.ravel(), motion.vd.ravel()
    (array([0.  , 0.25, 0.75]), array([2., 0., 0.]))
    """

    period: float
    """Interpolation period [s]."""
    q: Array
    """Positions [rad], shape (N + 1, n)."""
    v: Array
    """Speeds [rad/s], shape (N + 1, n)."""
    vd: Array
    """Accelerations [rad/s²], shape (N + 1, n); the last row is 0."""

    def __post_init__(self) -> None:
        positive(self.period, "period")
        for name in ("q", "v", "vd"):
            object.__setattr__(self, name, np.asarray(getattr(self, name), dtype=float))
        shapes = [values.shape for values in (self.q, self.v, self.vd)]
        if len(shapes[0]) != 2 or len(set(shapes)) > 1:
            found = ", ".join(map(str, shapes))
            raise InputError(f"shapes {found}, expected (N + 1, n) for each", place="q, v, vd")

    @staticmethod
    @takes(period=positive, q0=finite("(n,)"), v=finite("(N + 1, n)"))
    def from_speeds(period: float, q0: Array, v: Array) -> "Motion":
        """Return the motion with speeds `v` [rad/s], shape (N + 1, n), from `q0` [rad], shape (n,).

        Raises:
            InputError: if an argument has another shape or is not finite.
        """
        if q0.shape != v.shape[1:]:
            raise InputError(f"{len(q0)} joint(s), expected {v.shape[1]} as in v", place="q0")
        vd = np.vstack([np.diff(v, axis=0) / period, np.zeros_like(v[:1])])
        steps = (v[1:] + v[:-1]) * (period / 2)
        q = np.vstack([q0, q0 + np.cumsum(steps, axis=0)])
        return Motion(period, q, v, vd)

    @staticmethod
    @takes(period=positive, q=finite("(N + 3, n)"))
    def from_positions(period: float, q: Array) -> "Motion":
        """Return the motion through positions at (i - 1) * period, i = 0..N + 2, shape (N + 3, n).

        The speeds are central differences: v_i = (q_i+1 - q_i-1) / (2 h). Its positions are then
        q_i + (q_i+1 - 2 q_i + q_i-1) / 4. The error is a h² / 4 at an acceleration a, and does not
        accumulate.

        Raises:
            InputError: if an argument has another shape or is not finite.
        """
        if len(q) < 3:
            raise InputError(f"{len(q)} row(s), expected at least 3", place="q")
        v = (q[2:] - q[:-2]) / (2 * period)
        return Motion.from_speeds(period, (q[0] + 2 * q[1] + q[2]) / 4, v)

    @property
    def n(self) -> int:
        """Number of joints."""
        return self.q.shape[1]

    @property
    def time(self) -> Array:
        """Times i * period [s], shape (N + 1,), bit by bit the sample times of Drake."""
        return np.arange(float(len(self.q))) * self.period

    @property
    def duration(self) -> float:
        """Time of the last sample [s]."""
        return (len(self.q) - 1) * self.period

    @property
    def trajectory(self) -> Trajectory:
        """Joint positions as a Drake trajectory; its derivatives are speed and acceleration.

        Cubics through positions and speeds are exact: the positions are quadratic.
        """
        return PiecewisePolynomial.CubicHermite(self.time, self.q.T, self.v.T)

    def summary(self) -> Summary:
        """Return duration, and range, largest speed and largest acceleration per joint."""
        degrees = np.degrees(self.q)
        columns = {
            "from [deg]": (".1f", degrees.min(axis=0)),
            "to [deg]": (".1f", degrees.max(axis=0)),
            "speed [rad/s]": (".4g", np.abs(self.v).max(axis=0)),
            "acceleration [rad/s²]": (".4g", np.abs(self.vd).max(axis=0)),
        }
        return of_joints(f"of {joint_count(self.n)}: {self.in_time}", columns)

    @property
    def in_time(self) -> str:
        """Phrase with duration and period."""
        return f"{self.duration:.9g} s in steps of {1000 * self.period:.6g} ms"

    def plot(self, joint_names: Sequence[str] = ()) -> Figure:
        """Draw positions, speeds and accelerations over time.

        Raises:
            InputError: if the number of names differs from that of the joints.
        """
        names = joint_names or [f"{k + 1}" for k in range(self.n)]
        if len(names) != self.n:
            raise InputError(f"{len(names)} name(s), expected {self.n}", place="joint_names")
        return higher("show.figures.runs:trajectories")("Motion", self, names)

    def to_pandas(self) -> DataFrame:
        """Return a table of q_ref_k, v_ref_k, vd_ref_k with time as its index.

        Raises:
            InputError: if pandas is not installed.
        """
        return data_frame(self.time, self.columns)

    @property
    def columns(self) -> dict[str, Array]:
        """Positions, speeds and accelerations by the names of their columns in motion files."""
        return dict(zip(MOTION_COLUMNS, (self.q, self.v, self.vd), strict=True))

    @takes(path=a_path)
    def to_csv(self, path: str | Path) -> None:
        """Write a motion file (CSV): time, q_ref_k, v_ref_k, vd_ref_k, without loss of digits."""
        write_table(path, self.time, self.columns)

    @staticmethod
    @takes(path=a_path)
    def from_csv(path: str | Path) -> "Motion":
        """Read a motion file that `to_csv` has written; further columns are ignored.

        Raises:
            InputError: with file and line: missing columns, gaps in time, numbers that are not
                finite, positions or accelerations that do not fit the speeds.
        """
        time, columns = read_table(path)
        expected = "time, q_ref_k, v_ref_k, vd_ref_k for every joint k"
        check_columns(path, columns, MOTION_COLUMNS, expected)
        if time[0] != 0:
            raise InputError(f"{path}, line 2: time starts at {time[0]:g} s, expected 0")
        # `to_csv` writes i * period. Of rounded times the mean step is the period.
        period = float(time[1])
        if abs(period * (len(time) - 1) - time[-1]) > 1e-6 * period:
            period = float(time[-1] / (len(time) - 1))
        own = Motion(period, *(columns[name] for name in MOTION_COLUMNS))
        integral = Motion.from_speeds(period, own.q[0], own.v)
        off_speed = np.abs(own.vd - integral.vd) * period
        for name, off, given, right in (
            ("vd_ref", off_speed > 1e-6 * (1 + np.abs(own.v)), own.vd, integral.vd),
            ("q_ref", np.abs(own.q - integral.q) > 1e-4, own.q, integral.q),
        ):
            for i, k in np.argwhere(off):
                raise InputError(
                    f"{path}, line {i + 2}: {name}_{k + 1} does not fit v_ref_{k + 1}: "
                    f"{given[i, k]:.9g}, the speeds give {right[i, k]:.9g}"
                )
        return own


# --- resampling ------------------------------------------------------------------------------

# Largest loss of speeds and angles by resampling:
_MAX_LOSS_SHARE = 0.01  # of their range [-], plus
_MAX_LOSS = 1e-3  # rad/s, rad


@dataclass(frozen=True, eq=False)
class Loss:
    """The largest differences between a motion file and its resampled motion, at its samples."""

    speed: Array
    """Largest difference of speed [rad/s], shape (n,)."""
    speed_time: Array
    """Time of that difference since the first sample [s], shape (n,)."""
    position: Array
    """Largest difference of position [rad], shape (n,)."""
    position_time: Array
    """Time of that difference since the first sample [s], shape (n,)."""
    longer: float
    """Duration of the motion minus that of the file [s]."""


def import_motion(path: str | Path, period: float) -> tuple[Motion, Loss | None]:
    """Read a motion file; resample it unless `Motion.to_csv` has written it at `period`.

    A file is resampled from its columns `time` and v_ref_k or q_ref_k (k = 1..n). Times start
    anywhere and grow in steps of any length. Speeds are linear between their samples; positions
    without speeds lie on a cubic spline. Without positions the motion starts at 0. The motion ends
    at the last sample or within a period after it.

    Args:
        path: motion file (CSV).
        period: interpolation period [s].

    Returns:
        The motion, and the loss by resampling or None.

    Raises:
        InputError: with file and line: see `read_table` and `Motion.from_csv`; no column v_ref_k or
            q_ref_k; a joint that loses more than 1 % of its range plus 1e-3 rad/s or rad.
    """
    time, columns = read_table(path, even=False)
    is_motion = all(name in columns for name in MOTION_COLUMNS)
    if is_motion and np.all(np.abs(np.diff(time) - period) <= 1e-6 * period):
        return Motion.from_csv(path), None
    return resampled(path, time, columns.get("q_ref"), columns.get("v_ref"), period)


def resampled(
    where: str | Path, time: Array, q: Array | None, v: Array | None, period: float
) -> tuple[Motion, Loss]:
    """Return a motion through samples at growing times, and the loss by resampling.

    Args:
        where: file in error messages.
        time: times of the samples [s], shape (N,).
        q, v: positions [rad] or speeds [rad/s] or both, shape (N, n).
        period: interpolation period [s].

    Raises:
        InputError: as `import_motion`.
    """
    if v is not None and q is not None and v.shape != q.shape:
        raise InputError(
            f"{where}: {q.shape[1]} column(s) q_ref_k and {v.shape[1]} v_ref_k, expected as many"
        )
    time = time - time[0]
    last = np.ceil(time[-1] / period - 1e-6) * period
    t = np.arange(whole_periods(last, period, str(where)) + 1.0) * period
    if v is not None:
        if q is None:
            steps = np.diff(time)[:, None] * (v[1:] + v[:-1]) / 2
            q = np.vstack([np.zeros_like(v[:1]), np.cumsum(steps, axis=0)])
        motion = Motion.from_speeds(period, q[0], interpolated(t, time, v))
    elif q is not None:
        from scipy.interpolate import CubicSpline  # it takes a third of a second

        spline = CubicSpline(time, q)
        v, within = spline(time, 1), np.minimum(t, time[-1])
        positions = spline(within) + (t - within)[:, None] * v[-1]
        # Extra samples: with them the central differences at the ends are the spline's speeds.
        before, after = positions[1] - 2 * period * v[0], positions[-2] + 2 * period * v[-1]
        motion = Motion.from_positions(period, np.vstack([before, positions, after]))
    else:
        raise InputError(
            f"{where}: neither v_ref_1 nor q_ref_1, expected time and one of them for each joint"
        )
    return motion, _checked_loss(where, motion, time, q, v)


def interpolated(t: Array, time: Array, values: Array) -> Array:
    """Interpolate samples (N, n) at `time` (N,) linearly at `t` (M,); return shape (M, n)."""
    return np.stack([np.interp(t, time, column) for column in values.T], axis=1)


def _checked_loss(where: str | Path, motion: Motion, time: Array, q: Array, v: Array) -> Loss:
    """Return the loss by resampling; refuse one that is too large."""
    found = []
    for what, unit, given, got in (
        ("speed", "rad/s", v, interpolated(time, motion.time, motion.v)),
        ("position", "rad", q, motion.trajectory.vector_values(list(time)).T),
    ):
        off = np.abs(got - given)
        size, at = off.max(axis=0), time[off.argmax(axis=0)]
        allowed = _MAX_LOSS_SHARE * np.ptp(given, axis=0) + _MAX_LOSS
        if np.any(size > allowed):
            k = int(np.argmax(size / allowed))
            raise InputError(
                f"{where}: resampled at {motion.period:g} s joint {k + 1} loses {size[k]:.3g} "
                f"{unit} of {what} at {at[k]:.6g} s, allowed are {allowed[k]:.3g} {unit} (1 % of "
                f"its range + {_MAX_LOSS:g}); expected a smoother motion or a shorter period"
            )
        found.append((size, at))
    return Loss(*found[0], *found[1], longer=motion.duration - float(time[-1]))
