"""The figure of what the pilot feels."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from sdt_drake.analysis.style import PALETTE, finish, grid, plain_numbers, style
from sdt_drake.analysis.tracking import HeadTracking
from sdt_drake.arrays import Array
from sdt_drake.pilot import CHANNELS, GRAVITY, HeadMotion, canals

REFERENCE, ACHIEVED, CANALS = PALETTE[:3]

_ROTATION, _FORCE, _ANGLES = PALETTE[3], PALETTE[5], "0.55"
_SPAN = 500  # of the logarithmic scale of the error at most [-]
_FORCE_TITLES = ("x, forward", "y, left", "z, up")
_ROTATION_TITLES = ("x, roll right", "y, nose down", "z, turn left")


def pilot(title: str, time: Array, head: HeadTracking) -> Figure:
    """A column for each axis of the head; rows: specific force, rotation, and the felt error.

    Args:
        title: of the figure.
        time: [s], shape (N,).
        head: along the same N samples.
    """
    period = float(time[1] - time[0])

    def in_g(motion: HeadMotion) -> Array:
        return motion.specific_force / GRAVITY

    def rate(motion: HeadMotion) -> Array:
        return np.degrees(motion.angular_velocity)

    with style():
        panel, gaps = (3.25, 1.95), (0.45, 0.4)
        figure, axes = grid(3, 3, panel=panel, gaps=gaps, left=0.7, bottom=1.0, top=0.85)
        for row in axes:
            for ax in row[1:]:
                ax.sharey(row[0])
                ax.tick_params(labelleft=False)
        for axis, (force, rotation, error) in enumerate(axes.T):
            _both(force, time, head, in_g, axis)
            force.set_title(f"force along {_FORCE_TITLES[axis]}", loc="left", fontweight="bold")
            _both(rotation, time, head, rate, axis)
            told = np.degrees(canals(head.achieved.angular_velocity[:, axis], period))
            rotation.plot(time, told, color=CANALS, label="what the canals tell (achieved)")
            about = f"rotation about {_ROTATION_TITLES[axis]}"
            rotation.set_title(about, loc="left", fontweight="bold")
            _error(error, time, head, axis)
        labels = ("specific force [G]", "rate of turn [deg/s]", "error over what is just felt")
        for ax, label in zip(axes[:, 0], labels, strict=True):
            ax.set_ylabel(label)
        felt, angles = (100 * f.share for f in (head.felt, head.felt_from_angles))
        subtitle = (
            f"The error could be felt {felt:.1f} % of the time, "
            f"by the joint angles alone {angles:.1f} %"
        )
        finish(figure, f"{title}\n{subtitle}")
    return figure


def _both(
    ax: Axes, time: Array, head: HeadTracking, quantity: Callable[[HeadMotion], Array], axis: int
) -> None:
    ax.plot(time, quantity(head.reference)[:, axis], color=REFERENCE, label="reference")
    ax.plot(time, quantity(head.achieved)[:, axis], "--", color=ACHIEVED, label="achieved")


def _error(ax: Axes, time: Array, head: HeadTracking, axis: int) -> None:
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
    plain_numbers(ax.yaxis)
    ax.set_title(f"{CHANNELS[axis]}, {CHANNELS[3 + axis]}", loc="left", fontweight="bold")
    ax.set_xlabel("time [s]")
    ax.set_xlim(time[0], time[-1])
    # A number at the right end would run into that at the left end of the next panel.
    ax.locator_params(axis="x", prune="upper")
