"""Finding: something that a recording shows, with its evidence in numbers and in a sentence."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

Kind = Literal[
    "uneven", "rounded", "missing", "held", "repeated", "frozen", "clipped", "degrees", "clock",
    "speeds", "late speeds", "at limit", "beyond limit",
    "unit", "columns",
    "still", "driving", "late torques", "residual", "held out", "inconsistent", "excitation",
    "scenario", "controller",
    "noise", "converged", "limited", "assumed",
    "reading",
]  # fmt: skip
"""Kind of a finding.

- A recording alone: steps of time differ (uneven), times were rounded or taken on writing
  (rounded), samples are missing, each value is repeated for several samples (held), some samples
  repeat the one before (repeated), a signal stands for a while (frozen), a torque is cut off
  (clipped), positions are in degrees, a second of the clock is none (clock), a speed is not the
  derivative of its position (speeds) or lags behind it (late speeds), a motor is at its limit, a
  torque is far beyond it.
- Its columns and units, by the robot's links: torques or quantities of a flight have another unit;
  columns or axes have another order, sign, zero or direction (columns).
- What a fit leaves: a joint stands still, friction drives instead of braking, torques lag behind
  positions (late torques), rigid links and friction do not explain a torque, and something does
  (residual), held-out data are explained far worse than fitted data, links that can exist explain a
  torque worse than free parameters (inconsistent), the motion hardly excites some parameters.
- What a simulation of it leaves: one change explains a recording better (scenario), the controller
  commands another torque than the recorded one.
- Repeated trials of one motion: the error that repeats is below the noise, the last trial hardly
  reduced it (converged), a limit shortens the next step (limited), the reference was not recorded,
  so one is assumed.
- How the file was read: a part was left out or changed (reading).
"""


@dataclass(frozen=True)
class Finding:
    """Something that a recording shows; `str` gives it in words."""

    kind: Kind
    """Kind of the finding."""
    sentence: str
    """The finding as a sentence without its end."""
    joints: tuple[int, ...] = ()
    """The joints that show it, from 1; empty for the whole recording."""
    evidence: Mapping[str, float] = field(default_factory=dict)
    """Numbers by name [SI units in the name, else -], as the sentence tells them."""
    remedy: str = ""
    """The remedy as an entry of the mapping file; "" if there is none."""
    source: str = ""
    """Name of the recording's file; "" for a finding from several."""

    @property
    def spoils(self) -> bool:
        """True if the recording must be corrected before other conclusions."""
        return self.kind in ("rounded", "repeated", "frozen", "clipped", "degrees", "clock")

    def __str__(self) -> str:
        text = f"{self.source}: {self.sentence}" if self.source else self.sentence
        return f"{text} ({self.remedy} in the mapping file)" if self.remedy else text
