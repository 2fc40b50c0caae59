"""The characteristics of a device with their intervals, limits and verdicts."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import cached_property
from pathlib import Path

import numpy as np

from sdt_drake.analysis.metrics import Metric
from sdt_drake.io.arguments import a_path, takes
from sdt_drake.io.results import Results
from sdt_drake.io.shown import Figure, Shown, Summary, higher
from sdt_drake.machine.accept.spec import Acceptance
from sdt_drake.robot.robot import Robot

_DEG = float(np.degrees(1))

QUANTITIES = {
    "lowest": Metric("lowest angle", "deg", _DEG, ".2f"),
    "highest": Metric("highest angle", "deg", _DEG, ".2f"),
    "speed": Metric("speed reached", "deg/s", _DEG, ".2f"),
    "acceleration": Metric("acceleration reached", "deg/s²", _DEG, ".1f"),
    "gain": Metric("gain", "dB", 1, ".3f"),
    "phase": Metric("phase", "deg", _DEG, ".2f"),
    "low_nonlinearity": Metric("low-frequency non-linearity", "%", 100, ".2f"),
    "high_nonlinearity": Metric("high-frequency non-linearity", "%", 100, ".2f"),
    "noise": Metric("acceleration noise", "%", 100, ".2f"),
    "peak_noise": Metric("peak noise", "%", 100, ".1f"),
    "hysteresis": Metric("hysteresis", "deg", _DEG, ".4f"),
    "threshold": Metric("dynamic threshold", "ms", 1e3, ".1f"),
    "pose_accuracy": Metric("pose accuracy", "mm", 1e3, ".2f"),
    "pose_repeatability": Metric("pose repeatability", "mm", 1e3, ".3f"),
    "path_accuracy": Metric("path accuracy", "mm", 1e3, ".2f"),
    "path_repeatability": Metric("path repeatability", "mm", 1e3, ".3f"),
}
"""Characteristics by name, in the order of reports."""


SI = {"deg": "rad", "deg/s": "rad/s", "deg/s²": "rad/s²", "%": "-", "ms": "s", "mm": "m"}
"""Units of the computed numbers by those that are shown; dB stays."""


@dataclass(frozen=True)
class Characteristic:
    """A characteristic of a joint, the head, or a channel, with its interval and its limit."""

    kind: str
    """Kind of the test."""
    place: str
    """Joint, head or channel."""
    joint: int
    """Number of the joint that moves, 1..n; 0 for all."""
    quantity: str
    """Name in QUANTITIES."""
    at: float
    """Frequency of a sine [Hz], size of a step [rad/s²]; NaN for others."""
    value: float
    """The number [SI, dB]."""
    low: float
    """Lower end of its interval of 95 %."""
    high: float
    """Upper end of its interval."""
    least: float
    """Least allowed value; -inf without a limit."""
    most: float
    """Largest allowed value; inf without a limit."""

    @property
    def is_limited(self) -> bool:
        """True with a limit."""
        return bool(np.isfinite([self.least, self.most]).any())

    @property
    def verdict(self) -> str:
        """ "pass" or "fail" if the whole interval is in or out, "not judged" else; "" unlimited."""
        if not self.is_limited:
            return ""
        if self.least <= self.low and self.high <= self.most:
            return "pass"
        return "fail" if self.high < self.least or self.low > self.most else "not judged"

    @property
    def metric(self) -> Metric:
        """Title, unit and format."""
        return QUANTITIES[self.quantity]


@dataclass(frozen=True, eq=False, repr=False)
class Accepted(Shown):
    """The characteristics of a device, with intervals, limits and verdicts."""

    robot: Robot
    """The device."""
    spec: Acceptance
    """Tests and limits."""
    characteristics: tuple[Characteristic, ...]
    """All numbers, test after test."""
    left_out: tuple[str, ...]
    """Tests that were not planned or not recorded, as sentences."""

    @cached_property
    def counts(self) -> Mapping[str, int]:
        """Number of limited characteristics by verdict."""
        found = [x.verdict for x in self.characteristics]
        return {name: found.count(name) for name in ("pass", "fail", "not judged")}

    @property
    def is_passed(self) -> bool:
        """True if all limited characteristics pass, and there is one."""
        counts = self.counts
        return counts["pass"] > 0 and counts["fail"] == counts["not judged"] == 0

    def summary(self) -> Summary:
        counts = ", ".join(f"{count} {name}" for name, count in self.counts.items())
        rows = [
            (x.kind, x.place, x.metric.title, x.metric.text(x.value), x.metric.unit, x.verdict)
            for x in self.characteristics
            if x.is_limited
        ]
        header = "test", "of", "characteristic", "value", "unit", "verdict"
        return Summary(f"of {self.robot.name}: {counts}", header, rows, 3)

    def plot(self) -> Figure:
        """Return a figure of responses, noise and thresholds, with intervals and limits."""
        return higher("show.figures.accept:accept_figure")(self)

    @takes(path=a_path)
    def save(self, path: str | Path) -> None:
        """Write all numbers [SI; gains in dB] as .csv or .json.

        Raises:
            InputError: if the file cannot be written.
        """
        names = [field.name for field in fields(Characteristic)]
        rows = self.characteristics
        columns = {name: [getattr(x, name) for x in rows] for name in names}
        columns["unit"] = [SI.get(x.metric.unit, x.metric.unit) for x in rows]
        columns["verdict"] = [x.verdict for x in rows]
        Results({"robot": self.robot.name, "left_out": [*self.left_out]}, columns).write(Path(path))
