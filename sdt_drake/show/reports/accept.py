"""Sentences, tables and the two sheets of an acceptance test."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from sdt_drake.io.files import replacing_files
from sdt_drake.io.shown import formatted, numbered
from sdt_drake.machine.accept.results import QUANTITIES, Accepted, Characteristic
from sdt_drake.show.documents import MARKDOWN, REPORT, written
from sdt_drake.show.sections import Block, Box, Picture, Table, bullets, said
from sdt_drake.show.style import pictures

_TABLE, _FIGURE = "acceptance.csv", "responses"
FILES = (*pictures(_FIGURE), _TABLE, MARKDOWN, REPORT)
"""Names of all files of an acceptance test's report."""

_ORDER = "fail", "not judged", "pass"
_JOINTS = (
    ("excursion", "lowest"), ("excursion", "highest"), ("speed", "speed"),
    ("speed", "acceleration"), ("sine", "low_nonlinearity"), ("sine", "high_nonlinearity"),
    ("sine", "noise"), ("sine", "peak_noise"), ("hysteresis", "hysteresis"), ("step", "threshold"),
)  # fmt: skip
_NOTE = (
    "Intervals of 95 % come from the differences between cycles; they contain no error of the "
    "sensors. Gain and phase: position over its reference, mean of all cycles. Cueing chain: "
    "force or rate at the head over that of the commanded motion of the joints."
)


def accept_findings(accepted: Accepted) -> list[str]:
    """Return the verdict in sentences: how many limits are kept, and which are not."""
    return [*_findings(accepted)]


def _findings(accepted: Accepted) -> Iterator[str]:
    counts = accepted.counts
    total = sum(counts.values())
    if not total:
        yield "No limits were given, so nothing is judged."
        return
    yield (
        f"Of {total} limited characteristics {counts['pass']} pass, {counts['fail']} fail, and "
        f"{counts['not judged']} are not judged, as their intervals contain the limit."
    )
    for verdict in _ORDER[:2]:
        found = [x for x in _worst(accepted) if x.verdict == verdict]
        if found:
            yield f"{verdict.capitalize()}: {'; '.join(map(_named, found))}."


def accept_tables(accepted: Accepted) -> dict[str, Table | None]:
    """Make the tables of limits, joints, poses, sines, and the cueing chain; None for no rows."""
    limits = [
        (x.metric.title + " of the chain" * (x.kind == "chain"), _allowed(x), _at(x), _text(x),
         x.verdict)
        for x in _worst(accepted)
    ]  # fmt: skip
    poses = [(x.metric.title, _text(x)) for x in accepted.characteristics if x.kind == "poses"]
    tables = {
        "limits": Table(
            ("limit of", "allowed", "worst of", "value", "verdict"), limits, "Limits"
        ),
        "joints": _of_joints(accepted),
        "poses": Table(("poses and path", "value"), poses),
        "sines": _responses(accepted, "sine", "Describing functions of the joints"),
        "chain": _responses(accepted, "chain", "Cueing chain, channels of the head"),
    }  # fmt: skip
    return {name: table if table.rows else None for name, table in tables.items()}


def write_accepted(accepted: Accepted, title: str, folder: Path) -> Path:
    """Write the two sheets and the table of all numbers, all or none; return the page's path.

    Args:
        accepted: the characteristics.
        title: name of the device.
        folder: the folder.

    Raises:
        InputError: if a file cannot be written.
    """
    tables = accept_tables(accepted)
    names = "machine, serial number", "place, date", "tested by", "accepted by"
    form = Table(names, [["…" * 14] * 4])  # dotted lines to write on
    caption = "Bars are intervals of 95 %, grey lines limits. Left: gain and phase of the joints."
    figure = Picture(f"{_FIGURE}.png", caption, accepted.plot())
    responses = filter(None, (tables["sines"], tables["chain"]))
    sheet: list[Block] = [figure, *responses, said("{}", _NOTE)]
    left_out = (
        f"Not done, or not in full: {'; '.join(accepted.left_out)}." if accepted.left_out else None
    )
    report = written("accept", {
        "title": title, "findings": bullets(accept_findings(accepted)), "form": form,
        "left_out": left_out, **tables,
        "sheet": Box("div", sheet, ' class="sheet"'),
    })  # fmt: skip
    with replacing_files(folder) as new:
        accepted.save(new / _TABLE)
        report.write(new)
    return folder / REPORT


