"""Tracking metrics of a recording: joints, motors, and the pilot's head."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sdt_drake.analysis.metrics import columns_of
from sdt_drake.analysis.perception import FeltDifference, felt_difference
from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError, checked_type
from sdt_drake.io.shown import Shown, Summary, by_joint, joint_count
from sdt_drake.motion import Motion
from sdt_drake.robot.head import HeadMotion, head_motion_of_samples
from sdt_drake.robot.robot import Robot
from sdt_drake.run.simulate import Recording

SETTLED_AFTER = 1.0
"""How long a joint must have had constant speed before its error counts as steady [s]."""


@dataclass(frozen=True, eq=False, repr=False)
class Tracking(Shown):
    """How well each joint follows; joint side, each of shape (n,).

    Attributes:
        max_abs_speed_error: [rad/s].
        rms_speed_error: [rad/s].
        constant_speed_error: largest |speed error| in the constant-speed segments, from
            SETTLED_AFTER on [rad/s]; NaN for a joint that has none.
        saturated_fraction: share of the time in which the motor gives less than is asked [-].
        max_abs_position_error: [rad].
    """

    max_abs_speed_error: Array
    rms_speed_error: Array
    constant_speed_error: Array
    saturated_fraction: Array
    max_abs_position_error: Array

    def summary(self) -> Summary:
        n = len(self.rms_speed_error)
        table = by_joint([""] * n, columns_of(vars(self)))
        return Summary(f"of {joint_count(n)}; joint side", *table)


def track(recording: Recording, motion: Motion) -> Tracking:
    """Metrics of a recording of `motion`.

    Raises:
        InputError: if they are none, or the motion has other samples or joints than the recording.
    """
    checked_type(recording, Recording, "recording", "sdt_drake.simulate")
    checked_type(motion, Motion, "motion", "sdt_drake.plan, or a design,")
    run, asked = recording.summary().title, motion.summary().title
    if run != asked:
        raise InputError(f"{asked}, expected that of the recording, {run}", place="motion")
    error = recording.speed_error
    steady = constant_speed_segments(motion)
    in_segments = np.where(steady, np.abs(error), -np.inf).max(axis=0)
    return Tracking(
        max_abs_speed_error=np.abs(error).max(axis=0),
        rms_speed_error=np.sqrt(np.mean(error**2, axis=0)),
        constant_speed_error=np.where(np.isinf(in_segments), np.nan, in_segments),
        saturated_fraction=recording.saturated[1:].mean(axis=0),
        max_abs_position_error=np.abs(recording.position_error).max(axis=0),
    )


def constant_speed_segments(motion: Motion) -> NDArray[np.bool_]:
    """Samples at which a joint moves and its speed is constant for SETTLED_AFTER, (N + 1, n)."""
    constant = (np.abs(motion.vd) < 1e-9) & (np.abs(motion.v) > 1e-9)
    needed = round(SETTLED_AFTER / motion.period)
    index = np.arange(len(constant))[:, None]
    last_change = np.maximum.accumulate(np.where(constant, -1, index), axis=0)
    return index - last_change > needed


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


def motor_use(recording: Recording, robot: Robot) -> MotorUse:
    """Torques of a run against the motors of `robot`."""
    peak = recording.tau_peak.max(axis=0)
    rms = np.sqrt(np.mean(recording.tau_rms[1:] ** 2, axis=0))
    limit = robot.motor_torque_limit
    return MotorUse(peak, rms, peak / limit, rms / limit)


def stops_passed(recording: Recording, joint_names: Sequence[str]) -> list[str]:
    """A line for each joint that passes a stop: when it does, where, and how far it goes."""
    beyond = recording.beyond_stop
    return [
        f"joint {k + 1} {joint_names[k]} passes its stop at {recording.time[i]:.3f} s, at "
        f"{recording.q[i, k]:.4g} rad, and goes {beyond[:, k].max():.3g} rad beyond it "
        "(stops do not act in the simulation)"
        for k, i in enumerate((beyond > 0).argmax(axis=0))
        if beyond[i, k] > 0
    ]


@dataclass(frozen=True, eq=False)
class HeadTracking:
    """How well the pilot's head follows the motion that was wanted.

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


def track_head(recording: Recording, robot: Robot) -> HeadTracking:
    """How well the head follows along a recording.

    Raises:
        InputError: if the robot has no head, or not as many joints as the recording.
    """
    run, period = recording, float(recording.time[1] - recording.time[0])
    reference, achieved, moved_away = (
        head_motion_of_samples(robot, period, q, v)
        for q, v in ((run.q_ref, run.v_ref), (run.q, run.v), (run.q, run.v_ref))
    )
    return HeadTracking(
        reference=reference,
        achieved=achieved,
        felt=felt_difference(reference, achieved, period),
        felt_from_angles=felt_difference(reference, moved_away, period),
    )
