"""Figures of a flight and of a device that follows it."""

from dataclasses import replace

import numpy as np
from matplotlib.figure import Figure

from sdt_drake.io.arrays import Array
from sdt_drake.machine.cueing.candidate import Candidate
from sdt_drake.machine.cueing.result import CueingResult
from sdt_drake.pilot.head import GRAVITY
from sdt_drake.pilot.thresholds import CHANNELS
from sdt_drake.show.panels import Line, Panel
from sdt_drake.show.style import LOOKS, PALETTE, Look, finish, grid, style

DEVICE = Look(PALETTE[1])


def _beside(title: str, label: str, x: Array, flown: Array, device: Array) -> Panel:
    lines = [Line("flight", LOOKS["reference"], flown), Line("device", DEVICE, device)]
    return Panel(title, "time [s]", label, x, lines)


def force_panels(candidate: Candidate) -> list[Panel]:
    """Make the panels of resultant G and of specific force along each axis of the head."""
    time = candidate.time
    both = np.array([candidate.flight.at(time)[0], candidate.head.specific_force]) / GRAVITY
    return [
        _beside("resultant", "G", time, *np.linalg.norm(both, axis=2)),
        *(_beside(x, "force [G]", time, *both[:, :, k]) for k, x in enumerate(CHANNELS[3:])),
    ]


def attitude_panels(flown: CueingResult) -> list[Panel]:
    """Make the panels of felt roll and pitch, with the aircraft's attitude."""
    panels = []
    time, felt, own = flown.chosen.time, flown.felt, flown.chosen.percept
    attitude = flown.chosen.flight.attitude
    for k, name in enumerate(("roll", "pitch")):
        lines = []
        if felt is not None and own is not None:
            in_flight = np.interp(time, felt.time, getattr(felt, name))
            on_device = np.interp(flown.chosen.motion.time, own.time, getattr(own, name))
            lines = [
                Line("felt in flight", LOOKS["reference"], np.degrees(in_flight)),
                Line("felt on the device", DEVICE, np.degrees(on_device)),
            ]
        if attitude is not None:
            true = np.interp(time, flown.chosen.flight.time, attitude[:, k])
            lines.append(Line("of the aircraft", Look("0.6", "--"), np.degrees(true)))
        if lines:
            panels.append(Panel(name, "time [s]", "angle [deg]", time, lines))
    return panels


def rotation_panels(candidate: Candidate) -> list[Panel]:
    """Make the panels of the head's rate and its felt error, by axis."""
    flown, own = candidate.flight.at(candidate.time)[1], candidate.head.angular_velocity
    panels = []
    for k, name in enumerate(CHANNELS[:3]):
        felt = Line("felt error", Look(PALETTE[2]), np.degrees(candidate.felt_rate_error[:, k]))
        both = np.degrees(flown[:, k]), np.degrees(own[:, k])
        panel = _beside(name, "rate [deg/s]", candidate.time, *both)
        panels.append(replace(panel, lines=[*panel.lines, felt]))
    return panels


def front(flown: CueingResult) -> Figure:
    """Draw felt rotation and felt vertical over G error: the front, chosen motion and baselines."""
    labels = ("felt rotation error, RMS [deg/s]", "felt vertical, RMS [deg]")
    looks = (DEVICE, *map(Look, PALETTE[2:]))
    with style():
        figure, axes = grid(1, 2, panel=(4.6, 3.6), left=0.85)
        for k, (ax, label) in enumerate(zip(axes[0], labels, strict=True), 1):
            places = [one.errors(flown.felt) for _, one in flown.front]
            ax.plot([place[0] for place in places], [place[k] for place in places],
                    color="0.2", marker="o", markersize=4, label="not excelled")  # fmt: skip
            for one, look in zip(flown.candidates, looks, strict=False):
                errors = one.errors(flown.felt)
                ax.plot(errors[0], errors[k], color=look.colour, marker="s", linestyle="",
                        label=one.name)  # fmt: skip
            ax.set_xlabel("G error, RMS [G]")
            ax.set_ylabel(label)
            ax.set_xlim(left=0)
            ax.set_ylim(bottom=0)
        return finish(figure, "From near in G to the device at rest")
