"""A motion beside a flight: what is lost of it, and what is felt."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from sdt_drake.analysis.orientation import Percept, perceive
from sdt_drake.analysis.perception import CANAL, LINEAR, low_pass
from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError
from sdt_drake.machine.fly.flight import Flight
from sdt_drake.motion.retiming import torque_of_periods
from sdt_drake.motion.trajectory import Motion
from sdt_drake.robot.head import GRAVITY, HeadMotion, head_motion
from sdt_drake.robot.robot import Robot
from sdt_drake.systems.orientation import PerceptionModel


@dataclass(frozen=True, eq=False)
class Option:
    """A motion beside the flight.

    Attributes:
        name: for people.
        robot: that moves.
        motion: from rest to rest.
        flight: as flown.
        starts_at: when the flight starts in the motion [s].
        model: of the pilot.
    """

    name: str
    robot: Robot
    motion: Motion
    flight: Flight
    starts_at: float
    model: PerceptionModel

    @cached_property
    def time(self) -> Array:
        """Of the motion, from the start of the flight [s], shape (N + 1,)."""
        return self.motion.time - self.starts_at

    @property
    def within(self) -> slice:
        """Samples of the flight."""
        period = self.motion.period
        first = round(self.starts_at / period)
        return slice(first, first + round(self.flight.duration / period) + 1)

    @cached_property
    def head(self) -> HeadMotion:
        """Of the device."""
        return head_motion(self.robot, self.motion.q, self.motion.v, self.motion.vd)

    @cached_property
    def force_error(self) -> Array:
        """Specific force beyond that of the flight [m/s²], shape (N + 1, 3)."""
        return np.asarray(self.head.specific_force - self.flight.at(self.time)[0])

    @cached_property
    def rate_error(self) -> Array:
        """Rate beyond that of the flight [rad/s], shape (N + 1, 3)."""
        return np.asarray(self.head.angular_velocity - self.flight.at(self.time)[1])

    @cached_property
    def felt_rate_error(self) -> Array:
        """The same after the canals' high pass [rad/s], shape (N + 1, 3)."""
        return self.rate_error - low_pass(self.rate_error, CANAL, self.motion.period)

    @cached_property
    def torque(self) -> Array:
        """Torques at start and end of every period, over what the motors have [-], (2N, n)."""
        torque = np.vstack(torque_of_periods(self.robot, self.motion))
        low, high = self.robot.torque_range(np.vstack([self.motion.v[:-1], self.motion.v[1:]]))
        return np.where(
            torque > 0, torque / np.maximum(high, 1e-9), torque / np.minimum(low, -1e-9)
        )

    @cached_property
    def percept(self) -> Percept | None:
        """What the pilot feels on the device; None if the model has no answer."""
        return percept_of(self.model, self.motion.time, self.head.specific_force,
                        self.head.angular_velocity)  # fmt: skip

    @property
    def g_error(self) -> float:
        """Root of the mean square of the force error's length, over the flight [G]."""
        return float(np.sqrt((self.force_error[self.within] ** 2).sum(axis=1).mean()) / GRAVITY)

    @property
    def felt_rotation(self) -> float:
        """Root of the sum over axes of the felt rate error's mean squares, in flight [deg/s]."""
        return _felt(self.felt_rate_error[self.within])

    @property
    def felt_rotation_from_zero(self) -> float:
        """Felt rotation error with the high pass started at zero with the flight [deg/s]: the
        rotation that the device has by then is felt as one that begins."""
        error, period = self.rate_error[self.within], self.motion.period
        faded = np.exp(-period / CANAL * np.arange(len(error)))[:, None]
        return _felt(error - low_pass(error, CANAL, period) + faded * error[0])

    def beside(self, other: Option) -> tuple[float, float]:
        """G error and felt rotation error over those of another motion [-]."""
        return self.g_error / other.g_error, self.felt_rotation / other.felt_rotation

    def figures(self, felt: Percept | None) -> dict[str, float | None]:
        """What is lost of the flight, and how hard the motors work; `felt` is that in flight."""
        over = np.abs(self.force_error[self.within]) / np.array(LINEAR)
        return {
            "g_error_rms": self.g_error,
            "felt_rotation_rms_deg_s": self.felt_rotation,
            "felt_rotation_from_zero_rms_deg_s": self.felt_rotation_from_zero,
            "felt_vertical_rms_deg": self._felt_vertical(felt),
            "horizontal_force_felt_share": float((over[:, :2] > 1).any(axis=1).mean()),
            "torque_share_max": float(self.torque.max()),
        }

    def _felt_vertical(self, felt: Percept | None) -> float | None:
        """RMS of the angle between the verticals that are felt [deg]."""
        if felt is None or self.percept is None:
            return None
        time = self.time[self.within]
        own = self.percept.gravity[self.within]
        flown = np.stack([np.interp(time, felt.time, column) for column in felt.gravity.T], axis=1)
        sine = np.linalg.norm(np.cross(own, flown), axis=1)
        angle = np.arctan2(sine, (own * flown).sum(axis=1))
        return float(np.degrees(np.sqrt((angle**2).mean())))


def _felt(rate: Array) -> float:
    """Root of the sum over axes of the mean squares [deg/s]; `rate` in rad/s, shape (N, 3)."""
    return float(np.degrees(np.sqrt((rate**2).mean(axis=0).sum())))


def percept_of(model: PerceptionModel, time: Array, force: Array, rate: Array) -> Percept | None:
    """What is felt; None where the model has no answer, as weightless."""
    try:
        return perceive(time, force, rate, model)
    except InputError:
        return None
