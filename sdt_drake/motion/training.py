"""Training motions: what the instructor wants, as segments of joint speed and wanted G, in YAML.

A track is a sequence of segments, and every segment is made of pieces from one speed to another,
linear or along half a cosine. So an angle is the sum of (v_i + v_i+1) / 2 times the time of each
piece, whatever its blend.
"""

# Drake's YAML loader reads the annotations here: they may not be postponed, and a union must be
# spelled Optional[...] or Union[...].
import difflib
from dataclasses import dataclass, field
from pathlib import Path, PurePath
from typing import Optional, Union

import numpy as np
from numpy.typing import NDArray

from sdt_drake.errors import InputError, checked_choice, checked_number, checked_vector
from sdt_drake.fields import beside
from sdt_drake.motion.command import Alignment, Command, Course, SpinGeometry, spin_geometry
from sdt_drake.motion.profile import CommandProfile, load_profile
from sdt_drake.resources import PACKAGE_PREFIX, find_file, models_dir
from sdt_drake.robot import Robot
from sdt_drake.yaml_files import load_yaml, read_yaml

Array = NDArray[np.float64]
Step = tuple[float, float]  # how long [s], and the speed at its end [rad/s]

BLENDS = ("cosine", "linear")
_SAME_TIME = 1e-9  # s; round-off of sums of durations
# Largest acceleration of a ramp, over its mean one.
_PEAK_ACCELERATION = {"cosine": np.pi / 2, "linear": 1.0}
# Largest speed of a turn, over its mean one: up and down along cosines, or a trapezoid whose
# thirds take equal times.
_PEAK_SPEED = {"cosine": 2.0, "linear": 1.5}


@dataclass
class Ramp:
    """The speed goes from what it is to another one.

    Attributes:
        at: start [s]; right after the segment before if not given.
        to_deg_s: joint speed at the end [deg/s]; in a track of a joint.
        to_g: resultant of gravity and centripetal acceleration at the end [G]; in a track of the
            resultant. The speed of the spin joint is what goes linearly or along a cosine:
            d omega / d G is infinite at 1 G.
        duration: [s], or
        acceleration_deg_s2: the largest one [deg/s²], > 0.
        blend: of the speed, "cosine" or "linear" (whose acceleration jumps).
    """

    at: Optional[float] = None
    to_deg_s: Optional[float] = None
    to_g: Optional[float] = None
    duration: Optional[float] = None
    acceleration_deg_s2: Optional[float] = None
    blend: str = "cosine"

    def validate(self, where: str, *, resultant: bool) -> None:
        """Raise InputError, naming `where` and the field."""
        own, other = ("to_g", "to_deg_s") if resultant else ("to_deg_s", "to_g")
        of_track = "the resultant" if resultant else "a joint"
        if getattr(self, other) is not None:
            raise InputError(f"{where}.{other}: in a track of {of_track}, expected {own}")
        if getattr(self, own) is None:
            raise InputError(f"{where}.{own}: missing, expected a number")
        checked_number(getattr(self, own), f"{where}.{own}", minimum=1 if resultant else -np.inf)
        _check_either(self, "duration", "acceleration_deg_s2", where)
        checked_choice(self.blend, BLENDS, f"{where}.blend")

    def steps(self, speed: float, angle: float, geometry: SpinGeometry | None) -> list[Step]:
        """Pieces from `speed` [rad/s] on."""
        target = _speed_at(self, geometry)
        if self.duration is not None:
            return [(self.duration, target)]
        mean = float(np.radians(self.acceleration_deg_s2)) / _PEAK_ACCELERATION[self.blend]
        return [(abs(target - speed) / mean, target)]

    def text(self) -> str:
        """For people."""
        target = f"{self.to_deg_s:g} deg/s" if self.to_g is None else f"{self.to_g:g} G"
        return f"to {target}, {self.blend}"


