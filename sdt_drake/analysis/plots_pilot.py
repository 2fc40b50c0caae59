"""The figure of what the pilot feels."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullFormatter
from numpy.typing import NDArray

from sdt_drake.analysis import plots
from sdt_drake.analysis.tracking import HeadTracking
from sdt_drake.pilot import CHANNELS, GRAVITY, canals

Array = NDArray[np.float64]

REFERENCE, ACHIEVED, CANALS = plots.PALETTE[:3]

_ROTATION, _FORCE, _ANGLES = plots.PALETTE[3], plots.PALETTE[5], "0.55"

_SPAN = 500  # of the logarithmic scale of the error at most [-]


def pilot(title: str, time: Array, head: HeadTracking) -> Figure:
    """A column for each axis of the head; rows: specific force, rotation, and the felt error.

    Args:
        title: of the figure.
        time: [s], shape (N,).
        head: along the same N samples.
    """
    period = float(time[1] - time[0])
    with plots.style():
        figure = Figure(figsize=(11, 8.2))
        axes = figure.subplots(3, 3, sharex=True, sharey="row")
        figure.subplots_adjust(0.065, 0.115, 0.985, 0.9, wspace=0.08, hspace=0.2)
        for axis, (force, rotation, error) in enumerate(axes.T):
            _force(force, time, head, axis)
            _rotation(rotation, time, period, head, axis)
            _error(error, time, head, axis)
            error.set_xlabel("time [s]")
            error.set_xlim(time[0], time[-1])
            # A number at the right end would run into that at the left end of the next panel.
            error.locator_params(axis="x", prune="upper")
        for ax, label in zip(
            axes[:, 0],
            ("specific force [G]", "rate of turn [deg/s]", "error over what is just felt"),
            strict=True,
        ):
            ax.set_ylabel(label)
        felt, angles = (100 * f.share for f in (head.felt, head.felt_from_angles))
        figure.suptitle(
            f"{title}\nThe error could be felt {felt:.1f} % of the time, "
            f"by the joint angles alone {angles:.1f} %",
            y=0.985,
        )
        handles = {}
        for ax in axes[:, 0]:
            handles |= dict(zip(*ax.get_legend_handles_labels()[::-1], strict=True))
        figure.legend(handles.values(), handles.keys(), loc="lower center", ncols=4)
    return figure


def _force(ax, time: Array, head: HeadTracking, axis: int) -> None:
    for label, colour, dashes, motion in _motions(head):
        in_g = motion.specific_force[:, axis] / GRAVITY
        ax.plot(time, in_g, dashes, color=colour, label=label)
    along = ("x, forward", "y, left", "z, up")[axis]
    ax.set_title(f"force along {along}", loc="left", fontweight="bold")


def _rotation(ax, time: Array, period: float, head: HeadTracking, axis: int) -> None:
    for label, colour, dashes, motion in _motions(head):
        ax.plot(
            time,
            np.degrees(motion.angular_velocity[:, axis]),
            dashes,
            color=colour,
            label=label,
        )
    told = np.degrees(canals(head.achieved.angular_velocity[:, axis], period))
    ax.plot(time, told, color=CANALS, label="what the canals tell (achieved)")
    about = ("x, roll right", "y, nose down", "z, turn left")[axis]
    ax.set_title(f"rotation about {about}", loc="left", fontweight="bold")


def _error(ax, time: Array, head: HeadTracking, axis: int) -> None:
    felt, angles = head.felt.multiples, head.felt_from_angles.multiples
    top = max(2.0, 1.5 * float(felt.max()))
    foot = min(0.1, max(float(felt.max()) / 20, top / _SPAN))
    ax.axhspan(foot, 1, color="0.93", linewidth=0)
    ax.axhline(1, color="0.2", linewidth=0.9, label="just felt")
    ax.plot(time, angles[:, 3 + axis], ":", color=_ANGLES, label="force, by joint angles alone")
    ax.plot(time, felt[:, axis], color=_ROTATION, label="error of rotation")
    ax.plot(time, felt[:, 3 + axis], color=_FORCE, label="error of force")
    ax.set_yscale("log")
    ax.set_ylim(foot, top)
    ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    ax.yaxis.set_minor_formatter(NullFormatter())
    ax.set_title(f"{CHANNELS[axis]}, {CHANNELS[3 + axis]}", loc="left", fontweight="bold")


def _motions(head: HeadTracking):
    return (
        ("reference", REFERENCE, "-", head.reference),
        ("achieved", ACHIEVED, "--", head.achieved),
    )
