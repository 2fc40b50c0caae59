"""Motion profiles: the commanded motion of each joint, or the commanded G, as segments in YAML."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal, get_args

from pydantic import Field

from sdt_drake.io.fields import (
    ByTag,
    EachJoint,
    EachJointOrNone,
    Input,
    NonEmpty,
    NotNegative,
    Number,
    Positive,
    Problems,
    Text,
    Values,
    field,
)
from sdt_drake.io.resources import shipped
from sdt_drake.io.yaml_files import load_yaml
from sdt_drake.motion.segments import Hold, Knots, Ramp, Sampled, Turn, either
from sdt_drake.motion.smooth import Fourier, Oscillation, Spline

_Whole = Knots | Sampled | Oscillation | Fourier | Spline
JointSegment = Annotated[_Whole, ByTag()]
"""A segment that may be the whole motion of a joint."""
AnySegment = Annotated[Ramp | Hold | Turn | _Whole, ByTag()]
"""A segment of a track."""


@dataclass(frozen=True, kw_only=True)
class Resultant(Input):
    """The joints that make a commanded G."""

    spin: Text
    """Joint whose speed makes the G; its axis must be vertical."""
    align: Text | None = None
    """Joint that turns 'up' of its link onto the resultant of gravity and centripetal
    acceleration; no alignment by default. The tangential acceleration of a changing speed
    is **not** aligned: it is felt sideways to the arm. The acceleration of this joint jumps a
    little at the end of a ramp."""


@dataclass(frozen=True, kw_only=True)
class Track(Input):
    """The segments of one joint or of a commanded G, in order. The speed is held in gaps."""

    joint: Text | None = None
    """Name of the joint; alternative to resultant."""
    resultant: Resultant | None = None
    """Joints that make a commanded G; alternative to joint."""
    segments: NonEmpty[AnySegment]
    """Segments in order of time."""

    def problems(self) -> Problems:
        """Yield each segment that does not fit a track of a joint or of a resultant."""
        yield from either(self, "joint", "resultant")
        for j, segment in enumerate(self.segments):
            place, kind = f"segments[{j + 1}]", type(segment).__name__
            if self.resultant is None:
                if isinstance(segment, Ramp) and segment.to_g is not None:
                    yield f"{place}.to_g", "given in a track of a joint, expected to_deg_s"
            elif isinstance(segment, Hold):
                continue
            elif not isinstance(segment, Ramp):
                yield place, f"!{kind} in a track of the resultant, expected !Ramp or !Hold"
            elif segment.to_g is None:
                yield f"{place}.to_deg_s", "given in a track of the resultant, expected to_g"
            elif segment.blend == "linear" and self.resultant.align is not None:
                align = f"the aligned joint '{self.resultant.align}' would have to jump in speed"
                yield f"{place}.blend", f"'linear', expected cosine: {align}"

    @property
    def joints(self) -> list[str]:
        """Names of the moved joints: the joint, or the spin joint and the aligned joint, if any."""
        if self.resultant is None:
            return [self.joint or ""]
        return [j for j in (self.resultant.spin, self.resultant.align) if j is not None]


FeltQuantity = Literal["roll", "pitch", "roll rate", "pitch rate", "yaw rate"]
FELT_QUANTITIES: tuple[FeltQuantity, ...] = get_args(FeltQuantity)
"""Quantities of an illusion: angles of the head from the true vertical, rates about its axes."""


@dataclass(frozen=True, kw_only=True)
class IntendedIllusion(Input):
    """The illusion that a motion should give: a value between two times, in the form of reports."""

    quantity: FeltQuantity
    """Quantity that should be felt wrongly: an angle from the true vertical, or a rate about an
    axis of the head (x forward, y left, z up)."""
    of: Literal["error", "felt"] = "error"
    """Value that counts: felt minus true (error), or the felt value itself (felt)."""
    sign: Annotated[int, Field(ge=-1, le=1)] = field(unit="-")
    """Sign of that value: 1, -1, or 0 for either. Roll to the right, pitch nose up and rates about
    x, y and z are positive."""
    start: NotNegative = field(unit="s")
    """Start of the interval in which the illusion is expected."""
    end: Positive = field(unit="s")
    """End of this interval."""
    baseline: NotNegative | None = field(None, unit="s")
    """Time whose value counts as 0; none by default."""
    from_start: bool = False
    """True for a baseline at start; goes in 0.7."""
    reported: str = ""
    """Reports of people on such a motion, with the source."""

    @property
    def zero_at(self) -> float | None:
        """Time whose value counts as 0 [s]; None if there is none."""
        return self.start if self.from_start and self.baseline is None else self.baseline

    def problems(self) -> Problems:
        """Yield an end that is not after the start."""
        if self.end <= self.start:
            yield "end", f"{self.end:g} s, expected more than start, {self.start:g} s"


@dataclass(frozen=True, kw_only=True)
class MotionProfile(Input):
    """The commanded speeds of the joints, with the illusion that they should give."""

    name: str = ""
    """Short name; the file's name by default."""
    title: str = ""
    """Name of the illusion."""
    description: str = ""
    """Description in one sentence."""
    feels: str = ""
    """Sentence on what the pilot should feel."""
    illusion: IntendedIllusion | None = None
    """Illusion that the motion should give; `sdt-drake pilot` checks if the model predicts it."""
    notes: str = ""
    """Assumptions, limits of the device, sources."""
    duration: Positive = field(unit="s")
    """Duration of the motion."""
    start_deg: EachJoint[Number] | None = field(None, unit="deg", side="joint")
    """Joint angles at the start, base to tip; 0 by default."""
    q0: EachJoint[Number] | None = field(None, unit="rad", side="joint")
    """Joint angles at the start in rad; alternative to start_deg."""
    tracks: Values[Track] = field(())
    """Tracks of the joints that move; other joints stay at their start angles."""
    joints: EachJointOrNone[JointSegment] = field(())
    """One segment for each joint, base to tip; alternative to tracks."""

    def problems(self) -> Problems:
        """Yield fields that exclude each other, and every resultant after the first."""
        if bool(self.tracks) == bool(self.joints):
            yield "tracks", "expected segments either here or in joints"
        if self.start_deg is not None and self.q0 is not None:
            yield "q0", "given beside start_deg, expected only one of the two"
        resultants = [i + 1 for i, track in enumerate(self.tracks) if track.resultant is not None]
        for i in resultants[1:]:
            yield (
                f"tracks[{i}].resultant",
                f"a second one after tracks[{resultants[0]}], expected one",
            )


def load_profile(path: str | Path) -> MotionProfile:
    """Read a motion profile.

    Args:
        path: YAML file, or the name of a shipped motion.

    Raises:
        InputError: a line for each problem: file, field, what was found and what is accepted.

    >>> load_profile("leans").illusion.quantity
    'roll'
    """
    return load_yaml(MotionProfile, path, "motion")[0]


def shipped_motions() -> list[str]:
    """Return the names of the shipped training motions, those with an illusion.

    >>> shipped_motions()[:3]
    ['coriolis', 'g_excess', 'graveyard_spin']
    """
    return [name for name in shipped("motion") if load_profile(name).feels]
