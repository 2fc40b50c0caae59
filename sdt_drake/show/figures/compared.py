"""Figures of several controllers on one motion: side by side, and over each other over time."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from sdt_drake.analysis.comparison import Compared
from sdt_drake.analysis.metrics import COMPARED, METRICS
from sdt_drake.analysis.tracking import constant_speed_segments
from sdt_drake.io.arguments import typed
from sdt_drake.io.arrays import Array
from sdt_drake.io.shown import numbered
from sdt_drake.motion import Motion
from sdt_drake.pilot.head import has_head
from sdt_drake.run.options import in_print
from sdt_drake.run.recording import Recording
from sdt_drake.show import style
from sdt_drake.show.panels import Panel, over_time, picture
from sdt_drake.show.style import Look

# --- over time -------------------------------------------------------------------------------


def looked(runs: Mapping[str, Recording]) -> list[tuple[str, Look, Recording]]:
    looks = style.looks_of(list(runs))
    return list(zip(map(in_print, runs), looks, runs.values(), strict=True))


def error_panels(
    runs: Mapping[str, Recording], joint_names: Sequence[str], motion: Motion
) -> list[Panel]:
    """Make the panels of speed errors; intervals of constant speed have a grey ground."""
    lines = [(name, look, run.speed_error) for name, look, run in looked(runs)]
    largest = [[f"{label} {x:.3g}" for x in np.abs(v).max(axis=0)] for label, _, v in lines]
    return over_time(
        "speed error [rad/s]", motion.time, lines, joint_names,
        marked=constant_speed_segments(motion.v, motion.period), marked_label="constant speed",
        notes=[f"largest: {', '.join(of_joint)} rad/s" for of_joint in zip(*largest, strict=True)],
    )  # fmt: skip


def compared_panels(compared: Sequence[Compared]) -> dict[str, list[Panel]]:
    """Make the panels of speed errors, position errors and torques, one for each joint."""
    runs = {one.label: one.recording for one in compared}
    design = compared[0].design
    names, time = design.device.simulated.joint_names, compared[0].recording.time
    positions = [(name, look, np.degrees(run.position_error)) for name, look, run in looked(runs)]
    torques = [(name, look, run.tau) for name, look, run in looked(runs)]
    return {
        "speed": error_panels(runs, names, design.reference.planned),
        "position": over_time("position error [deg]", time, positions, names),
        "torque": over_time("torque [N m], motor side", time, torques, names),
    }


@typed
def overlays(title: str, compared: Sequence[Compared]) -> style.Picture:
    """Draw the speed errors of controllers over each other, a panel for each joint."""
    return picture(title, [compared_panels(compared)["speed"]])


# --- side by side ----------------------------------------------------------------------------


@typed
def comparison(title: str, compared: Sequence[Compared]) -> Figure:
    """Draw controllers side by side: errors, torques, and the share of time with a felt error."""
    names = numbered(compared[0].design.device.simulated.joint_names)
    has_heads = all(has_head(c.design.device.simulated) for c in compared)
    looks = style.looks_of([c.label for c in compared])
    with style.style():
        bottom = 2.55 if has_heads else 0.85
        figure, _ = style.grid(3, 2, panel=(3.95, 1.55), gaps=(1.15, 0.35), bottom=bottom)
        for ax, metric in zip(figure.axes, COMPARED, strict=False):  # without the saturation
            values = METRICS[metric].factor * np.array([c.metrics[metric] for c in compared])
            _side_by_side(ax, values, compared, looks, dots=metric.endswith("_error"))
            ax.set_title(METRICS[metric].label, loc="left")
            ax.set_xticks(np.arange(len(names)), names)
        if has_heads:
            _felt(figure, compared, looks)
        return style.finish(figure, title)


def _side_by_side(
    ax: Axes, values: Array, compared: Sequence[Compared], looks: Sequence[Look], *, dots: bool
) -> None:
    """Draw values of m controllers, shape (m, n), around the place of each joint.

    Values on a logarithmic axis are dots, as the foot of a bar would have no meaning there.
    """
    m, n = values.shape
    width, at = 0.8 / m, np.arange(n)
    for i, (c, look) in enumerate(zip(compared, looks, strict=True)):
        own: dict[str, Any] = {"color": look.colour, "label": in_print(c.label)}
        place = at + (i - (m - 1) / 2) * width
        if dots:
            above = np.where(values[i] > 0, values[i], np.nan)
            ax.plot(place, above, look.marker, markersize=5, **own)
        else:
            ax.bar(place, values[i], width, **own)
    for k in np.flatnonzero(~np.any(values > 0, axis=0)).tolist():
        text = "not\napplicable" if np.isnan(values[:, k]).all() else "none"
        ax.text(
            k, 0.5, text, transform=ax.get_xaxis_transform(), color="0.35",
            horizontalalignment="center", verticalalignment="center",
        )  # fmt: skip
    if not np.any(values > 0):
        ax.set_yticks([])
    elif dots:
        ax.set_yscale("log")
        style.plain_numbers(ax.yaxis)
    ax.set_xlim(-0.5, n - 0.5)
    ax.grid(axis="x", visible=False)
    for k in at[1:]:
        ax.axvline(k - 0.5, color="0.85", linewidth=0.8)


def _felt(figure: Figure, compared: Sequence[Compared], looks: Sequence[Look]) -> None:
    """Add a panel below the others: the share of time in which the pilot can feel the error."""
    left, right = (ax.get_position() for ax in figure.axes[-2:])
    inch = 1 / figure.get_figheight()
    ax = figure.add_axes((left.x0, 0.95 * inch, right.x1 - left.x0, 1.0 * inch))
    at = np.arange(len(compared))
    share = [100 * c.head.felt.share for c in compared]
    bars = ax.bar(at, share, 0.6, color=[look.colour for look in looks])
    ax.bar_label(bars, [f"{value:.1f}" for value in share], fontsize=8)
    ax.set_title(METRICS["felt_share"].label, loc="left")
    ax.set(ylim=(0, 115), yticks=(0, 50, 100))
    ax.set_xticks(at, [in_print(c.label).replace(" +", "\n+") for c in compared], fontsize=7)
    ax.grid(axis="x", visible=False)
