"""Figures of learning: the check before the first flight, errors over time and by flight."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from sdt_drake.analysis.style import (
    PALETTE,
    finish,
    grid,
    joint_title,
    nth_look,
    plain_numbers,
    style,
)
from sdt_drake.arrays import Array
from sdt_drake.learning.convergence import Convergence
from sdt_drake.learning.filter import LearningFilter
from sdt_drake.learning.flights import Flight


def check(
    title: str, checks: Sequence[Convergence], filter_: LearningFilter, joint_names: Sequence[str]
) -> Figure:
    """What a flight leaves of an error over frequency, a panel for each joint."""
    hertz = filter_.omega / (2 * np.pi)
    with style():
        figure, axes = grid(
            (len(joint_names) + 1) // 2, 2, panel=(3.95, 1.9), gaps=(0.75, 0.45), sharex=True
        )
        for k, name in enumerate(joint_names):
            ax = axes.flat[k]
            for i, one in enumerate(checks):
                look = nth_look(i)
                loops = one.loops
                plural = f" ({loops.devices})" if loops.devices > 1 else ""
                label = f"{loops.name}{plural}, this joint alone"
                ax.loglog(hertz, one.share[:, k], look.dashes, color=look.colour, label=label)
                if i == len(checks) - 1:
                    label = f"{loops.name}{plural}, all joints together"
                    ax.loglog(hertz, one.together, color="0.6", label=label, zorder=1)
            ax.axhline(1.0, color=PALETTE[1], linewidth=0.9)
            cut, why = filter_.bandwidth[k]
            ax.axvline(cut / (2 * np.pi), color="0.4", linestyle=":", linewidth=0.9)
            ax.set_title(joint_title(k, name), loc="left", fontweight="bold")
            ax.set_title(f"up to {cut / (2 * np.pi):.3g} Hz: {why}", loc="right", fontsize=7)
            ax.set(ylim=(1e-4, 2), xlim=(hertz[0], hertz[-1]), ylabel="error that is left [-]")
            plain_numbers(ax.xaxis)
            plain_numbers(ax.yaxis)
        for ax in axes.flat[len(joint_names) :]:
            ax.set_visible(False)
        for ax in axes.flat[max(0, len(joint_names) - 2) : len(joint_names)]:  # the lowest shown
            ax.set_xlabel("frequency [Hz]")
            ax.tick_params(labelbottom=True)
        finish(figure, title)
    return figure


def errors(
    title: str, time: Array, flights: Sequence[Flight], joint_names: Sequence[str]
) -> Figure:
    """Position errors of some flights over time, a panel for each joint."""
    with style():
        figure, axes = grid(len(joint_names), 1, panel=(9.05, 1.55))
        for k, (ax, name) in enumerate(zip(axes[:, 0], joint_names, strict=True)):
            for i, flight in enumerate(flights):
                ax.plot(
                    time,
                    np.degrees(flight.error[:, k]),
                    color=PALETTE[(1, 0)[i]],
                    label=f"flight {flight.number}",
                )
            largest = ", ".join(f"{np.degrees(flight.largest[k]):.3g}" for flight in flights)
            ax.set_title(f"largest: {largest} deg", loc="right")
            ax.set_title(joint_title(k, name), loc="left", fontweight="bold")
            ax.set_ylabel("position error [deg]")
            ax.margins(x=0)
        axes[-1, 0].set_xlabel("time [s]")
        finish(figure, title)
    return figure


def by_flight(title: str, flights: Sequence[Flight], joint_names: Sequence[str]) -> Figure:
    """Largest and RMS error, what could be felt, and peak torque over the flights."""
    number = [flight.number for flight in flights]
    panels = (
        ("largest position error [deg]", np.degrees([flight.largest for flight in flights])),
        ("RMS position error [deg]", np.degrees([flight.rms for flight in flights])),
        ("error that can be felt [% of time]", 100 * np.array([[f.felt] for f in flights])),
        ("peak torque [% of the motor]", 100 * np.array([flight.peak for flight in flights])),
    )
    with style():
        figure, axes = grid(2, 2, panel=(3.95, 1.9), gaps=(0.75, 0.45))
        for ax, (label, values) in zip(axes.flat, panels, strict=True):
            one = values.shape[1] != len(joint_names)
            for k in range(values.shape[1]):
                look = nth_look(k)
                ax.plot(
                    number,
                    values[:, k],
                    look.dashes,
                    color="black" if one else look.colour,
                    marker=look.marker,
                    markersize=4,
                    label=None if one else joint_title(k, joint_names[k]),
                )
            if label.endswith("[deg]") and np.all(values > 0):
                ax.set_yscale("log")
                plain_numbers(ax.yaxis)
            elif np.isnan(values).all():
                ax.text(0.5, 0.5, "no head", transform=ax.transAxes, ha="center")
                ax.set_yticks([])
            else:
                ax.set_ylim(0, None)
            ax.set_title(label, loc="left")
            ax.set_xticks(number)
        for ax in axes[-1]:
            ax.set_xlabel("flight")
        finish(figure, title)
    return figure
