"""The figure of an acceptance test: responses, noise and thresholds of joints and channels."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator

from sdt_drake.io.arguments import typed
from sdt_drake.machine.accept.results import QUANTITIES, Accepted, Characteristic
from sdt_drake.show import style

PANELS = (
    ("sine", "gain", "frequency [Hz]"),
    ("chain", "gain", "frequency [Hz]"),
    ("sine", "noise", "frequency [Hz]"),
    ("sine", "phase", "frequency [Hz]"),
    ("chain", "phase", "frequency [Hz]"),
    ("step", "threshold", "step [rad/s²]"),
)
"""Kind of the tests, characteristic, and label of the abscissa of each panel."""


@typed
def accept_figure(accepted: Accepted) -> Figure:
    """Draw the characteristics of joints and channels over frequency or size of a step.

    Bars are intervals of 95 %, grey lines are limits.
    """
    with style.style():
        figure, axes = style.grid(2, 3, panel=(2.75, 1.75), gaps=(0.75, 0.6), sharex=False)
        for ax, (kind, quantity, label) in zip(axes.ravel(), PANELS, strict=True):
            _panel(ax, accepted, kind, quantity)
            metric = QUANTITIES[quantity]
            ax.set(xscale="log", xlabel=label, ylabel=metric.label)
            ax.set_title("cueing chain" if kind == "chain" else "joints", loc="left")
            ax.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5), numticks=12))
            style.plain_numbers(ax.xaxis)
        return style.finish(figure, f"Acceptance test of {accepted.robot.name}")


def _panel(ax: Axes, accepted: Accepted, kind: str, quantity: str) -> None:
    by_place: dict[str, list[Characteristic]] = {}
    drawn = [x for x in accepted.characteristics if not x.place.startswith("head")]
    places = [*dict.fromkeys(x.place for x in drawn)]
    for x in drawn:
        if x.kind == kind and x.quantity == quantity and np.isfinite(x.value):
            by_place.setdefault(x.place, []).append(x)
    for place, numbers in by_place.items():
        look = style.nth_look(places.index(place))
        at, factor = [x.at for x in numbers], numbers[0].metric.factor
        value, low, high = factor * np.array([(x.value, x.low, x.high) for x in numbers]).T
        ax.errorbar(
            at, value, np.maximum([value - low, high - value], 0), color=look.colour,
            linestyle=look.dashes, marker=look.marker, markersize=3, linewidth=1, capsize=2,
            label=place,
        )  # fmt: skip
        limits = np.array([(x.least, x.most) for x in numbers])
        for column in factor * limits.T:
            ax.plot(at, np.where(np.isfinite(column), column, np.nan), color="0.6", linewidth=1)
