"""Acceptance tests as data: what is tested, the limits, and the tests of a planned folder."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from sdt_drake.io.fields import (
    EachJoint,
    FileOf,
    Input,
    Integer,
    NonEmpty,
    NotNegative,
    Number,
    Positive,
    Problems,
    Text,
    Values,
    check_joints,
    field,
)
from sdt_drake.io.yaml_files import load_yaml

Share = Annotated[Number, Field(gt=0, le=1)]
Kind = Literal["excursion", "speed", "sine", "hysteresis", "step", "poses", "chain"]
CHANNELS = ("surge", "sway", "heave", "roll", "pitch", "yaw")
"""Specific force along x, y, z and angular rate about x, y, z of the head."""
OMCT = (0.1, 0.158, 0.251, 0.398, 0.631, 1.0, 1.585, 2.512, 3.981, 6.310, 10.0, 15.849)
"""Frequencies of the objective motion cueing test by public papers on it [rad/s]."""


@dataclass(frozen=True)
class AcceptanceLimits(Input):
    """Limits of the characteristics; what is not given has no limit.

    A number is in or out if its whole interval is; else it is not judged.
    """

    lowest_deg: EachJoint[Number] | None = field(None, unit="deg", side="joint")
    """Angle that each joint must reach downwards."""
    highest_deg: EachJoint[Number] | None = field(None, unit="deg", side="joint")
    """Angle that each joint must reach upwards."""
    speed_deg: EachJoint[Positive] | None = field(None, unit="deg/s", side="joint")
    """Speed that each joint must reach."""
    acceleration_deg: EachJoint[Positive] | None = field(None, unit="deg/s²", side="joint")
    """Acceleration that each joint must reach."""
    gain_db: Positive | None = field(None, unit="dB")
    """Largest gain of a describing function, up or down."""
    phase_deg: Positive | None = field(None, unit="deg of phase")
    """Largest phase lag of a describing function."""
    up_to: Positive | None = field(None, unit="Hz")
    """Frequency up to which gain, phase and noise are limited; all by default."""
    low_nonlinearity: Positive | None = field(None, unit="-")
    """RMS acceleration of harmonics 2 and 3, over that of the fundamental."""
    high_nonlinearity: Positive | None = field(None, unit="-")
    """RMS acceleration of all higher harmonics, over that of the fundamental."""
    noise: Positive | None = field(None, unit="-")
    """RMS of all acceleration but the fundamental, over that of the fundamental."""
    peak_noise: Positive | None = field(None, unit="-")
    """Largest acceleration noise over the amplitude of the fundamental."""
    hysteresis_deg: Positive | None = field(None, unit="deg", side="joint")
    """Width of the loop of position over its reference."""
    threshold: Positive | None = field(None, unit="s")
    """Time until 63 % of a commanded acceleration step."""
    pose_accuracy: Positive | None = field(None, unit="m")
    """Distance of the mean of a pose from its command."""
    pose_repeatability: Positive | None = field(None, unit="m")
    """Mean distance from the mean of a pose, and three standard deviations."""
    path_accuracy: Positive | None = field(None, unit="m")
    """Largest distance of the mean path from its command."""
    path_repeatability: Positive | None = field(None, unit="m")
    """Largest mean distance from the mean path, and three standard deviations."""
    chain_gain_db: Positive | None = field(None, unit="dB")
    """Largest gain of the whole cueing chain, up or down."""
    chain_phase_deg: Positive | None = field(None, unit="deg of phase")
    """Largest phase lag of the whole cueing chain."""

    def allowed(
        self, kind: str, quantity: str, joint: int, frequency: float
    ) -> tuple[float, float]:
        """Return the least and the largest allowed value [SI]; infinite without a limit.

        Args:
            kind: kind of the test.
            quantity: name of the characteristic.
            joint: number of the joint, 1..n; 0 for the head.
            frequency: frequency of a sine [Hz]; 0 for other tests.
        """
        name = f"chain_{quantity}" if kind == "chain" else quantity
        if frequency > (self.up_to or np.inf) and kind == "sine":
            return -np.inf, np.inf
        for suffix, unit in (("", 1.0), ("_deg", np.radians(1)), ("_db", 1.0)):
            limit = getattr(self, name + suffix, None)
            if limit is None:
                continue
            x = unit * (limit if isinstance(limit, int | float) else limit[joint - 1])
            if quantity == "gain":
                return -x, x
            if quantity == "phase":
                return -x, np.inf
            at_least = quantity in ("highest", "speed", "acceleration")
            return (x, np.inf) if at_least else (-np.inf, x)
        return -np.inf, np.inf


@dataclass(frozen=True, kw_only=True)
class Acceptance(Input):
    """An acceptance test of a device: its motions, and the limits that you set."""

    pose_deg: EachJoint[Number] | None = field(None, unit="deg", side="joint")
    """Angles of the joints at rest; 0 by default, or 10 % of the range away from a stop."""
    share: Share = field(0.5, unit="-")
    """Share of the limits of speed and acceleration, and of the way to the stops, that the motions
    use."""
    torque_share: Share = field(0.8, unit="-")
    """Share of the torque of the motors that the motions use."""
    reach: Share = field(0.95, unit="-")
    """Share of the way to the stops in the test of excursions."""
    excursion_speed: Share = field(0.1, unit="-")
    """Share of the largest speed in the test of excursions."""
    frequencies: NonEmpty[Positive] = field((0.1, 0.2, 0.5, 1.0, 2.0, 5.0), unit="Hz")
    """Frequencies of sines for each joint."""
    least_amplitude_deg: Positive = field(0.01, unit="deg", side="joint")
    """Amplitude below which a sine is left out."""
    cycles: Integer = field(5, ge=3, le=1000, unit="-")
    """Measured cycles of each test; intervals come from their differences."""
    hysteresis_speed: Share = field(0.02, unit="-")
    """Share of the largest speed in the test of hysteresis, a slow triangle."""
    hysteresis_period: Positive = field(4.0, unit="s")
    """Period of the triangle; a second one takes twice the time, to separate lag."""
    steps: NonEmpty[Share] = field((0.02, 0.1, 0.5, 1.0), unit="-")
    """Sizes of acceleration steps, as shares of the largest one within all limits."""
    step_time: Positive = field(0.5, unit="s")
    """Duration of a step, and of the rest before it."""
    repeats: Integer = field(10, ge=3, le=1000, unit="-")
    """Repeated visits of the poses, along the same path."""
    dwell: Positive = field(1.0, unit="s")
    """Time at each pose; its second half is measured."""
    chain: Values[Positive] = field(OMCT, unit="rad/s")
    """Frequencies of the test of the whole cueing chain; none to leave it out."""
    chain_cycles: Integer = field(2, ge=2, le=1000, unit="-")
    """Measured cycles of each of them."""
    band: Positive = field(40.0, unit="Hz")
    """Frequency up to which accelerations are computed (-3 dB); a recording needs four times its
    rate."""
    limits: AcceptanceLimits = field(AcceptanceLimits)
    """Limits of the characteristics; none by default."""


@dataclass(frozen=True, kw_only=True)
class Test(Input):
    """A test: the same motion, cycle after cycle, in one of the planned motions."""

    __test__ = False  # pytest

    kind: Kind
    """Kind of the test."""
    joint: Integer = field(0, ge=0, unit="-")
    """Number of the joint, 1..n; 0 for all."""
    channel: Literal["", "surge", "sway", "heave", "roll", "pitch", "yaw"] = ""
    """Channel of the head in a test of the cueing chain."""
    size: Positive = field(unit="rad, rad/s²")
    """Largest angle of a joint; for steps the acceleration."""
    start: NotNegative = field(unit="s")
    """Start of the first measured cycle."""
    cycle: Positive = field(unit="s")
    """Duration of a cycle."""
    cycles: Integer = field(ge=2, unit="-")
    """Number of measured cycles."""
    dwells: Values[NotNegative] = field((), unit="s")
    """Ends of the rests at poses since the start of a cycle."""

    @property
    def end(self) -> float:
        """End of the last measured cycle [s]."""
        return self.start + self.cycles * self.cycle

    @property
    def frequency(self) -> float:
        """Frequency of a sine [Hz]; 0 for other tests."""
        return 1 / self.cycle if self.kind in ("sine", "chain") else 0.0

    def text(self, places: Sequence[str]) -> str:
        """Return the test in words, such as "sine at 2 Hz, 1 planetary"."""
        at = f" at {self.frequency:.3g} Hz" if self.frequency else ""
        of = self.channel or (places[self.joint - 1] if self.joint else "")
        return f"{self.kind}{at}{', ' * bool(of)}{of}"


@dataclass(frozen=True, kw_only=True)
class TestMotion(Input):
    """A motion from rest to rest with its tests."""

    __test__ = False  # pytest

    name: Text
    """Folder of the motion's files."""
    tests: NonEmpty[Test]
    """Tests in the order of time."""


@dataclass(frozen=True, kw_only=True)
class Manifest(Input):
    """The content of a planned folder, for `sdt-drake accept judge`."""

    scenario: Annotated[Text, FileOf("scenario")] = "scenario.yaml"
    """Scenario of the device, relative to this file's folder."""
    motions: NonEmpty[TestMotion]
    """Motions to record."""
    left_out: Values[str] = ()
    """Tests that the device cannot do, as sentences."""

    def problems(self) -> Problems:
        names = [motion.name for motion in self.motions]
        for i, name in enumerate(names):
            if name in names[:i]:
                yield f"motions[{i + 1}].name", f"{name} is given twice, expected once"


def load_acceptance(path: str | Path, n: int) -> Acceptance:
    """Load the acceptance test of a robot with `n` joints from YAML, or a shipped one by name.

    Raises:
        InputError: with a line for each problem: file, field, and what is accepted.
    """
    spec, file = load_yaml(Acceptance, path, "acceptance tests")
    check_joints(spec, file, n)
    return spec
