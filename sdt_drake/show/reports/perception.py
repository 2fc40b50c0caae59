"""Tables of predicted perception beside people's reports and intended illusions."""

from collections.abc import Sequence

from sdt_drake.pilot.illusions import Intended
from sdt_drake.pilot.reported import Judged
from sdt_drake.show.sections import Table


def reported_table(rows: Sequence[Judged]) -> Table:
    """Make the table of people's reports and of each parameter set's prediction with verdict.

    `reported_notes` describes the rows.
    """
    models = list(rows[0].predicted)
    cells = [[row.id, row.reported, *map(row.cell, models)] for row in rows]
    return Table(["motion", "people", *models], cells)


def reported_notes(rows: Sequence[Judged]) -> list[str]:
    """Return sentences on stimulus, reported quantity and source of each row."""
    return [f"{row.id}: {row.stimulus}: {row.quantity}; {row.source}." for row in rows]


INTENDED = (
    "✓: predicted; (✓): felt, but by a pilot without canals, too; ✗: too small to feel. The value "
    "is felt minus true, or the felt value itself where the row says felt."
)


def intended_table(rows: Sequence[Intended]) -> Table:
    """Make the table of the intended illusion of each training motion, with the predictions."""
    models = list(rows[0].predicted)
    cells = [
        [
            row.motion,
            f"{row.quantity}{', felt' * (row.meant.of == 'felt')}",
            *(f"{row.predicted[model].size:+.1f} {_sign(row, model)}" for model in models),
            f"{row.force_alone.size:+.1f}",
        ]
        for row in rows
    ]
    return Table(["motion", "value", *models, "no canals"], cells)


def _sign(row: Intended, model: str) -> str:
    """Return the sign of a prediction; see INTENDED."""
    if not row.is_felt(model):
        return "✗"
    return "✓" if row.needs_canals else "(✓)"