@dataclass
class Hold:
    """The speed stays what it is.

    Attributes:
        at: start [s]; right after the segment before if not given.
        duration: [s].
    """

    at: Optional[float] = None
    duration: Optional[float] = None

    def validate(self, where: str, *, resultant: bool) -> None:
        """Raise InputError, naming `where` and the field."""
        if self.duration is None:
            raise InputError(f"{where}.duration: missing, expected a time [s] > 0")
        checked_number(self.duration, f"{where}.duration", minimum=0, exclusive=True)

    def steps(self, speed: float, angle: float, geometry: SpinGeometry | None) -> list[Step]:
        """Pieces from `speed` [rad/s] on."""
        return [(self.duration, speed)]

    def text(self) -> str:
        """For people."""
        return "hold"


@dataclass
class Turn:
    """The joint turns from rest to rest.

    Attributes:
        at: start [s]; right after the segment before if not given.
        by_deg: change of the angle [deg], or
        to_deg: angle at the end [deg]; of the joint without its share of an alignment.
        duration: [s], or
        speed_deg_s: the largest speed [deg/s], > 0.
        blend: of the speed: "cosine", (1 - cos) / 2 with a mean of half the largest, or "linear",
            a trapezoid of three equal times with a mean of two thirds.
    """

    at: Optional[float] = None
    by_deg: Optional[float] = None
    to_deg: Optional[float] = None
    duration: Optional[float] = None
    speed_deg_s: Optional[float] = None
    blend: str = "cosine"

    def validate(self, where: str, *, resultant: bool) -> None:
        """Raise InputError, naming `where` and the field."""
        if resultant:
            raise InputError(f"{where}: !Turn in a track of the resultant, expected !Ramp, !Hold")
        if (self.by_deg is None) == (self.to_deg is None):
            raise InputError(f"{where}: expected either by_deg or to_deg")
        for name in ("by_deg", "to_deg"):
            if getattr(self, name) is not None:
                checked_number(getattr(self, name), f"{where}.{name}")
        _check_either(self, "duration", "speed_deg_s", where)
        checked_choice(self.blend, BLENDS, f"{where}.blend")

    def steps(self, speed: float, angle: float, geometry: SpinGeometry | None) -> list[Step]:
        """Pieces from rest at `angle` [rad] on."""
        if self.to_deg is None:
            by = float(np.radians(self.by_deg))
        else:
            by = float(np.radians(self.to_deg)) - angle
        factor = _PEAK_SPEED[self.blend]
        duration = self.duration
        if duration is None:
            duration = factor * abs(by) / float(np.radians(self.speed_deg_s))
        peak = factor * by / duration if duration > 0 else 0.0
        speeds = (peak, 0.0) if self.blend == "cosine" else (peak, peak, 0.0)
        return [(duration / len(speeds), v) for v in speeds]

    def text(self) -> str:
        """For people."""
        turn = f"by {self.by_deg:g} deg" if self.to_deg is None else f"to {self.to_deg:g} deg"
        return f"turn {turn}, {self.blend}"


@dataclass
class Resultant:
    """Which joints make a wanted G.

    Attributes:
        spin: the joint whose speed makes it; its axis must be vertical.
        align: the joint that turns 'up' of what it carries onto the resultant of gravity and
            centripetal acceleration; none if not given. The tangential acceleration of a changing
            speed is **not** aligned: it is felt sideways to the arm. The acceleration of this
            joint jumps a little where a ramp ends.
    """

    spin: str = ""
    align: Optional[str] = None


@dataclass
class Track:
    """Segments, one after the other, of one joint or of a wanted G. Speeds in gaps are held.

    Attributes:
        joint: name of the joint, or
        resultant: which joints make a wanted G.
        segments: in their order in time.
    """

    joint: Optional[str] = None
    resultant: Optional[Resultant] = None
    segments: list[Union[Ramp, Hold, Turn]] = field(default_factory=list)

    def validate(self, where: str) -> None:
        """Raise InputError, naming `where` and the field."""
        if (self.joint is None) == (self.resultant is None):
            raise InputError(f"{where}: expected either joint or resultant")
        if not self.segments:
            raise InputError(f"{where}.segments: empty, expected !Ramp, !Hold or !Turn")
        for j, segment in enumerate(self.segments):
            place = f"{where}.segments[{j + 1}]"
            if segment.at is not None:
                checked_number(segment.at, f"{place}.at", minimum=0)
            segment.validate(place, resultant=self.resultant is not None)
            linear = getattr(segment, "blend", "cosine") == "linear"
            if linear and self.resultant is not None and self.resultant.align is not None:
                raise InputError(
                    f"{place}.blend: 'linear', expected cosine: the aligned joint "
                    f"'{self.resultant.align}' would have to jump in speed"
                )

    @property
    def joints(self) -> list[str]:
        """The joint; of a resultant the spin joint and the aligned one."""
        if self.resultant is None:
            return [self.joint]
        return [j for j in (self.resultant.spin, self.resultant.align) if j is not None]

    @property
    def main_joint(self) -> str:
        """The joint whose speed the segments give."""
        return self.joints[0]

    @property
    def label(self) -> str:
        """For people."""
        return " + ".join(self.joints)


