"""Commanded joint speeds as functions of time, made from a motion profile and a robot."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError, within
from sdt_drake.io.fields import check_joints
from sdt_drake.io.resources import find_file
from sdt_drake.motion.profile import MotionProfile, Resultant, Track, load_profile
from sdt_drake.motion.segments import PiecewiseLinearSpeed, Ramp, Segment, Turn
from sdt_drake.motion.smooth import SmoothSpeed, Spline
from sdt_drake.motion.spin import SpinGeometry, spin_geometry
from sdt_drake.motion.trajectory import Motion
from sdt_drake.robot.robot import Robot

_TIME_TOLERANCE = 1e-9  # s; round-off of sums of durations


@dataclass(frozen=True, eq=False)
class SpeedProfile:
    """A joint speed over time: m pieces, each linear or along half a cosine, and smooth ones.

    >>> SpeedProfile.linear([0, 1, 3], [0, 2, 0]).speed(np.array([0.5, 2.0]))
    array([1., 1.])
    """

    times: Array
    """Ends of the pieces [s], growing, shape (m + 1,)."""
    values: Array
    """Speed at `times` [rad/s], shape (m + 1,)."""
    cosine: NDArray[np.bool_]
    """True for a piece along half a cosine, shape (m,)."""
    smooth: tuple[tuple[float, SmoothSpeed], ...] = ()
    """Smooth speeds that are added to the pieces, each with its start [s]."""

    @staticmethod
    def linear(times: Sequence[float] | Array, values: Sequence[float] | Array) -> "SpeedProfile":
        """Return the speed that is linear between the points."""
        return SpeedProfile(
            np.array(times), np.array(values), np.zeros(len(times) - 1, dtype=np.bool_)
        )

    def speed(self, time: Array) -> Array:
        """Return the speed [rad/s] at `time` [s], shape (N,)."""
        i, s, _ = self._piece(time)
        blended = self.values[i] + np.diff(self.values)[i] * (1 - np.cos(np.pi * s)) / 2
        linear = np.interp(time, self.times, self.values)
        speed = np.where(self.cosine[i], blended, linear)
        return speed + sum(part.speed(time - start) for start, part in self.smooth)

    def acceleration(self, time: Array) -> Array:
        """Return the acceleration of the pieces, without smooth speeds [rad/s²], shape (N,).

        At a jump it is that of the later piece.
        """
        i, s, duration = self._piece(time)
        share = np.where(self.cosine[i], np.pi / 2 * np.sin(np.pi * s), 1.0)
        return np.diff(self.values)[i] / duration * share

    def corners(self) -> Array:
        """Return times [s] between which the speed only grows or only falls."""
        smooth = [start + part.corners() for start, part in self.smooth]
        return np.concatenate([self.times, *smooth])

    def _piece(self, time: Array) -> tuple[NDArray[np.intp], Array, Array]:
        """Return at each time: index of the piece, its elapsed share [-], its duration [s]."""
        last = len(self.cosine) - 1
        i = np.clip(np.searchsorted(self.times, time, side="right") - 1, 0, last)
        duration = np.diff(self.times)[i]
        return i, np.clip((time - self.times[i]) / duration, 0, 1), duration


class TimedSegment(NamedTuple):
    """A segment of a track with its times, for reports."""

    track: str
    """Joints of the track, separated by " + "."""
    start: float
    """[s]"""
    end: float
    """[s]"""
    text: str
    """Description in a few words."""


@dataclass(frozen=True, eq=False)
class Command:
    """The commanded speeds of all joints, as functions of time. Planners make motions of them.

    >>> command = Command("spin", 2.0, np.zeros(1), (SpeedProfile.linear([0, 1, 2], [0, 1, 0]),))
    >>> command.speeds(np.array([0.5, 1.0]))
    array([[0.5],
           [1. ]])
    """

    name: str
    """Name of the motion."""
    duration: float
    """[s]"""
    q0: Array
    """Joint angles at the start [rad], shape (n,)."""
    joints: tuple[SpeedProfile, ...]
    """Speed of each joint, base to tip, without alignment."""
    alignment: tuple[int, SpeedProfile, SpinGeometry] | None = None
    """Joint index, spin and geometry of the alignment that is added to `joints`, if any."""
    timeline: tuple[TimedSegment, ...] = ()
    """All segments, track after track."""

    @staticmethod
    def of_motion(name: str, motion: Motion) -> "Command":
        """Return the command that follows the speeds of a motion."""
        joints = tuple(SpeedProfile.linear(motion.time, v) for v in motion.v.T)
        return Command(name, motion.duration, motion.q[0], joints)

    def corners(self) -> Array:
        """Return growing times [s] between which every speed only grows or only falls."""
        return np.unique(np.concatenate([joint.corners() for joint in self.joints]))

    def speeds(self, time: Array) -> Array:
        """Return the joint speeds [rad/s], shape (N, n), at `time` [s], shape (N,)."""
        v = np.stack([joint.speed(time) for joint in self.joints], axis=1)
        if self.alignment is not None:
            k, spin, geometry = self.alignment
            v[:, k] += geometry.alignment_speed(spin.speed(time), spin.acceleration(time))
        return v


def load_command(path: str | Path, robot: Robot) -> Command:
    """Return the joint speeds that a motion profile commands.

    Args:
        path: motion profile (YAML), or the name of a shipped one.
        robot: robot that has the profile's joints.

    Raises:
        InputError: a line for each problem: file, field, what was found and what is accepted.

    >>> from sdt_drake.robot.robot import load_robot
    >>> command = load_command("graveyard_spin", load_robot())
    >>> [segment.text for segment in command.timeline]
    ['to 90 deg/s, cosine', 'hold', 'to 0 deg/s, cosine']
    """
    return command_of(load_profile(path), robot, str(find_file(path, "motion")))


def command_of(profile: MotionProfile, robot: Robot, where: str | None = None) -> Command:
    """Return the joint speeds that a motion profile commands.

    Args:
        profile: motion profile.
        robot: robot that has the profile's joints.
        where: place in error messages; the motion's name by default.

    Raises:
        InputError: with `where`, track and segment: a number out of range; an unknown joint, or
            two tracks for one joint; segments that overlap or end after the motion; a joint in
            motion at the end; a spin axis that is not vertical, or a joint that cannot align.
    """
    where = where or f"motion '{profile.name}'"
    with within(where):
        with within(kind="joints"):
            check_joints(profile, "", robot.n)
        return _command(profile, robot)


def _command(profile: MotionProfile, robot: Robot) -> Command:
    tracks, q0 = _placed_tracks(profile, robot), _start(profile, robot)
    joints = [SpeedProfile.linear([0.0, profile.duration], [0.0, 0.0])] * robot.n
    alignment, timeline = None, []
    for place, track, places in tracks:
        k, geometry = robot.joint_names.index(track.joints[0]), None
        if track.resultant is not None:
            geometry = _spin(track.resultant, profile, robot, f"{place}.resultant")
        joints[k], spans = _speed_profile(track, places, geometry, q0[k], profile.duration)
        timeline += spans
        if geometry is not None and geometry.sign != 0:
            aligned = robot.joint_names.index(track.joints[1])
            alignment = aligned, joints[k], geometry
    return Command(profile.name, profile.duration, q0, tuple(joints), alignment, tuple(timeline))


def _start(profile: MotionProfile, robot: Robot) -> Array:
    if profile.start_deg is not None:
        return np.radians(profile.start_deg)
    return np.zeros(robot.n) if profile.q0 is None else np.array(profile.q0)


def _placed_tracks(profile: MotionProfile, robot: Robot) -> list[tuple[str, Track, list[str]]]:
    """Return each track with its place in the file and the places of its segments."""
    placed = []
    for i, track in enumerate(profile.tracks):
        place = f"tracks[{i + 1}]"
        segments = [f"{place}.segments[{j + 1}]" for j in range(len(track.segments))]
        placed.append((place, track, segments))
    for k, segment in enumerate(profile.joints):
        place = f"joints[{k + 1}]"
        placed.append((place, Track(joint=robot.joint_names[k], segments=[segment]), [place]))
    moved: dict[str, str] = {}
    for place, track, _ in placed:
        names = {"joint": track.joint}
        if track.resultant is not None:
            names = {"resultant.spin": track.joints[0], "resultant.align": track.resultant.align}
        for key, name in names.items():
            if name is not None and name not in robot.joint_names:
                raise InputError(
                    f"'{name}', expected a joint of '{robot.name}': {', '.join(robot.joint_names)}",
                    place=f"{place}.{key}",
                    kind="joints",
                )
        own = track.joints[0]
        if own in moved:
            raise InputError(
                f"joint '{own}' is already moved by {moved[own]}, expected one track for a joint",
                place=place,
            )
        moved[own] = place
    return placed


def _spin(resultant: Resultant, profile: MotionProfile, robot: Robot, where: str) -> SpinGeometry:
    """Return the geometry of a spin; refuse inboard joints that move, other than the spin."""
    joint = resultant.align or resultant.spin
    q0, moved = _start(profile, robot), {track.joints[0] for track in profile.tracks}
    for k in range(robot.joint_names.index(joint)):
        name = robot.joint_names[k]
        if name != resultant.spin and (name in moved or q0[k] != 0):
            raise InputError(
                f"joint '{name}', which carries '{joint}', moves or starts turned; "
                "expected it to stay at 0",
                place=where,
            )
    return spin_geometry(robot, resultant.spin, resultant.align, where)


def _speed_profile(
    track: Track, places: list[str], geometry: SpinGeometry | None, angle: float, duration: float
) -> tuple[SpeedProfile, list[TimedSegment]]:
    """Return the speed of a track that starts at `angle` [rad], and its timed segments."""
    times, speeds, cosine, smooth, timeline = [0.0], [0.0], [], [], []

    def extend(time: float, speed: float, *, along_cosine: bool = False) -> None:
        nonlocal angle
        angle += (speeds[-1] + speed) / 2 * (time - times[-1])
        times.append(time)
        speeds.append(speed)
        cosine.append(along_cosine)

    for place, segment in zip(places, track.segments, strict=True):
        at = times[-1] if segment.at is None else segment.at
        if at < times[-1] - _TIME_TOLERANCE:
            raise InputError(
                f"{at:.6g} s, expected at least {times[-1]:.6g} s, the end of the segment before",
                place=f"{place}.at",
            )
        if at > times[-1] + _TIME_TOLERANCE:
            extend(at, speeds[-1])
        start = times[-1]
        if start == 0:
            speeds[0] = segment.start_speed(0.0)
        _check_fit(segment, geometry, speeds[-1], place)
        steps = segment.steps(speeds[-1], angle, geometry)
        if steps[-1][0] <= _TIME_TOLERANCE:
            raise InputError(
                "the segment changes nothing, expected another target or a !Hold", place=place
            )
        for time, speed in steps:
            extend(start + time, speed, along_cosine=segment.blend == "cosine")
        if isinstance(segment, Spline) and abs(math.radians(segment.points[0][1]) - angle) > 1e-6:
            first, here = segment.points[0][1], np.degrees(angle)
            raise InputError(
                f"{first:g} deg, expected {here:.6g} deg, the angle of the joint there",
                place=f"{place}.points[1]",
            )
        if isinstance(segment, SmoothSpeed):
            smooth.append((start, segment))
            angle += segment.angle()
        timeline.append(TimedSegment(" + ".join(track.joints), start, times[-1], segment.text()))
    left, given = duration - times[-1], isinstance(segment, PiecewiseLinearSpeed)
    if left < -_TIME_TOLERANCE or (given and left > _TIME_TOLERANCE):
        raise InputError(
            f"ends at {times[-1]:.9g} s, expected {'exactly' if given else 'at most'} "
            f"{duration:g} s, the duration of the motion",
            place=place,
        )
    if speeds[-1] != 0 and not given:
        raise InputError(
            f"'{track.joints[0]}' ends at {np.degrees(speeds[-1]):.6g} deg/s, expected "
            "rest at the end",
            place=place,
        )
    if left > _TIME_TOLERANCE:
        extend(duration, 0.0)
    profile = SpeedProfile(np.array(times), np.array(speeds), np.array(cosine), tuple(smooth))
    return profile, timeline


def _check_fit(segment: Segment, geometry: SpinGeometry | None, speed: float, where: str) -> None:
    """Refuse a segment that cannot start at a speed [rad/s], and a G beyond the spin's limit."""
    expected = 0.0 if isinstance(segment, (Turn, SmoothSpeed)) else segment.start_speed(speed)
    if speed != expected:
        raise InputError(
            f"!{type(segment).__name__} starts at a speed of {np.degrees(speed):g} deg/s, "
            + (f"expected {np.degrees(expected):g} deg/s" if expected else "expected rest"),
            place=where,
        )
    to_g = (segment.to_g or 0.0) if isinstance(segment, Ramp) else 0.0
    if geometry is not None and to_g > geometry.largest_g:
        raise InputError(
            f"{to_g:g} G, expected at most {geometry.largest_g:.3f} G (speed limit of the spin "
            "joint)",
            place=f"{where}.to_g",
        )
