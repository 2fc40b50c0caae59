"""Motion profiles: what the instructor wants of each joint, or of G, as segments in YAML."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from pydantic import Field

from sdt_drake.io.fields import (
    EachJoint,
    EachJointOrNone,
    Input,
    NotNegative,
    Number,
    OneOf,
    Positive,
    Problems,
    Some,
    Tagged,
    Text,
    setting,
)
from sdt_drake.io.resources import shipped
from sdt_drake.io.yaml_files import load_yaml
from sdt_drake.motion.segments import Fourier, Hold, Knots, Oscillation, Ramp, Sampled, Turn, either


@dataclass(kw_only=True)
class Resultant(Input):
    """Which joints make a wanted G."""

    spin: Text
    """The joint whose speed makes it; its axis must be vertical."""
    align: Text | None = None
    """The joint that turns 'up' of what it carries onto the resultant of gravity and
    centripetal acceleration; none if not given. The tangential acceleration of a changing speed
    is **not** aligned: it is felt sideways to the arm. The acceleration of this joint jumps a
    little where a ramp ends."""


@dataclass(kw_only=True)
class Track(Input):
    """Segments, one after the other, of one joint or of a wanted G. Speeds in gaps are held."""

    joint: Text | None = None
    """Name of the joint; or else resultant."""
    resultant: Resultant | None = None
    """Which joints make a wanted G; or else joint."""
    segments: Some[
        Annotated[Ramp | Hold | Turn | Knots | Sampled | Oscillation | Fourier, Tagged()]
    ]
    """In their order in time."""

    def problems(self) -> Problems:
        """The segments are those of a joint, or those of a resultant."""
        yield from either(self, "joint", "resultant")
        for j, segment in enumerate(self.segments):
            place, kind = f"segments[{j + 1}]", type(segment).__name__
            if self.resultant is None:
                if isinstance(segment, Ramp) and segment.to_g is not None:
                    yield f"{place}.to_g", "in a track of a joint, expected to_deg_s"
            elif isinstance(segment, Hold):
                continue
            elif not isinstance(segment, Ramp):
                yield place, f"!{kind} in a track of the resultant, expected !Ramp, !Hold"
            elif segment.to_g is None:
                yield f"{place}.to_deg_s", "in a track of the resultant, expected to_g"
            elif segment.blend == "linear" and self.resultant.align is not None:
                align = f"the aligned joint '{self.resultant.align}' would have to jump in speed"
                yield f"{place}.blend", f"'linear', expected cosine: {align}"

    @property
    def joints(self) -> list[str]:
        """The joint whose speed the segments give; of a resultant the aligned one too."""
        if self.resultant is None:
            return [self.joint or ""]
        return [j for j in (self.resultant.spin, self.resultant.align) if j is not None]


FELT_QUANTITIES = ("roll", "pitch", "roll rate", "pitch rate", "yaw rate")
"""What can be felt wrongly: angles of the head from the true vertical, rates about its axes."""


@dataclass(kw_only=True)
class IntendedIllusion(Input):
    """The illusion that a motion is meant to give: an error of feeling between two times."""

    quantity: Annotated[str, OneOf(FELT_QUANTITIES)]
    """What is to be felt wrongly: an angle from the true vertical, or a rate about an axis of the
    head (x forward, y left, z up)."""
    sign: Annotated[int, Field(ge=-1, le=1)] = setting(unit="-")
    """1: felt more than it is; -1: less; 0: either. Positive are roll to the right, pitch nose up,
    and rates about x, y and z."""
    start: NotNegative = setting(unit="s")
    """From when on it is looked for."""
    end: Positive = setting(unit="s")
    """Until when."""
    from_start: bool = False
    """Whether it is the change of the error since its start that counts."""

    def problems(self) -> Problems:
        """It ends after its start."""
        if self.end <= self.start:
            yield "end", f"{self.end:g}, expected more than start, {self.start:g}"


@dataclass(kw_only=True)
class MotionProfile(Input):
    """Commanded speeds of the joints."""

    name: str = ""
    """Short name; that of the file by default."""
    title: str = ""
    """Of the illusion that it makes."""
    description: str = ""
    """One sentence."""
    feels: str = ""
    """One sentence: what the pilot should feel."""
    illusion: IntendedIllusion | None = None
    """The error of feeling that it is meant to give, which a model of the pilot predicts or not."""
    notes: str = ""
    """What is assumed, what a device cannot do, sources."""
    duration: Positive = setting(unit="s")
    """Of the whole motion."""
    start_deg: EachJoint[Number] | None = setting(None, unit="deg", side="joint")
    """Joint angles at the start, base to tip; all 0 if not given."""
    q0: EachJoint[Number] | None = setting(None, unit="rad", side="joint")
    """The same in rad; one of both."""
    tracks: list[Track] = setting([])
    """What moves; other joints stay where they are."""
    joints: EachJointOrNone[Annotated[Knots | Sampled | Oscillation | Fourier, Tagged()]] = setting(
        []
    )
    """Instead of tracks, one segment for each joint, base to tip."""

    def problems(self) -> Problems:
        """It is said once what moves and where it starts; there is one resultant."""
        if bool(self.tracks) == bool(self.joints):
            yield "tracks", "expected what moves, either here or in joints"
        if self.start_deg is not None and self.q0 is not None:
            yield "q0", "beside start_deg, expected one of both"
        resultants = [i + 1 for i, track in enumerate(self.tracks) if track.resultant is not None]
        for i in resultants[1:]:
            yield f"tracks[{i}].resultant", f"tracks[{resultants[0]}] has one already"


def load_profile(path: str | Path) -> MotionProfile:
    """A motion profile from YAML, or the shipped one of a name.

    Raises:
        InputError: naming the file, the field, and what would be right.
    """
    profile, file = load_yaml(MotionProfile, path, "motion")
    profile.name = profile.name or file.stem
    return profile


def shipped_motions() -> list[str]:
    """Names of the training motions that ship with the package: those that a pilot feels."""
    return [name for name in shipped("motion") if load_profile(name).feels]
