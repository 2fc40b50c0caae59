"""Checks of a flight's recording: units and axes, with the mapping that would correct them."""

from collections.abc import Generator, Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from sdt_drake.io.arrays import Array
from sdt_drake.machine.cueing.flight import FORCE_UNITS, Flight, FlightColumns
from sdt_drake.machine.diagnose import constants as c
from sdt_drake.machine.diagnose.attitude import contradictions
from sdt_drake.machine.diagnose.finding import Finding, finding
from sdt_drake.pilot.head import GRAVITY

Doubt = tuple[Finding, Mapping[str, Any]]
"""A finding, with the fields of a mapping that would correct it; none if nothing would."""

_UNITS = {
    **{
        unit: ("m/s²" if unit == "m/s2" else unit.replace("2", "²"), unit, 1.0)
        for unit in FORCE_UNITS
    },
    "mg": ("thousandths of g", "g", 1e-3),
    **{f"1/{x} g": (f"counts of 1/{x} g", "g", 1 / x) for x in (2048, 4096, 8192, 16384)},
}


def check_flight(flight: Flight) -> list[Finding]:
    """Return what a flight shows by itself, by the forces and rates that aircraft have."""
    notes = [Finding("reading", note) for note in flight.notes]
    found = [*notes, *(one for one, _ in doubts(flight))]
    return [replace(one, source=flight.name) for one in found]


def doubts(flight: Flight) -> Iterator[Doubt]:
    """Yield doubts about unit and axes of the force, and about the unit of the rate.

    A change of the mapping is proposed only if the flight is plausible with it.
    """
    columns = flight.columns or FlightColumns()
    scale = yield from _unit(flight.specific_force, columns)
    yield from _axes(scale * flight.specific_force, columns)
    yield from _rate(flight.angular_rate, columns)
    yield from contradictions(flight)


def _unit(force: Array, columns: FlightColumns) -> Generator[Doubt, None, float]:
    """Yield a doubt about the unit of the force; return the factor to the likely one."""
    if _is_usual(force):
        return 1.0
    level, low, usual = (float(x) / GRAVITY for x in np.quantile(_size(force), [0.02, 0.1, 0.5]))
    now = columns.force_factor * FORCE_UNITS[columns.force_unit]
    ratios = {name: factor * FORCE_UNITS[x] / now for name, (_, x, factor) in _UNITS.items()}
    mean = np.linalg.norm(force.mean(axis=0)) / max(_size(force).mean(), 1e-300)
    has_gravity = mean > c.ONE_DIRECTION
    fits = [x for x, ratio in ratios.items() if has_gravity and _is_usual(ratio * force)]
    evidence = {"median_G": usual, "tenth_G": low}
    if not fits and c.LEAST_G < level < c.LEVEL_G:
        return 1.0  # a long pull, entered from level flight
    if not fits:
        kind = "unit/gravity" if low < c.LEAST_G else "unit/force"
        yield finding(kind, factor=columns.force_factor / max(usual, 1e-300), **evidence), {}
        return 1.0
    best = min(fits, key=lambda x: abs(np.log(ratios[x] * usual)))
    words, unit, factor = _UNITS[best]
    own = {"force_unit": (columns.force_unit, unit), "force_factor": (columns.force_factor, factor)}
    changes = {name: new for name, (old, new) in own.items() if old != new}
    then = ratios[best] * usual
    yield _changed("unit/other", changes, unit=words, then_G=then, **evidence), changes
    return ratios[best]


def _is_usual(force: Array) -> bool:
    """Return True for forces as large as those of aircraft."""
    low, usual = np.quantile(_size(force), [0.1, 0.5]) / GRAVITY
    return bool(low > c.LEAST_G and usual < c.MOST_G)


def _size(force: Array) -> Array:
    return np.asarray(np.linalg.norm(force, axis=1))


def _axes(force: Array, columns: FlightColumns) -> Iterator[Doubt]:
    """Yield a doubt about the axes of a force in a likely unit."""
    mean = force.mean(axis=0) / GRAVITY
    along = int(np.argmax(np.abs(mean)))
    if along != 2:
        evidence = {"mean_G": float(mean[along])}
        yield (
            finding("columns/order", column=columns.force[along], axis="xyz"[along], **evidence),
            {},
        )
        return
    if mean[2] > 0:
        return
    x, y, z = columns.force_direction
    kind = "columns/sign"
    changes: dict[str, Any] = {"force_direction": [x, y, -z]}
    if z == 1 and columns.axes == "flu":
        kind, changes = "columns/down", {"axes": "frd"}
    evidence = {"mean_G": float(mean[2]), "then_G": float(-mean[2])}
    yield _changed(kind, changes, column=columns.force[2], **evidence), changes


def _rate(omega: Array, columns: FlightColumns) -> Iterator[Doubt]:
    """Yield a doubt about the unit of the angular rate."""
    fastest, typical = float(np.abs(omega).max()), float(_size(omega).mean())
    over = max(fastest / c.MAX_RATE, typical / c.MAX_MEAN_RATE)
    if over <= 1:
        return
    rates = {"mean_rad_s": typical, "largest_rad_s": fastest}
    is_degrees = columns.omega_unit == "rad/s" and np.radians(over) <= 1
    changes = {"omega_unit": "deg/s"} if is_degrees else {}
    kind = "unit/degrees" if is_degrees else "unit/rate"
    yield _changed(kind, changes, then_rad_s=float(np.radians(fastest)), **rates), changes


def _changed(kind: str, changes: Mapping[str, Any], **values: Any) -> Finding:
    """Return a finding with changes of the mapping as its remedy."""
    texts = [
        f"{name}: [{', '.join(f'{v:g}' for v in x)}]" if isinstance(x, list) else f"{name}: {x}"
        for name, x in changes.items()
    ]
    return finding(kind, (), ", ".join(texts), **values)