# --- tables --------------------------------------------------------------------------------------


def _worst(accepted: Accepted) -> list[Characteristic]:
    """Return the worst number of each limit, in the order of QUANTITIES and the chain last."""
    found: dict[tuple[object, ...], Characteristic] = {}
    for x in accepted.characteristics:
        key = x.quantity, x.least, x.most, x.kind == "chain"
        if x.is_limited and (key not in found or _rank(x) < _rank(found[key])):
            found[key] = x
    order = [*QUANTITIES]
    return sorted(found.values(), key=lambda x: (x.kind == "chain", order.index(x.quantity)))


def _rank(x: Characteristic) -> tuple[int, float]:
    return _ORDER.index(x.verdict), -max(x.least - x.value, x.value - x.most)


def _of_joints(accepted: Accepted) -> Table:
    """Return the largest value of each characteristic, a row each and a column per joint."""
    names = numbered(accepted.robot.joint_names)
    rows = []
    for kind, quantity in _JOINTS:
        cells = []
        for name in names:
            own = [
                x for x in accepted.characteristics
                if (x.kind, x.quantity, x.place) == (kind, quantity, name)
            ]  # fmt: skip
            cells.append(_text(max(own, key=lambda x: x.value), unit=False) if own else "–")
        if any(cell != "–" for cell in cells):
            rows.append((QUANTITIES[quantity].label, *cells))
    return Table(("largest of all tests", *names), rows, "Joints")


def _responses(accepted: Accepted, kind: str, title: str) -> Table:
    """Return gain and phase, a row per frequency and two columns per joint or channel."""
    numbers = {
        (x.at, x.place, x.quantity): x for x in accepted.characteristics
        if x.kind == kind and x.quantity in ("gain", "phase") and not x.place.startswith("head ")
    }  # fmt: skip
    places = [*dict.fromkeys(place for _, place, _ in numbers)]
    header = [f"{p}, {unit}" for p in places for unit in ("dB", "deg")]
    rows = [
        (
            f"{at:.3g}",
            *(
                _text(numbers[key], unit=False)
                if (key := (at, place, quantity)) in numbers
                else "–"
                for place in places
                for quantity in ("gain", "phase")
            ),
        )
        for at in sorted({at for at, _, _ in numbers})
    ]
    return Table(("frequency [Hz]", *header), rows, title)


def _text(x: Characteristic, *, unit: bool = True) -> str:
    """Return a number with half of its interval: "1.20 ± 0.05 deg"."""
    half = x.metric.factor * (x.high - x.low) / 2
    text = x.metric.text(x.value)
    if np.isfinite(half) and float(formatted(half, x.metric.format)) > 0:
        text += f" ± {formatted(half, x.metric.format)}"
    return f"{text} {x.metric.unit}" if unit else text


def _allowed(x: Characteristic) -> str:
    ends = x.metric.text(x.least), x.metric.text(x.most)
    if np.isinf(x.least):
        return f"≤ {ends[1]} {x.metric.unit}"
    return f"{'≥ ' + ends[0] if np.isinf(x.most) else ' to '.join(ends)} {x.metric.unit}"


def _at(x: Characteristic) -> str:
    unit = "rad/s²" if x.kind == "step" else "Hz"
    return x.place + ("" if np.isnan(x.at) else f" at {x.at:.3g} {unit}")


def _named(x: Characteristic) -> str:
    return f"{x.metric.title}, {_at(x)}, {_text(x)}, allowed {_allowed(x)}"
