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

DEVICE = Look(PALETTE[5])


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
            lines = [
                Line("felt in flight", LOOKS["reference"], np.degrees(in_flight)),
                Line("felt on the device", DEVICE, np.degrees(getattr(own, name))),
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
    """Draw felt rotation error over G error, by weight, with the chosen motion and baselines."""

    def place(candidate: Candidate) -> tuple[float, float]:
        figures = candidate.figures(None)
        return figures["g_error_rms"] or 0.0, figures["felt_rotation_rms_deg_s"] or 0.0

    with style():
        figure, ((ax,),) = grid(1, 1, panel=(7.2, 3.6), left=0.85)
        ax.plot(*zip(*sorted(place(one) for _, one in flown.front), strict=True),
                color="0.2", marker="o", markersize=4, label="by weight of G")  # fmt: skip
        for one, look in zip(flown.candidates, (DEVICE, *map(Look, PALETTE[1:4])), strict=False):
            ax.plot(*place(one), color=look.colour, marker="s", linestyle="", label=one.name)
        ax.set_xlabel("G error, RMS [G]")
        ax.set_ylabel("felt rotation error, RMS [deg/s]")
        ax.set_xlim(left=0)
        ax.set_ylim(bottom=0)
        return finish(figure, "Less of one error costs more of the other")
