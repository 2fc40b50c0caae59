"""Predictions of what a pilot feels, beside what people reported and what motions are meant for."""

from __future__ import annotations

from collections.abc import Sequence

from sdt_drake.analysis.illusions import Intended
from sdt_drake.analysis.reported import Judged
from sdt_drake.show.documents import Table


def reported_table(rows: Sequence[Judged], *, short: bool = False) -> Table:
    """What people reported, and what each set predicts with its verdict; `short` has ids in place
    of motions and sources."""
    models = list(rows[0].predicted)
    cells = [
        [
            row.id if short else f"{row.stimulus}: {row.quantity}",
            row.reported,
            *map(row.told, models),
            *([] if short else [row.source]),
        ]
        for row in rows
    ]
    return Table(["motion", "people", *models, *([] if short else ["source"])], cells)


def intended_table(rows: Sequence[Intended]) -> Table:
    """The illusion that each training motion is meant to give, as far as sets predict it."""
    models = list(rows[0].predicted)
    cells = [
        [
            row.motion,
            row.quantity,
            *(f"{row.predicted[m]:+.1f} {'✓' if row.is_predicted(m) else '✗'}" for m in models),
        ]
        for row in rows
    ]
    return Table(["motion", "felt less true", *models], cells)
