"""The figure of a motion plan."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from sdt_drake.io.arguments import typed
from sdt_drake.io.arrays import Array
from sdt_drake.motion import Margins, Plan
from sdt_drake.robot.robot import Robot
from sdt_drake.show.panels import shade
from sdt_drake.show.style import PALETTE, finish, grid, joint_title, style

PLANNED, TIGHTEST, COMMANDED = PALETTE[0], PALETTE[1], PALETTE[4]

_MAX_LIMIT = 3  # times the largest speed; a larger limit is a number above the panel


@typed
def plan(title: str, robot: Robot, planned: Plan, margins: Margins) -> Figure:
    """Draw torque and speed of a plan against their limits, joint side, a row for each joint.

    "Held back" marks where the planner accelerated a joint, or followed a path, more slowly than
    commanded.

    Args:
        title: title of the figure.
        robot: the robot with the limits.
        planned: the planned and the commanded motion.
        margins: torques and limits along the planned motion.
    """
    with style():
        figure, axes = grid(robot.n, 2, panel=(4.6, 1.25), gaps=(0.8, 0.5))
        for k, (torque, speed) in enumerate(axes):
            _torque(torque, robot, planned, margins, k)
            _speed(speed, robot, planned, k)
            for ax in (torque, speed):
                held_back = "held back" if planned.limited.any() else "_held_back"
                shade(ax, planned.motion.time, planned.limited[:, k], held_back)
                ax.margins(x=0)
            _mark_tightest(torque, speed, margins, planned, k)
            torque.set_title(joint_title(k, robot.joint_names[k]), loc="left", weight="bold")
        for ax in axes[-1]:
            ax.set_xlabel("time [s]")
        return finish(figure, f"{title}, joint side")


def _torque(ax: Axes, robot: Robot, planned: Plan, margins: Margins, k: int) -> None:
    time, limit = planned.motion.time, robot.effort_limit[k]
    _limits(ax, time, limit, "0.75", "limit")
    for left in (margins.lowest[:, k], margins.highest[:, k]):
        if np.any(np.abs(left) < limit):
            ax.plot(time, left, ":", color="black", label="limit at this speed")
    if planned.torque_margin < 1:
        _limits(ax, time, planned.torque_margin * limit, "0.45", "limit with margin")
    ax.plot(time, margins.torque[:, k], color=PLANNED, label="planned")
    ax.set_ylabel("torque [N m], joint side")


def _speed(ax: Axes, robot: Robot, planned: Plan, k: int) -> None:
    motion, commanded, limit = planned.motion, planned.commanded, robot.top_speed[k]
    ax.plot(commanded.time, commanded.v[:, k], color=COMMANDED, lw=2.4, label="commanded")
    ax.plot(motion.time, motion.v[:, k], color=PLANNED, label="planned")
    fastest = max(np.abs(motion.v[:, k]).max(), np.abs(commanded.v[:, k]).max())
    if limit < _MAX_LIMIT * fastest:
        _limits(ax, motion.time, limit, "0.75", "limit")
    elif np.isfinite(limit):
        ax.set_title(f"limit ±{limit:.3g} rad/s", loc="left")
    ax.set_ylabel("speed [rad/s]")


def _limits(ax: Axes, time: Array, limit: float, colour: str, label: str) -> None:
    for level, name in ((limit, label), (-limit, "_lower")):
        ax.plot(time[[0, -1]], [level, level], color=colour, linewidth=1.4, label=name)


def _mark_tightest(torque: Axes, speed: Axes, margins: Margins, planned: Plan, k: int) -> None:
    """Mark where the joint is closest to a limit by a ring, and name the limit."""
    place = margins.tightest(k)
    i = int(np.argmin(np.abs(margins.time - place.time)))
    ring: dict[str, Any] = {"markerfacecolor": "none", "markeredgewidth": 1.6, "markersize": 9}
    where = {
        "speed": (speed, planned.motion.v[i, k]),
        "torque": (torque, margins.torque[i, k]),
        "torque at speed": (torque, margins.torque[i, k]),
    }
    if place.quantity in where:
        ax, value = where[place.quantity]
        ax.plot(place.time, value, "o", color=TIGHTEST, label="tightest", clip_on=False, **ring)
    speed.set_title(
        f"tightest: {place.quantity}, {100 * place.share:.1f} % of its limit at {place.time:.2f} s",
        loc="right",
    )
