"""Comparison of a motion of the device with a flight: errors of G and rotation, and the percept."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError
from sdt_drake.machine.cueing.flight import Flight
from sdt_drake.machine.cueing.problem import torque_and_speed
from sdt_drake.motion.trajectory import Motion, interpolated
from sdt_drake.pilot.canals import CUPULA, low_pass
from sdt_drake.pilot.head import GRAVITY, HeadMotion, head_motion
from sdt_drake.pilot.observer import PerceptionModel
from sdt_drake.pilot.orientation import Percept, perceive
from sdt_drake.pilot.thresholds import LINEAR
from sdt_drake.robot.robot import Robot

SENSED_PERIOD = 0.02
"""Sample period for the perception model [s]."""


@dataclass(frozen=True, eq=False)
class Candidate:
    """A motion of the device, compared with the flight."""

    name: str
    """Name in reports."""
    robot: Robot
    """The device."""
    motion: Motion
    """The motion, from rest to rest."""
    flight: Flight
    """The flight."""
    starts_at: float
    """Time at which the flight starts in the motion [s]."""
    model: PerceptionModel
    """The perception model of the pilot."""

    @cached_property
    def time(self) -> Array:
        """Times of the motion from the start of the flight [s], shape (N + 1,)."""
        return self.motion.time - self.starts_at

    @property
    def within(self) -> slice:
        """The samples of the motion during the flight."""
        period = self.motion.period
        first = round(self.starts_at / period)
        return slice(first, first + round(self.flight.duration / period) + 1)

    @cached_property
    def head(self) -> HeadMotion:
        """The motion of the head on the device."""
        return head_motion(self.robot, self.motion.q, self.motion.v, self.motion.vd)

    @cached_property
    def force_error(self) -> Array:
        """Specific force minus that of the flight [m/s²], shape (N + 1, 3)."""
        return np.asarray(self.head.specific_force - self.flight.at(self.time)[0])

    @cached_property
    def rate_error(self) -> Array:
        """Angular rate minus that of the flight [rad/s], shape (N + 1, 3)."""
        return np.asarray(self.head.angular_velocity - self.flight.at(self.time)[1])

    @cached_property
    def felt_rate_error(self) -> Array:
        """Error of the angular rate after the canals' high pass [rad/s], shape (N + 1, 3)."""
        return self.rate_error - low_pass(self.rate_error, CUPULA, self.motion.period)

    @cached_property
    def torque(self) -> Array:
        """Torques at the start and end of every period over the motors' limits, shape (2N, n)."""
        torque, speed = torque_and_speed(self.robot, self.motion)
        low, high = self.robot.torque_range(speed)
        limit = np.where(torque > 0, np.maximum(high, 1e-9), np.minimum(low, -1e-9))
        return torque / limit

    @cached_property
    def percept(self) -> Percept | None:
        """The percept on the device; None if the model has no solution."""
        every = max(round(SENSED_PERIOD / self.motion.period), 1)
        head = self.head.specific_force, self.head.angular_velocity
        return percept_of(self.model, *(x[::every] for x in (self.motion.time, *head)))

    @property
    def g_error(self) -> float:
        """RMS length of the force error during the flight [G]."""
        return float(np.sqrt((self.force_error[self.within] ** 2).sum(axis=1).mean()) / GRAVITY)

    @property
    def felt_rotation(self) -> float:
        """RMS length of the felt rate error during the flight [deg/s]."""
        return _felt(self.felt_rate_error[self.within])

    @property
    def felt_rotation_from_zero(self) -> float:
        """Felt rotation error with a high pass that starts at zero with the flight [deg/s].

        The rotation that the device has at that time is felt as one that begins.
        """
        error, period = self.rate_error[self.within], self.motion.period
        faded = np.exp(-period / CUPULA * np.arange(len(error)))[:, None]
        return _felt(error - low_pass(error, CUPULA, period) + faded * error[0])

    def errors(self, felt: Percept | None) -> tuple[float, float, float]:
        """Return errors of G [G], felt rotation [deg/s] and felt vertical [deg], 0 if unknown."""
        return self.g_error, self.felt_rotation, self._felt_vertical(felt) or 0.0

    def figures(self, felt: Percept | None) -> dict[str, float | None]:
        """Return the errors and the largest share of torque; `felt` is the percept in flight."""
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
        """Return the RMS angle between the felt verticals on the device and in flight [deg]."""
        if felt is None or self.percept is None:
            return None
        time = self.percept.time - self.starts_at
        flies = (time > -1e-9) & (time < self.flight.duration + 1e-9)
        own, flown = self.percept.gravity[flies], interpolated(time[flies], felt.time, felt.gravity)
        sine = np.linalg.norm(np.cross(own, flown), axis=1)
        angle = np.arctan2(sine, (own * flown).sum(axis=1))
        return float(np.degrees(np.sqrt((angle**2).mean())))


def _felt(rate: Array) -> float:
    """Return the RMS length [deg/s] of a rate [rad/s], shape (N, 3)."""
    return float(np.degrees(np.sqrt((rate**2).mean(axis=0).sum())))


def percept_of(model: PerceptionModel, time: Array, force: Array, rate: Array) -> Percept | None:
    """Return the percept; None if the model has no solution, such as without weight."""
    try:
        return perceive(time, force, rate, model)
    except InputError:
        return None