@dataclass(frozen=True)
class TimedSegment:
    """A segment of a track with its times.

    Attributes:
        track: label of the track.
        start, end: [s].
        text: what it does.
    """

    track: str
    start: float
    end: float
    text: str


@dataclass
class TrainingProfile:
    """A motion that makes an illusion.

    Attributes:
        name: short name.
        title: the illusion.
        feels: one sentence: what the pilot should feel.
        notes: what is assumed, what a device cannot do, sources.
        duration: [s]; all joints are at rest at its end.
        start_deg: joint angles at the start [deg], base to tip; all 0 if not given.
        tracks: what moves; other joints stay where they are.
    """

    name: str = ""
    title: str = ""
    feels: str = ""
    notes: str = ""
    duration: float = 0.0
    start_deg: Optional[list[float]] = None
    tracks: list[Track] = field(default_factory=list)

    def validate(self, where: str) -> None:
        """Check all that does not need the robot.

        Raises:
            InputError: naming `where`, the field, and what would be right.
        """
        checked_number(self.duration, f"{where}: duration", minimum=0, exclusive=True)
        if not self.tracks:
            raise InputError(f"{where}: tracks: empty, expected what shall move")
        wanted = [i + 1 for i, track in enumerate(self.tracks) if track.resultant is not None]
        if len(wanted) > 1:
            raise InputError(
                f"{where}: tracks[{wanted[1]}].resultant: tracks[{wanted[0]}] has one already, "
                "expected one resultant"
            )
        for i, track in enumerate(self.tracks):
            track.validate(f"{where}: tracks[{i + 1}]")

    def command(self, robot: Robot, where: str | None = None) -> Command:
        """The joint speeds for a robot.

        Args:
            robot: has the joints that the tracks name.
            where: named in errors; by default the motion.

        Raises:
            InputError: naming `where`, the track, the segment and what would be right: a joint
                that the robot does not have, or two tracks for one; segments that overlap or last
                longer than the motion; a joint that is not at rest at the end; an axis of spin
                that is not vertical, or one that cannot align.
        """
        where = where or f"motion '{self.name}'"
        courses = [Course.at_rest(self.duration)] * robot.n
        alignment = None
        for track, geometry, course, _ in self._lay_out(robot, where):
            courses[robot.joint_names.index(track.main_joint)] = course
            if geometry is not None and geometry.sign != 0:
                align = robot.joint_names.index(track.resultant.align)
                alignment = Alignment(align, course, geometry)
        return Command(
            self.name, self.duration, self._start(robot, where), tuple(courses), alignment
        )

    def timeline(self, robot: Robot) -> list[TimedSegment]:
        """Every segment with its times, track after track.

        Raises:
            InputError: as `command`.
        """
        return [
            TimedSegment(track.label, start, end, segment.text())
            for track, _, _, spans in self._lay_out(robot, f"motion '{self.name}'")
            for segment, (start, end) in zip(track.segments, spans, strict=True)
        ]

    def _start(self, robot: Robot, where: str) -> Array:
        if self.start_deg is None:
            return np.zeros(robot.n)
        return np.radians(checked_vector(self.start_deg, robot.n, f"{where}: start_deg"))

    def _lay_out(
        self, robot: Robot, where: str
    ) -> list[tuple[Track, SpinGeometry | None, Course, list[tuple[float, float]]]]:
        """Each track, how it makes G, its speed, and when its segments start and end."""
        self.validate(where)
        moved = self._moved_joints(robot, where)
        q0 = self._start(robot, where)
        laid_out = []
        for i, track in enumerate(self.tracks):
            place = f"{where}: tracks[{i + 1}]"
            geometry = None
            if track.resultant is not None:
                _check_inboard(robot, q0, moved, track.resultant, f"{place}.resultant")
                spin, align = track.resultant.spin, track.resultant.align
                geometry = spin_geometry(robot, spin, align, f"{place}.resultant")
            angle = float(q0[robot.joint_names.index(track.main_joint)])
            course, spans = _course(track, angle, geometry, self.duration, place)
            laid_out.append((track, geometry, course, spans))
        return laid_out

    def _moved_joints(self, robot: Robot, where: str) -> dict[str, str]:
        """Joints and what moves them: each is one of the robot, and has one track."""
        moved: dict[str, str] = {}
        for i, track in enumerate(self.tracks):
            place = f"tracks[{i + 1}]"
            names = {"joint": track.joint}
            if track.resultant is not None:
                names = {
                    "resultant.spin": track.resultant.spin,
                    "resultant.align": track.resultant.align,
                }
            for key, name in names.items():
                if name is not None and name not in robot.joint_names:
                    raise InputError(
                        f"{where}: {place}.{key}: '{name}', expected a joint of "
                        f"'{robot.name}': {', '.join(robot.joint_names)}"
                    )
            own = track.main_joint
            if own in moved:
                raise InputError(
                    f"{where}: {place}: joint '{own}' is moved by {moved[own]} already, "
                    "expected one track"
                )
            moved[own] = place
        return moved


