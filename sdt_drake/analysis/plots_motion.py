"""The figure of a planned motion."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from sdt_drake.analysis import plots
from sdt_drake.motion import Margins, Plan
from sdt_drake.robot import Robot

Array = NDArray[np.float64]

PLANNED, COMMANDED, TIGHTEST = plots.PALETTE[0], plots.PALETTE[4], plots.PALETTE[1]

_LIMIT = "0.45"
_FAR = 3  # speeds; a limit farther off would squeeze them into a line


def plan(title: str, robot: Robot, planned: Plan, margins: Margins) -> Figure:
    """A row for each joint: its torque and its speed against their limits, joint side.

    Held back: where the planner did not let a joint accelerate, or a path go on, as commanded.

    Args:
        title: of the figure.
        robot: has the limits.
        planned: the motion, and what was commanded.
        margins: of the motion.
    """
    motion, commanded = planned.motion, planned.commanded
    with plots.style():
        figure = Figure(figsize=(11, 1.2 + 1.75 * robot.n))
        axes = figure.subplots(robot.n, 2, sharex=True, squeeze=False)
        height = figure.get_figheight()
        figure.subplots_adjust(0.08, 0.8 / height, 0.985, 1 - 0.75 / height, 0.17, 0.42)
        for k, (torque, speed) in enumerate(axes):
            _limits(torque, motion.time, robot.effort_limit[k], "0.75", "motor")
            for left in (margins.lowest[:, k], margins.highest[:, k]):
                if np.any(np.abs(left) < robot.effort_limit[k]):
                    torque.plot(motion.time, left, ":", color="black", label="left at this speed")
            if planned.torque_margin < 1:
                _limits(
                    torque,
                    motion.time,
                    planned.torque_margin * robot.effort_limit[k],
                    _LIMIT,
                    "used",
                )
            torque.plot(motion.time, margins.torque[:, k], color=PLANNED, label="planned")
            speed.plot(
                commanded.time, commanded.v[:, k], color=COMMANDED, lw=2.4, label="commanded"
            )
            speed.plot(motion.time, motion.v[:, k], color=PLANNED, label="planned")
            limit = robot.velocity_limit[k]
            fastest = max(np.abs(motion.v[:, k]).max(), np.abs(commanded.v[:, k]).max())
            if limit < _FAR * fastest:
                _limits(speed, motion.time, limit, "0.75", "speed limit")
            elif np.isfinite(limit):
                speed.set_title(f"limit ±{limit:.3g} rad/s", loc="left")
            for ax in (torque, speed):
                _held_back(ax, planned, k)
                ax.margins(x=0)
            _mark_tightest(torque, speed, margins, planned, k)
            torque.set_ylabel("torque [N m]")
            speed.set_ylabel("speed [rad/s]")
            torque.set_title(f"joint {k + 1}, {robot.joint_names[k]}", loc="left", weight="bold")
        for ax in axes[-1]:
            ax.set_xlabel("time [s]")
        figure.suptitle(title, y=1 - 0.12 / height, verticalalignment="top")
        handles = {}
        for ax in axes.flat:
            handles |= dict(zip(*ax.get_legend_handles_labels()[::-1], strict=True))
        figure.legend(handles.values(), handles.keys(), loc="lower center", ncols=len(handles))
    return figure


def _limits(ax: Axes, time: Array, limit: float, colour: str, kind: str) -> None:
    label = {"motor": "limit", "used": "limit with margin", "speed limit": "limit"}[kind]
    for i, level in enumerate((limit, -limit)):
        ax.plot(
            time[[0, -1]],
            [level, level],
            color=colour,
            linewidth=1.4,
            label=label if i == 0 else "_lower",
        )


def _held_back(ax: Axes, planned: Plan, k: int) -> None:
    low, high = ax.get_ylim()
    ax.fill_between(
        planned.motion.time,
        low,
        high,
        where=planned.limited[:, k],
        color="0.5",
        alpha=0.18,
        linewidth=0,
        zorder=0,
        label="held back" if planned.limited.any() else "_held_back",
    )
    ax.set_ylim(low, high)


def _mark_tightest(torque: Axes, speed: Axes, margins: Margins, planned: Plan, k: int) -> None:
    """A ring where the joint is nearest to a limit, and in words which."""
    place = margins.tightest(k)
    i = int(np.argmin(np.abs(margins.time - place.time)))
    if place.quantity == "speed":
        ax, value = speed, planned.motion.v[i, k]
    else:
        ax, value = torque, margins.torque[i, k]
    if place.quantity in ("speed", "torque", "torque at speed"):
        ring = {"markerfacecolor": "none", "markeredgewidth": 1.6, "markersize": 9}
        ax.plot(place.time, value, "o", color=TIGHTEST, label="tightest", clip_on=False, **ring)
    speed.set_title(
        f"tightest: {place.quantity}, {100 * place.share:.1f} % of its limit at {place.time:.2f} s",
        loc="right",
    )
