"""Checks of a flight's recording: units and axes."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from sdt_drake.machine.cueing.flight import Flight
from sdt_drake.machine.diagnose import constants as c
from sdt_drake.machine.diagnose.finding import Finding
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
        text = f"its median force is {usual:.3g} m/s²: is it in g?"
        yield Finding("unit", text, (), evidence, "force_unit: g")
    elif low < c.LEAST_G * GRAVITY:
        text = f"its force is below {low:.3g} m/s² for a tenth of the time: was gravity subtracted?"
        text += " An accelerometer measures 9.81 m/s² at rest; add gravity"
        yield Finding("unit", text, (), evidence)
    elif low > c.MOST_G * GRAVITY:
        text = f"its force is above {low / GRAVITY:.3g} G for nine tenths of the time: is it in "
        yield Finding("unit", text + "ft/s²?", (), evidence, "force_unit: ft/s2")
    elif along != 2:
        text = f"its mean force is along {'xyz'[along]}, {mean[along]:.3g} m/s²: are the columns "
        text += "of force in another order? Expected: x forward, y left, z up"
        yield Finding("columns", text, (), evidence)
    elif mean[2] < 0:
        text = f"its mean force along z is {mean[2]:.3g} m/s²: is z down?"
        yield Finding("columns", text, (), evidence, "axes: frd")


def _rate(flight: Flight) -> Iterator[Finding]:
    """Yield a doubt about the unit of the angular rate."""
    omega = flight.angular_rate
    fastest, typical = float(np.abs(omega).max()), float(np.linalg.norm(omega, axis=1).mean())
    if fastest > c.MAX_RATE or typical > c.MAX_MEAN_RATE:
        text = f"its angular rate is {typical:.3g} rad/s on average, up to {fastest:.3g} rad/s: is "
        text += "it in degrees?"
        evidence = {"mean_rad_s": typical, "largest_rad_s": fastest}
        yield Finding("unit", text, evidence=evidence, remedy="omega_unit: deg/s")