def load_training(path: str | Path) -> TrainingProfile:
    """A training profile from YAML, or by the name of a shipped one.

    Raises:
        InputError: naming the file, the field, and what would be right.
    """
    file = find_file(find_motion(path))
    if file.suffix == ".csv" or _kind(file) == "joints":
        raise InputError(
            f"{file}: commands joint speeds, expected a training profile (.yaml, with tracks)"
        )
    profile, file = load_yaml(TrainingProfile, file)
    profile.name = profile.name or file.stem
    profile.validate(str(file))
    return profile


def load_command(path: str | Path, robot: Robot) -> Command | CommandProfile:
    """What a planner takes, from YAML: a training profile (it has `tracks`) or a command profile.

    Raises:
        InputError: naming the file, the field, and what would be right.
    """
    file = find_file(find_motion(path))
    if _kind(file) == "tracks":
        return load_training(file).command(robot, str(file))
    return load_profile(file)


def shipped_motions() -> list[str]:
    """Names of the training profiles that ship with the package."""
    files = sorted((models_dir() / "motions").glob("*.yaml"))
    return [file.stem for file in files if _kind(file) == "tracks"]


def find_motion(name_or_path: str | Path) -> str:
    """The path of a motion: `graveyard_spin` is package://sdt/motions/graveyard_spin.yaml.

    What has a suffix or a slash is a path already.

    Raises:
        InputError: if no motion of that name is shipped; it lists near ones.
    """
    text = str(name_or_path)
    if not text or PurePath(text).suffix or "/" in text or PurePath(text).name != text:
        return text
    names = sorted(file.stem for file in (models_dir() / "motions").glob("*.yaml"))
    if text not in names:
        near = difflib.get_close_matches(text, names, n=3)
        hint = f"did you mean {' or '.join(near)}?" if near else f"shipped: {', '.join(names)}"
        raise InputError(f"{text}: no such motion, {hint} (files end in .yaml or .csv)")
    return f"{PACKAGE_PREFIX}motions/{text}.yaml"


def motion_beside(name: str, folder: Path) -> str:
    """What a YAML file in `folder` means by a motion: a shipped one by its name, or a file."""
    return name if find_motion(name) != name else beside(name, folder)


