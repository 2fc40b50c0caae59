"""Checks of a flight's recording: units and axes."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from sdt_drake.machine.cueing.flight import Flight
from sdt_drake.machine.diagnose import constants as c
from sdt_drake.machine.diagnose.finding import Finding, finding
from sdt_drake.pilot.head import GRAVITY


def check_flight(flight: Flight) -> list[Finding]:
    """Return what a flight shows by itself, by the forces and rates that aircraft have."""
    notes = [Finding("reading", note) for note in flight.notes]
    found = [*notes, *_force(flight), *_rate(flight)]
    return [replace(one, source=flight.name) for one in found]


def _force(flight: Flight) -> Iterator[Finding]:
    """Yield the first doubt about unit and axes of the force."""
    size, mean = np.linalg.norm(flight.specific_force, axis=1), flight.specific_force.mean(axis=0)
    low, usual = (float(x) for x in np.quantile(size, [0.1, 0.5]))
    along = int(np.argmax(np.abs(mean)))
    evidence = {"tenth_m_s2": low, "median_m_s2": usual, "mean_m_s2": float(mean[along])}
    if c.FORCES_IN_G[0] < usual < c.FORCES_IN_G[1] and low > 0.3 and size.max() < GRAVITY:
        yield finding("unit/g", (), "force_unit: g", **evidence)
    elif low < c.LEAST_G * GRAVITY:
        yield finding("unit/gravity", **evidence)
    elif low > c.MOST_G * GRAVITY:
        yield finding("unit/feet", (), "force_unit: ft/s2", tenth_G=low / GRAVITY, **evidence)
    elif along != 2:
        yield finding("columns/order", axis="xyz"[along], **evidence)
    elif mean[2] < 0:
        yield finding("columns/down", (), "axes: frd", **evidence)


def _rate(flight: Flight) -> Iterator[Finding]:
    """Yield a doubt about the unit of the angular rate."""
    omega = flight.angular_rate
    fastest, typical = float(np.abs(omega).max()), float(np.linalg.norm(omega, axis=1).mean())
    if fastest > c.MAX_RATE or typical > c.MAX_MEAN_RATE:
        rates = {"mean_rad_s": typical, "largest_rad_s": fastest}
        yield finding("unit/degrees", (), "omega_unit: deg/s", **rates)
