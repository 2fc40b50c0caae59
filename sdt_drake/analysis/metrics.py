"""Metrics of a run: title, unit and format of each number, for all tables and figures."""

import math
import re
from collections.abc import Mapping
from typing import NamedTuple

from sdt_drake.io.arrays import Array
from sdt_drake.io.shown import formatted


class Metric(NamedTuple):
    """Title, unit and format of a number in tables and figures."""

    title: str
    """Name of the number in words."""
    unit: str
    """Unit of the shown number; "" if it is unknown."""
    factor: float = 1.0
    """Shown over computed number (SI units; shares between 0 and 1)."""
    format: str = ".4g"
    """Format of the shown number in tables."""
    column: str = ""
    """Header of the column where several metrics are side by side."""

    @property
    def label(self) -> str:
        """Title and unit, for an axis or the header of a table."""
        return f"{self.title} [{self.unit}]" if self.unit else self.title

    def text(self, value: float | None) -> str:
        """Return a computed number as tables show it; a dash for None."""
        return "–" if value is None else formatted(self.factor * value, self.format)


def plain_number(value: float) -> str:
    """Return a number that has no format of its own as text.

    Numbers from 1000 have no decimals, from 10 two decimals, others four digits. Only numbers below
    1e-4 have a power of ten.

    >>> plain_number(4711.2), plain_number(47.112), plain_number(0.47112), plain_number(4.7e-5)
    ('4711', '47.11', '0.4711', '4.7e-05')
    """
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
    "stop_share": Metric("largest use of a limit of emergency stops", "% of it", 100),
    "felt_share": Metric("error that can be felt", "% of time", 100, ".1f", "felt [% of time]"),
}
"""Metrics by name; an outcome `name_k` is that of joint k. Smaller is better for each. Speeds and
positions are joint side; torques are shares of the motor's limit."""

COMPARED = tuple(name for name, metric in METRICS.items() if metric.column)[:-1]
"""Names of the joint metrics in which controllers are compared, in the order of tables."""


def columns_of(values: Mapping[str, Array]) -> list[tuple[str, str, Array]]:
    """Return columns of the COMPARED metrics: header, format and shown values, shape (n,).

    Args:
        values: computed values by name of METRICS, shape (n,); others are ignored.
    """
    own = ((METRICS[name], values[name]) for name in COMPARED if name in values)
    return [(metric.column, metric.format, metric.factor * x) for metric, x in own]


def family_of(name: str) -> tuple[str, int | None]:
    """Return metric and joint (1..n) of an outcome; the joint is None if the name has none.

    Only METRICS have joints; any other name is returned whole.

    >>> family_of("rms_speed_error_2"), family_of("cost_2")
    (('rms_speed_error', 2), ('cost_2', None))
    """
    match = re.fullmatch(r"(.+)_([1-9]\d*)", name)
    if match and match[1] in METRICS:
        return match[1], int(match[2])
    return name, None


def metric_of(name: str) -> Metric:
    """Return the metric of an outcome; an unknown one has its name as title and no unit."""
    return METRICS.get(family_of(name)[0], Metric(name, ""))


PARAMETERS_IN_WORDS = (
    "parameters of a body: mass, first moments hx, hy, hz (mass times position of its centre) and "
    "inertias Ixx to Izz, in the frame of the joint that turns it"
)
"""Legend of the identified parameters of a link."""
