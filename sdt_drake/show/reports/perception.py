"""Predictions of what a pilot feels, beside what people reported and what motions are meant for."""

from __future__ import annotations

from collections.abc import Sequence

from sdt_drake.analysis.illusions import Intended
from sdt_drake.analysis.reported import Judged
from sdt_drake.show.documents import Table


def reported_table(rows: Sequence[Judged]) -> Table:
    """What people reported, and what each set predicts with its verdict; see `reported_notes`."""
    models = list(rows[0].predicted)
    cells = [[row.id, row.reported, *map(row.cell, models)] for row in rows]
    return Table(["motion", "people", *models], cells)


def reported_notes(rows: Sequence[Judged]) -> list[str]:
    """What was done and reported, by the ids of the table, with its source."""
    return [f"{row.id}: {row.stimulus}: {row.quantity}; {row.source}." for row in rows]


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
