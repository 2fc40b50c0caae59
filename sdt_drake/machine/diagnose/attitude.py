"""Checks of a flight's rates against its attitude, or against its force."""

from collections.abc import Iterator
from itertools import permutations, product
from typing import Any

import numpy as np

from sdt_drake.io.arrays import Array
from sdt_drake.machine.cueing.flight import Flight, FlightColumns
from sdt_drake.machine.diagnose import constants as c
from sdt_drake.machine.diagnose.finding import Finding, finding
from sdt_drake.motion.trajectory import interpolated

_DELAYS = np.linspace(-3.0, 3.0, 121)  # s


def contradictions(flight: Flight) -> Iterator[tuple[Finding, dict[str, Any]]]:
    """Yield a doubt about signs, order or delay of the rates, with the mapping that corrects it.

    The direction down d turns as the rates say: d' = -omega x d. Without an attitude, a pull-up
    must raise the force.
    """
    columns = flight.columns or FlightColumns()
    if not columns.omega:
        return
    if flight.attitude is None:
        yield from _pull_up(flight, columns)
        return
    roll, pitch = flight.attitude.T
    down = -np.stack([np.sin(pitch), np.cos(pitch) * np.sin(roll), np.cos(pitch) * np.cos(roll)], 1)
    turning = np.gradient(down, flight.time, axis=0)
    size = np.sqrt((turning**2).mean())
    if size < c.TURNING:
        return

    def missed(rate: Array) -> float:
        return float(np.sqrt(((turning + np.cross(rate, down)) ** 2).mean()) / size)

    rate = flight.angular_rate
    own = missed(rate)
    if own < c.EXPLAINED:
        return
    found = {
        (order, signs): missed(rate[:, order] * signs)
        for order in permutations(range(3))
        for signs in product((1.0, -1.0), repeat=3)
    }
    best = min(found, key=lambda x: (found[x] > 1.1 * min(found.values()), _changes(x)))
    late = [missed(interpolated(flight.time + x, flight.time, rate)) for x in _DELAYS]
    delay = float(_DELAYS[int(np.argmin(late))])
    evidence = {"missed": own}
    if min(late) < c.FAR_LESS * own and min(late) <= found[best]:
        yield finding("columns/late rates", delay_s=delay, then=min(late), **evidence), {}
    elif found[best] < c.FAR_LESS * own:
        yield _as_mapping(columns, best, then=found[best], **evidence)


_Reading = tuple[tuple[int, ...], tuple[float, ...]]


def _changes(reading: _Reading) -> int:
    order, signs = reading
    return sum(k != i for i, k in enumerate(order)) + sum(x < 0 for x in signs)


def _as_mapping(
    columns: FlightColumns, reading: _Reading, **evidence: float
) -> tuple[Finding, dict[str, Any]]:
    """Return the finding of another order and other signs, as fields of the mapping."""
    order, signs = reading
    side = np.array([1.0, -1.0, -1.0] if columns.axes == "frd" else [1.0] * 3)
    old = side * columns.omega_direction
    new = np.array(signs) * old[list(order)] * side
    changes: dict[str, Any] = {}
    if order != (0, 1, 2):
        changes["omega"] = [columns.omega[k] for k in order]
    if np.any(new != columns.omega_direction):
        changes["omega_direction"] = new.tolist()
    remedy = ", ".join(
        f"{name}: [{', '.join(x if isinstance(x, str) else f'{x:g}' for x in values)}]"
        for name, values in changes.items()
    )
    return finding("columns/rates", (), remedy, **evidence), changes


def _pull_up(flight: Flight, columns: FlightColumns) -> Iterator[tuple[Finding, dict[str, Any]]]:
    force, up = flight.specific_force[:, 2], -flight.angular_rate[:, 1]
    if min(np.std(force), 30 * np.std(up)) < c.PULLED:
        return
    alike = float(np.corrcoef(force, up)[0, 1])
    if alike < -c.OPPOSED:
        x, y, z = columns.omega_direction
        changes = {"omega_direction": [x, -y, z]}
        remedy = f"omega_direction: [{x:g}, {-y:g}, {z:g}]"
        yield finding("columns/pull-up", (), remedy, correlation=alike), changes
