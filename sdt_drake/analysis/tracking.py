"""Tracking metrics of a simulated run: joints, motors, and the pilot's head."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sdt_drake.analysis.metrics import columns_of
from sdt_drake.io.arguments import instance_of
from sdt_drake.io.arrays import Array
from sdt_drake.io.deprecated import renamed
from sdt_drake.io.shown import Shown, Summary, by_joint, joint_count
from sdt_drake.motion import Motion
from sdt_drake.pilot.head import HeadMotion, head_motion_of_samples
from sdt_drake.pilot.thresholds import FeltDifference, felt_difference
from sdt_drake.robot.robot import Robot
from sdt_drake.run.recording import Recording

SETTLED_AFTER = 1.0
"""Time of constant speed after which the error of a joint counts as steady [s]."""


@dataclass(frozen=True, eq=False, repr=False)
class Tracking(Shown):
    """Tracking errors of each joint; joint side, each of shape (n,)."""

    max_abs_speed_error: Array
    """Largest |speed error| [rad/s]."""
    rms_speed_error: Array
    """RMS speed error [rad/s]."""
    constant_speed_error: Array
    """Largest |speed error| at constant speed, from SETTLED_AFTER on [rad/s]; NaN for a joint
    without such a segment."""
    saturated_fraction: Array
    """Share of time in which the motor saturates [-]."""
    max_abs_position_error: Array
    """Largest |position error| [rad]."""

    def summary(self) -> Summary:
        n = len(self.rms_speed_error)
        table = by_joint([""] * n, columns_of(vars(self)))
        return Summary(f"of {joint_count(n)}; joint side", *table)


def track(recording: Recording, motion: Motion | None = None) -> Tracking:
    """Return the tracking errors of a run, against its planned motion.

        >>> import sdt_drake as sdt
        >>> scenario = sdt.load("package://sdt/scenarios/axis_pi.yaml")
        >>> short = sdt.Motion.from_speeds(0.005, [0] * 4, [[0.001 * i] * 4 for i in range(40)])
        >>> run = sdt.simulate(sdt.design(scenario, motion=short))
        >>> sdt.track(run).max_abs_speed_error.round(4)
        array([0.012 , 0.0128, 0.0125, 0.012 ])

    Args:
        recording: recording of the run.
        motion: not needed, as the recording has the planned motion; deprecated, goes in 0.7.

    Raises:
        InputError: `recording` is no recording.
    """
    instance_of(Recording, "sdt_drake.simulate")(recording, "recording")
    if motion is not None:
        instance_of(Motion)(motion, "motion")
        renamed("track(run, motion)", "track(run)")
    error = recording.speed_error
    steady = constant_speed_segments(recording.v_ref, recording.time[1] - recording.time[0])
    in_segments = np.where(steady, np.abs(error), -np.inf).max(axis=0)
    return Tracking(
        max_abs_speed_error=np.abs(error).max(axis=0),
        rms_speed_error=np.sqrt(np.mean(error**2, axis=0)),
        constant_speed_error=np.where(np.isinf(in_segments), np.nan, in_segments),
        saturated_fraction=recording.saturated[1:].mean(axis=0),
        max_abs_position_error=np.abs(recording.position_error).max(axis=0),
    )


def constant_speed_segments(v: Array, period: float) -> NDArray[np.bool_]:
    """Return the samples at which a joint has moved uniformly for SETTLED_AFTER, (N + 1, n).

    Args:
        v: speed of the joints [rad/s], shape (N + 1, n).
        period: time between samples [s].
    """
    vd = np.diff(v, axis=0, append=v[-1:]) / period
    constant = (np.abs(vd) < 1e-9) & (np.abs(v) > 1e-9)
    needed = round(SETTLED_AFTER / period)
    index = np.arange(len(constant))[:, None]
    last_change = np.maximum.accumulate(np.where(constant, -1, index), axis=0)
    return index - last_change > needed


@dataclass(frozen=True, eq=False)
class MotorUse:
    """Motor torques of a run; each of shape (n,)."""

    peak_torque: Array
    """Largest |torque|, motor side [N m]."""
    rms_torque: Array
    """RMS torque over the run, motor side [N m]."""
    peak_share: Array
    """Peak torque over the torque limit of the motor [-]."""
    rms_share: Array
    """RMS torque over the torque limit of the motor [-]."""


def motor_use(recording: Recording, robot: Robot) -> MotorUse:
    """Return motor torques of a run, also as shares of the motor limits of `robot`."""
    peak = recording.tau_peak.max(axis=0)
    rms = np.sqrt(np.mean(recording.tau_rms[1:] ** 2, axis=0))
    limit = robot.motor_torque_limit
    return MotorUse(peak, rms, peak / limit, rms / limit)


def stops_passed(
    recording: Recording, joint_names: Sequence[str], stiffness: Sequence[float] | None = None
) -> list[str]:
    """Return a line for each joint that passes a stop, with time, angle and distance.

    Args:
        recording: recording of the run.
        joint_names: names of the joints.
        stiffness: `plant.stops.stiffness` of stops that push back; none by default.
    """
    beyond, acting = recording.beyond_stop, stiffness or [0.0] * len(joint_names)
    return [
        f"joint {k + 1} {joint_names[k]} runs into its stop at {recording.time[i]:.3f} s, with "
        f"{recording.v[max(i - 1, 0), k]:.3g} rad/s, and presses it in by "
        f"{beyond[:, k].max():.3g} rad"
        if acting[k]
        else f"joint {k + 1} {joint_names[k]} passes its stop at {recording.time[i]:.3f} s, at "
        f"{recording.q[i, k]:.4g} rad, and goes {beyond[:, k].max():.3g} rad beyond it "
        "(stops do not act in the simulation)"
        for k, i in enumerate((beyond > 0).argmax(axis=0))
        if beyond[i, k] > 0
    ]


@dataclass(frozen=True, eq=False)
class HeadTracking:
    """Tracking errors of the pilot's head, and how far the pilot could feel them."""

    reference: HeadMotion
    """Head motion of the planned motion."""
    achieved: HeadMotion
    """Head motion of the run."""
    felt: FeltDifference
    """Felt difference between both."""
    felt_from_angles: FeltDifference
    """Felt difference if only positions were wrong, with speeds and accelerations of the planned
    motion. Its main effect is a tilt of the head."""


def motions_of(head: HeadTracking | HeadMotion) -> dict[str, HeadMotion]:
    """Return the motions by name: "reference" and "achieved" of a run, or "planned"."""
    if isinstance(head, HeadMotion):
        return {"planned": head}
    return {"reference": head.reference, "achieved": head.achieved}


def track_head(recording: Recording, robot: Robot) -> HeadTracking:
    """Return the tracking errors of the head along a recording.

    Raises:
        InputError: the robot has no head, or another number of joints than the recording.
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
