"""Figures of learning: convergence, and errors and torques by flight."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from sdt_drake.io.arrays import Array
from sdt_drake.machine.learn.filter import Convergence, LearningFilter
from sdt_drake.machine.learn.trials import Trial
from sdt_drake.show import style
from sdt_drake.show.panels import over_time, picture
from sdt_drake.show.style import Look


def checks(
    title: str, found: Sequence[Convergence], filter_: LearningFilter, joint_names: Sequence[str]
) -> Figure:
    """Draw the share of an error after a flight over frequency, a panel for each joint."""
    hertz = filter_.omega / (2 * np.pi)
    with style.style():
        figure, _ = style.grid(
            (len(joint_names) + 1) // 2, 2, panel=(3.95, 1.9), gaps=(0.75, 0.45), sharex=True
        )
        for k, name in enumerate(joint_names):
            ax = figure.axes[k]
            for i, one in enumerate(found):
                look = style.nth_look(i)
                label = f"{one.loops.title}, this joint alone"
                ax.loglog(hertz, one.share[:, k], look.dashes, color=look.colour, label=label)
                if i == len(found) - 1:
                    label = f"{one.loops.title}, all joints together"
                    ax.loglog(hertz, one.together, color="0.6", label=label, zorder=1)
            ax.axhline(1.0, color=style.PALETTE[1], linewidth=0.9, label="as large as before")
            cut, why = filter_.bandwidth[k]
            ax.axvline(cut / (2 * np.pi), color="0.4", linestyle=":", linewidth=0.9)
            ax.set_title(style.joint_title(k, name), loc="left", fontweight="bold")
            ax.set_title(f"up to {cut / (2 * np.pi):.3g} Hz: {why}", loc="right", fontsize=7)
            ax.set(ylim=(1e-4, 2), xlim=(hertz[0], hertz[-1]), ylabel="remaining error [-]")
            style.plain_numbers(ax.xaxis)
            style.plain_numbers(ax.yaxis)
        for ax in figure.axes[len(joint_names) :]:
            ax.set_visible(False)
        for ax in figure.axes[max(0, len(joint_names) - 2) : len(joint_names)]:  # lowest panels
            ax.set_xlabel("frequency [Hz]")
            ax.tick_params(labelbottom=True)
        return style.finish(figure, title)


def errors(title: str, time: Array, flown: Sequence[Trial], joint_names: Sequence[str]) -> Figure:
    """Draw position errors of flights over time, a panel for each joint."""
    lines = [
        (f"flight {flight.number}", Look(style.PALETTE[i]), np.degrees(flight.error))
        for flight, i in zip(flown, (1, 0), strict=False)
    ]
    largest = np.degrees([flight.largest for flight in flown])
    notes = [f"largest: {', '.join(f'{x:.3g}' for x in of_joint)} deg" for of_joint in largest.T]
    return picture(
        title, [over_time("position error [deg]", time, lines, joint_names, notes=notes)]
    )


def flights(title: str, flown: Sequence[Trial], joint_names: Sequence[str]) -> Figure:
    """Draw largest and RMS error, share of felt time, and peak torque over the flights."""
    number = [flight.number for flight in flown]
    panels = (
        ("largest position error [deg]", np.degrees([flight.largest for flight in flown])),
        ("RMS position error [deg]", np.degrees([flight.rms for flight in flown])),
        ("error that can be felt [% of time]", 100 * np.array([[f.felt] for f in flown])),
        ("peak torque [% of the motor]", 100 * np.array([flight.peak for flight in flown])),
    )
    with style.style():
        figure, axes = style.grid(2, 2, panel=(3.95, 1.9), gaps=(0.75, 0.45))
        for ax, (label, values) in zip(figure.axes, panels, strict=True):
            one = values.shape[1] != len(joint_names)
            for k in range(values.shape[1]):
                look = style.nth_look(k)
                ax.plot(
                    number,
                    values[:, k],
                    look.dashes,
                    color="black" if one else look.colour,
                    marker=look.marker,
                    markersize=4,
                    label=None if one else style.joint_title(k, joint_names[k]),
                )
            if label.endswith("[deg]") and np.all(values > 0):
                ax.set_yscale("log")
                style.plain_numbers(ax.yaxis)
            elif np.isnan(values).all():
                ax.text(0.5, 0.5, "no head", transform=ax.transAxes, ha="center")
                ax.set_yticks([])
            else:
                ax.set_ylim(0, None)
            ax.set_title(label, loc="left")
            ax.set_xticks(number)
        for ax in axes[-1]:
            ax.set_xlabel("flight")
        return style.finish(figure, title)
