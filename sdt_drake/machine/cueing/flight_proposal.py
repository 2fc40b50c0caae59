"""Proposal of a mapping for the file of a flight, from its header and its numbers."""

import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from sdt_drake.io.errors import InputError
from sdt_drake.machine.cueing.flight import MIN_RATE, Flight, FlightColumns, read_flight
from sdt_drake.machine.diagnose.flight import doubts
from sdt_drake.machine.recordings.head import Head, read_head, words_of
from sdt_drake.machine.recordings.proposal import Proposal, differing
from sdt_drake.pilot.head import GRAVITY

_AIRCRAFT = (("p", "q", "r"), ("roll", "pitch", "yaw"))  # about x forward, y right, z down
_AXES = (  # parts of names, in any case, that differ within three columns
    ("x", "y", "z"), ("0", "1", "2"), ("1", "2", "3"), *_AIRCRAFT,
    ("axial", "_?side", "norml|normal"), ("long|lon", "lat", "norm|vert"),
    ("longitudinal", "lateral", "normal|vertical"),
)  # fmt: skip
_RATE = r"gyr|omega|rate|angular|rotation|dreh|\bw ?[xyz]?\b|deg s|rad s|^[pqr]\b"
_FORCE = r"acc|force|beschl|\bf ?[xyz]?\b|g ?load|\bg ?[fxyz]|\b[an] ?[xyz]\b|specific|ft sec|\bm s"
_NOT = r"mag|velocities [uvw]|jerk|angular acc"
_GRAVITY_LESS = r"linear acc|user|free"  # of phones: gravity is subtracted
_ROUNDS = 3


def proposal(path: Path) -> Proposal | None:
    """Return the likely meaning of a flight's columns, and what it gives.

    None without three columns of force and three of rate.
    """
    head = read_head(path, 4)
    if head is None or head.style.get("header") is False:
        return None
    force, omega = _triples(head)
    if not (force and omega):
        return None
    time = head.likely_time(MIN_RATE)
    mapping: dict[str, Any] = {**head.style, **time, "force": force, "omega": omega}
    if any(_axis_of(omega, axes) for axes in _AIRCRAFT):
        mapping["axes"] = "frd"
    words = head.words(omega[0])
    mapping["omega_unit"] = "deg/s" if re.search("deg|grad", words) else "rad/s"
    gives = ""
    for _ in range(_ROUNDS):  # the flight itself tells units and axes
        mapping = differing(mapping, FlightColumns())
        try:
            flight = read_flight(path, FlightColumns(**mapping))
        except InputError as error:
            gives = f"refused so far, {error}"
            break
        gives, changes = _in_short(flight), dict[str, Any]()
        for _, own in doubts(flight):
            changes |= own
        if not changes:
            break
        mapping |= changes
    words = f"force is probably in {', '.join(force)}, rate in {', '.join(omega)}: {gives}"
    return Proposal(words, mapping)


def _triples(head: Head) -> tuple[list[str], list[str]]:
    """Return the likely columns of force and of rate, both [] if not found."""
    force: list[list[str]] = []
    omega: list[list[str]] = []
    for three in _alike(head.names):
        words = head.words(three[0])
        if re.search(_NOT, words) or not all(np.isfinite(head.columns[x]).any() for x in three):
            continue
        if re.search(_RATE, words):
            omega.append(three)
        elif re.search(_FORCE, words):
            force.append(three)
    force.sort(key=lambda x: bool(re.search(_GRAVITY_LESS, words_of(x[0]))))
    return next(iter(force), []), next(iter(omega), [])


def _alike(names: Sequence[str]) -> Iterator[list[str]]:
    """Yield three columns whose names differ only by their axis."""
    for axes in _AXES:
        for name in names:
            three = _axis_of([name, *names], axes)
            if three:
                yield three


def _axis_of(names: Sequence[str], axes: Sequence[str]) -> list[str]:
    """Return the first name and those that differ by their axis; [] if they are not there."""
    first = names[0]
    for match in re.finditer(axes[0], first, re.IGNORECASE):
        before, after = re.escape(first[: match.start()]), re.escape(first[match.end() :])
        patterns = [re.compile(f"{before}({axis}){after}", re.IGNORECASE) for axis in axes[1:]]
        others = [next((x for x in names if one.fullmatch(x)), "") for one in patterns]
        if all(others):
            return [first, *others]
    return []


def _in_short(flight: Flight) -> str:
    """Return size, force and rate of a flight in words."""
    force = float(np.median(np.linalg.norm(flight.specific_force, axis=1))) / GRAVITY
    rate, rows = float(np.abs(flight.angular_rate).max()), len(flight.time)
    return (
        f"{rows} rows, {flight.duration:.4g} s at {(rows - 1) / flight.duration:.4g} Hz, median "
        f"force {force:.3g} G, mean along z {flight.specific_force[:, 2].mean() / GRAVITY:.3g} G, "
        f"rates up to {rate:.3g} rad/s"
    )
