"""What is measured of a run: title, unit and format of each number, for all tables and figures."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import NamedTuple

from sdt_drake.io.arrays import Array
from sdt_drake.io.shown import formatted


class Metric(NamedTuple):
    """How a number is shown.

    Attributes:
        title: in words.
        unit: of the number shown; "" for one that nothing is known of.
        factor: from the number computed (SI; shares between 0 and 1) to the one shown.
        format: in tables.
        column: title and unit where several metrics stand side by side.
    """

    title: str
    unit: str
    factor: float = 1.0
    format: str = ".4g"
    column: str = ""

    @property
    def label(self) -> str:
        """Title and unit, for an axis or the head of a table."""
        return f"{self.title} [{self.unit}]" if self.unit else self.title

    def text(self, value: float | None) -> str:
        """A computed number as tables show it; a dash for none."""
        return "–" if value is None else formatted(self.factor * value, self.format)


def plain_number(value: float) -> str:
    """A number that has no format of its own: two decimals, or else four digits; no power of ten
    but for what is next to nothing."""
    size = abs(value)
    if size >= 1000:
        return f"{value:.0f}"
    if size >= 10:
        return f"{value:.2f}"
    return f"{value:.4g}" if size >= 1e-4 or size == 0 else f"{value:.1e}"


METRICS: dict[str, Metric] = {
    "max_abs_speed_error": Metric(
        "largest speed error", "rad/s", 1, ".4f", "largest error [rad/s]"
    ),
    "rms_speed_error": Metric("RMS speed error", "rad/s", 1, ".5f", "RMS [rad/s]"),
    "constant_speed_error": Metric(
        "speed error at constant speed", "rad/s", 1, ".4f", "constant speed [rad/s]"
    ),
    "max_abs_position_error": Metric(
        "largest position error", "deg", math.degrees(1), ".3f", "position [deg]"
    ),
    "rms_torque_share": Metric("RMS torque", "% of the motor", 100, ".1f", "torque RMS [%]"),
    "peak_torque_share": Metric("peak torque", "% of the motor", 100, ".1f", "torque peak [%]"),
    "saturated_fraction": Metric("saturation", "% of time", 100, ".2f", "saturated [%]"),
    "used_torque_share": Metric("torque used", "% of the motor", 100),
    "rated_torque_share": Metric("RMS torque", "% of rated", 100),
    "winding_temperature": Metric("winding temperature", "% of rated", 100),
    "torque_at_speed_share": Metric("torque at speed", "% of the envelope", 100),
    "stretch": Metric("stretch of the motion", "% of its time", 100),
    "felt_share": Metric("error that can be felt", "% of time", 100, ".1f", "felt [% of time]"),
}
"""By name; `name_k` is that of joint k. Less is better for each of them. Speeds and positions are
joint side; torques are shares of what the motor can give."""

COMPARED = tuple(name for name, metric in METRICS.items() if metric.column)[:-1]
"""The metrics of each joint by which controllers are compared, in the order of tables."""


def columns_of(values: Mapping[str, Array]) -> list[tuple[str, str, Array]]:
    """Columns of the metrics that are COMPARED, for tables with a row for each joint: title,
    format, and the values shown, shape (n,)."""
    own = ((METRICS[name], values[name]) for name in COMPARED if name in values)
    return [(metric.column, metric.format, metric.factor * x) for metric, x in own]


def family_of(name: str) -> tuple[str, int | None]:
    """Metric and joint (1..n) of an outcome: ("rms_speed_error", 2); None for no joint.

    Only METRICS have joints; another name is one of its own.
    """
    match = re.fullmatch(r"(.+)_([1-9]\d*)", name)
    if match and match[1] in METRICS:
        return match[1], int(match[2])
    return name, None


def metric_of(name: str) -> Metric:
    """How an outcome is shown; one that is not known, by its name and as it is."""
    return METRICS.get(family_of(name)[0], Metric(name, ""))


PARAMETERS_IN_WORDS = (
    "parameters of a body: mass, first moments hx, hy, hz (mass times place of its centre) and "
    "inertias Ixx to Izz, in the frame of the joint that turns it"
)
"""Names of what identification finds of a link."""
