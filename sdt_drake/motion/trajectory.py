"""A motion: the reference of all joints at the interpolation period, as Drake trajectories."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from pydrake.trajectories import PiecewisePolynomial, Trajectory

import sdt_drake
from sdt_drake.arrays import Array
from sdt_drake.errors import InputError
from sdt_drake.shown import Shown, Summary, of_joints
from sdt_drake.tables import check_columns, data_frame, read_table, write_table

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

COLUMNS = ("q_ref", "v_ref", "vd_ref")


@dataclass(frozen=True, eq=False, repr=False)
class Motion(Shown):
    """Joint positions, speeds and accelerations at time i * period, i = 0..N; joint side.

    The acceleration of sample i holds until sample i + 1, so speeds are piecewise linear and
    positions piecewise quadratic.

    Attributes:
        period: interpolation period [s].
        q: positions [rad], shape (N + 1, n).
        v: speeds [rad/s], shape (N + 1, n).
        vd: accelerations [rad/s²], shape (N + 1, n); the last row is 0.
    """

    period: float
    q: Array
    v: Array
    vd: Array

    @staticmethod
    def from_speeds(period: float, q0: Array, v: Array) -> Motion:
        """The motion through speeds of shape (N + 1, n), starting at `q0` [rad]."""
        vd = np.vstack([np.diff(v, axis=0) / period, np.zeros_like(v[:1])])
        steps = (v[1:] + v[:-1]) * (period / 2)
        q = np.vstack([q0, q0 + np.cumsum(steps, axis=0)])
        return Motion(period, q, v, vd)

    @staticmethod
    def from_positions(period: float, q: Array) -> Motion:
        """The motion by positions `q` at (i - 1) * period, i = 0..N + 2, shape (N + 3, n).

        Its speeds are central differences: v_i = (q_i+1 - q_i-1) / (2 h). So its positions are
        q_i + (q_i+1 - 2 q_i + q_i-1) / 4; they are off by a h² / 4 where the acceleration is a, and
        this does not add up.
        """
        v = (q[2:] - q[:-2]) / (2 * period)
        return Motion.from_speeds(period, (q[0] + 2 * q[1] + q[2]) / 4, v)

    @property
    def n(self) -> int:
        """Number of joints."""
        return self.q.shape[1]

    @property
    def time(self) -> Array:
        """i * period [s], shape (N + 1,): the very numbers at which a Drake simulator samples."""
        return np.arange(float(len(self.q))) * self.period

    @property
    def duration(self) -> float:
        """Time of the last sample [s]."""
        return (len(self.q) - 1) * self.period

    @property
    def trajectory(self) -> Trajectory:
        """Joint positions as a Drake trajectory; its derivatives are speed and acceleration.

        A cubic through positions and speeds is exact here: the positions are quadratic.
        """
        return PiecewisePolynomial.CubicHermite(self.time, self.q.T, self.v.T)

    def summary(self) -> Summary:
        degrees = np.degrees(self.q)
        columns = {
            "from [deg]": (".1f", degrees.min(axis=0)),
            "to [deg]": (".1f", degrees.max(axis=0)),
            "speed [rad/s]": (".4g", np.abs(self.v).max(axis=0)),
            "acceleration [rad/s²]": (".4g", np.abs(self.vd).max(axis=0)),
        }
        return of_joints(f"of {self.n} joints: {self.in_time}", columns)

    @property
    def in_time(self) -> str:
        """Its time in words."""
        return f"{self.duration:.9g} s in steps of {1000 * self.period:.6g} ms"

    def plot(self, joint_names: Sequence[str] = ()) -> Figure:
        """Positions, speeds and accelerations over time."""
        names = joint_names or [f"{k + 1}" for k in range(self.n)]
        return sdt_drake.plots.trajectories("Motion", self, names)

    def to_pandas(self) -> pd.DataFrame:
        """A table of q_ref_k, v_ref_k, vd_ref_k, its index the time.

        Raises:
            InputError: where pandas is not installed.
        """
        return data_frame(self.time, self.columns)

    @property
    def columns(self) -> dict[str, Array]:
        """What goes into tables, by COLUMNS."""
        return dict(zip(COLUMNS, (self.q, self.v, self.vd), strict=True))

    def to_csv(self, path: str | Path) -> None:
        """Write time, q_ref_k, v_ref_k, vd_ref_k, exactly."""
        write_table(path, self.time, self.columns)

    @staticmethod
    def from_csv(path: str | Path) -> Motion:
        """Read what `to_csv` writes; further columns are ignored.

        Raises:
            InputError: naming the file and the line: missing columns, gaps in time, numbers that
                are not finite, positions or speeds that are not the integral of what follows.
        """
        time, columns = read_table(path)
        expected = "time, q_ref_k, v_ref_k, vd_ref_k for every joint k"
        check_columns(path, columns, COLUMNS, expected)
        if time[0] != 0:
            raise InputError(f"{path}, line 2: time starts at {time[0]:g} s, expected 0")
        # i * period is what `to_csv` writes; a file with rounded times has its period on average.
        period = float(time[1])
        if abs(period * (len(time) - 1) - time[-1]) > 1e-6 * period:
            period = float(time[-1] / (len(time) - 1))
        motion = Motion(period, *(columns[name] for name in COLUMNS))
        motion._check_integrals(path)
        return motion

    def _check_integrals(self, path: str | Path) -> None:
        """Refuse accelerations and positions that the speeds contradict."""
        integral = Motion.from_speeds(self.period, self.q[0], self.v)
        off_speed = np.abs(self.vd - integral.vd) * self.period
        for name, off, own, right in (
            ("vd_ref", off_speed > 1e-6 * (1 + np.abs(self.v)), self.vd, integral.vd),
            ("q_ref", np.abs(self.q - integral.q) > 1e-4, self.q, integral.q),
        ):
            for i, k in np.argwhere(off):
                raise InputError(
                    f"{path}, line {i + 2}: {name}_{k + 1} does not fit v_ref_{k + 1}: "
                    f"{own[i, k]:.9g}, the speeds give {right[i, k]:.9g}"
                )
