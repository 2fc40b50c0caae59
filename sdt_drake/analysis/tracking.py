"""Tracking metrics of a recording: joints, motors, and the pilot's head."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sdt_drake.control import CONTROLLERS
from sdt_drake.design import Design
from sdt_drake.motion import Motion
from sdt_drake.pilot import (
    FeltDifference,
    HeadMotion,
    felt_difference,
    head_motion_of_samples,
)
from sdt_drake.robot import Robot
from sdt_drake.simulate import Recording

Array = NDArray[np.float64]

SETTLED_AFTER = 1.0
"""How long a joint must have had constant speed before its error counts as steady [s]."""


@dataclass(frozen=True, eq=False)
class Tracking:
    """How well each joint follows; joint side, each of shape (n,).

    Attributes:
        max_abs_speed_error: [rad/s].
        rms_speed_error: [rad/s].
        constant_speed_error: largest |speed error| in the constant-speed segments, from
            SETTLED_AFTER on [rad/s]; NaN for a joint that has none.
        saturated_fraction: share of samples at which the motor gives less than was asked [-].
        max_abs_position_error: [rad].
    """

    max_abs_speed_error: Array
    rms_speed_error: Array
    constant_speed_error: Array
    saturated_fraction: Array
    max_abs_position_error: Array


def track(recording: Recording, motion: Motion) -> Tracking:
    """Metrics of a recording of `motion`."""
    error = recording.speed_error
    steady = constant_speed_segments(motion)
    in_segments = np.where(steady, np.abs(error), -np.inf).max(axis=0)
    return Tracking(
        max_abs_speed_error=np.abs(error).max(axis=0),
        rms_speed_error=np.sqrt(np.mean(error**2, axis=0)),
        constant_speed_error=np.where(np.isinf(in_segments), np.nan, in_segments),
        saturated_fraction=np.mean(recording.tau_limited != recording.tau_cmd, axis=0),
        max_abs_position_error=np.abs(recording.position_error).max(axis=0),
    )


def constant_speed_segments(motion: Motion) -> NDArray[np.bool_]:
    """Samples at which a joint moves and its speed is constant for SETTLED_AFTER, (N + 1, n)."""
    constant = (np.abs(motion.vd) < 1e-9) & (np.abs(motion.v) > 1e-9)
    needed = round(SETTLED_AFTER / motion.period)
    index = np.arange(len(constant))[:, None]
    last_change = np.maximum.accumulate(np.where(constant, -1, index), axis=0)
    return index - last_change > needed


class PeriodTorque(NamedTuple):
    """Torque of the motors at both ends of each interpolation period, motor side [N m].

    Attributes:
        start: just after the update at its start, shape (N, n).
        end: just before the one at its end, as in a recording, shape (N, n).
    """

    start: Array
    end: Array

    @property
    def peak(self) -> Array:
        """Largest magnitude [N m], shape (n,)."""
        return np.abs(self).max(axis=(0, 1))

    @property
    def mean_square(self) -> Array:
        """Of each period, linear between its ends [N² m²], shape (N, n)."""
        start, end = self
        return (start**2 + start * end + end**2) / 3


def period_torque(recording: Recording, design: Design) -> PeriodTorque:
    """What the motors gave in each period of a recording.

    At an update the reference jumps, and with it a torque that has the proportional gain on the
    error, or a feedforward:

        jump = K_PS r Δ(b (v_ref + K_V (q_ref - q)) - v) + Δtau_ff,   b = 1 with K_PS on the error

    where v itself has none, but K_PS has one if it follows the inertia. Over the period the speed
    follows, and the feedback takes the jump back: a recording, which has the ends of the periods,
    shows K_PS times a period's acceleration less than the motor gave before.
    A drive with a sampling or a lag of its own is taken as it was recorded.

    Args:
        recording: of `design`.
        design: the controller and the limits of the motors.
    """
    end = recording.tau[1:]
    choice, robot = design.scenario.controller, design.robot
    feedback = CONTROLLERS[choice.kind].feedback
    if design.scenario.drive is not None:
        return PeriodTorque(recording.tau[:-1], end)
    if feedback == "inverse_dynamics":  # sampled and held
        return PeriodTorque(end, end)
    asked = recording.v_ref
    if feedback == "position":
        asked = asked - design.position_gain * recording.position_error
    asked = asked * (choice.structure_in_use == "pi")
    gain = design.gains.kp * robot.gear_ratio * np.ones_like(asked)
    if feedback == "scheduled":
        gain *= design.inertia_share
    v = recording.v[1:]
    jump = gain[1:] * (asked[1:] - v) - gain[:-1] * (asked[:-1] - v)
    if design.tau_ff is not None:
        jump += np.diff(design.tau_ff, axis=0)
    help_ = 0.0
    if design.scenario.plant.kind == "axis":  # which widens the limits there
        help_ = design.loads.alleviating_torque[1:]
    limit = robot.motor_torque_limit
    after = recording.tau_cmd[1:] + jump
    after = np.clip(after, np.minimum(help_, 0) - limit, np.maximum(help_, 0) + limit)
    # The first row is just after its update; the last update begins no period.
    return PeriodTorque(np.vstack([recording.tau[:1], after[:-1]]), end)


@dataclass(frozen=True, eq=False)
class MotorUse:
    """What a run takes of the motors; each of shape (n,).

    Attributes:
        peak_torque: largest magnitude, motor side [N m].
        rms_torque: over the run, motor side [N m].
        peak_share, rms_share: the same over the motor's largest torque [-].
    """

    peak_torque: Array
    rms_torque: Array
    peak_share: Array
    rms_share: Array


def motor_use(torque: PeriodTorque, robot: Robot) -> MotorUse:
    """Torques of a run against the motors of `robot`."""
    peak, rms = torque.peak, np.sqrt(torque.mean_square.mean(axis=0))
    limit = robot.motor_torque_limit
    return MotorUse(peak, rms, peak / limit, rms / limit)


@dataclass(frozen=True, eq=False)
class HeadTracking:
    """How well the pilot's head follows.

    Attributes:
        reference, achieved: motion of the head.
        felt: their difference, as far as the pilot could feel it.
        felt_from_angles: the same if only the joint angles were off, and speeds and accelerations
            those of the reference: what a loss of position does, mostly by tilting the head.
    """

    reference: HeadMotion
    achieved: HeadMotion
    felt: FeltDifference
    felt_from_angles: FeltDifference


def felt_of(recording: Recording, robot: Robot) -> FeltDifference:
    """How much of the difference between reference and run the pilot could feel.

    Raises:
        InputError: if the robot has no head, or not as many joints as the recording.
    """
    period, reference, achieved = _heads(recording, robot)
    return felt_difference(reference, achieved, period)


def _heads(recording: Recording, robot: Robot) -> tuple[float, HeadMotion, HeadMotion]:
    """Period [s], and the head's motion in the reference and in the run."""
    run, period = recording, float(recording.time[1] - recording.time[0])
    reference = head_motion_of_samples(robot, period, run.q_ref, run.v_ref)
    return period, reference, head_motion_of_samples(robot, period, run.q, run.v)


def track_head(recording: Recording, robot: Robot) -> HeadTracking:
    """The head along a recording.

    Raises:
        InputError: if the robot has no head, or not as many joints as the recording.
    """
    period, reference, achieved = _heads(recording, robot)
    moved_away = head_motion_of_samples(robot, period, recording.q, recording.v_ref)
    return HeadTracking(
        reference=reference,
        achieved=achieved,
        felt=felt_difference(reference, achieved, period),
        felt_from_angles=felt_difference(reference, moved_away, period),
    )