def _kind(file: Path) -> str:
    """Which key tells what a file is: "tracks" or "joints"; "" if it has neither.

    A misspelt one counts: whoever loads the file says how it is spelt.
    """
    try:
        data = read_yaml(file)
    except InputError:  # whoever loads it says what is wrong
        return ""
    keys = [str(key) for key in data] if isinstance(data, dict) else []
    for exact in (1.0, 0.6):
        for kind in ("tracks", "joints"):
            if difflib.get_close_matches(kind, keys, cutoff=exact):
                return kind
    return ""


def _check_inboard(
    robot: Robot, q0: Array, moved: dict[str, str], resultant: Resultant, where: str
) -> None:
    """What stands between the ground and the aligned joint does not turn, but for the spin."""
    joint = resultant.align or resultant.spin
    for k in range(robot.joint_names.index(joint)):
        name = robot.joint_names[k]
        if name != resultant.spin and (name in moved or q0[k] != 0):
            raise InputError(
                f"{where}: joint '{name}', which carries '{joint}', moves or starts "
                "turned; expected it to stay at 0"
            )


def _check_either(segment: object, one: str, other: str, where: str) -> None:
    """Exactly one of two fields is given, and > 0."""
    given = [name for name in (one, other) if getattr(segment, name) is not None]
    if len(given) != 1:
        raise InputError(f"{where}: {' and '.join(given) or 'neither'}, expected {one} or {other}")
    checked_number(getattr(segment, given[0]), f"{where}.{given[0]}", minimum=0, exclusive=True)


def _speed_at(ramp: Ramp, geometry: SpinGeometry | None) -> float:
    """Speed at the end of a ramp [rad/s]."""
    if ramp.to_g is None:
        return float(np.radians(ramp.to_deg_s))
    return geometry.speed(ramp.to_g)


def _course(
    track: Track,
    angle: float,
    geometry: SpinGeometry | None,
    duration: float,
    where: str,
) -> tuple[Course, list[tuple[float, float]]]:
    """The speed of a track that starts at `angle` [rad], and the times of its segments."""
    times, speeds, cosine, spans = [0.0], [0.0], [], []

    def go_on(step: float, speed: float, *, along_cosine: bool) -> None:
        nonlocal angle
        angle += (speeds[-1] + speed) / 2 * step
        times.append(times[-1] + step)
        speeds.append(speed)
        cosine.append(along_cosine)

    for j, segment in enumerate(track.segments):
        place = f"{where}.segments[{j + 1}]"
        gap = 0.0 if segment.at is None else segment.at - times[-1]
        if gap < -_SAME_TIME:
            raise InputError(
                f"{place}.at: overlap, {segment.at:.6g} s is before the segment before ends, at "
                f"{times[-1]:.6g} s"
            )
        if gap > _SAME_TIME:
            go_on(gap, speeds[-1], along_cosine=False)
        start = times[-1]
        if isinstance(segment, Turn) and speeds[-1] != 0:
            raise InputError(
                f"{place}: !Turn at a speed of {np.degrees(speeds[-1]):g} deg/s, expected rest"
            )
        if getattr(segment, "to_g", None) is not None and segment.to_g > geometry.largest_g:
            raise InputError(
                f"{place}.to_g: {segment.to_g:g} G, expected at most {geometry.largest_g:.3f} G, "
                f"the speed limit of '{track.main_joint}'"
            )
        steps = segment.steps(speeds[-1], angle, geometry)
        if sum(step for step, _ in steps) <= _SAME_TIME:
            raise InputError(f"{place}: nothing changes, expected another target or a !Hold")
        along_cosine = getattr(segment, "blend", "linear") == "cosine"
        for step, speed in steps:
            go_on(step, speed, along_cosine=along_cosine)
        if times[-1] > duration + _SAME_TIME:
            raise InputError(
                f"{place}: ends at {times[-1]:.6g} s, expected by the end of the motion, "
                f"duration {duration:g} s"
            )
        spans.append((start, times[-1]))
    if speeds[-1] != 0:
        raise InputError(
            f"{where}: '{track.label}' ends at {np.degrees(speeds[-1]):.6g} deg/s, "
            "expected rest at the end"
        )
    if duration - times[-1] > _SAME_TIME:
        go_on(duration - times[-1], 0.0, along_cosine=False)
    return Course(np.array(times), np.array(speeds), np.array(cosine)), spans
