"""The paper's claims in a report: a table, and on a page cards that a filter chooses from."""

from __future__ import annotations

import html
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from sdt_drake.analysis.claims import NOT_COMPARABLE, NOT_REPRODUCED, REPRODUCED, VERDICTS
from sdt_drake.analysis.metrics import plain_number
from sdt_drake.show.documents import Inline, Table

Json = Mapping[str, Any]
"""A part of summary.json."""

LOOKS = {
    REPRODUCED: ("good", "✓"),
    NOT_REPRODUCED: ("bad", "✗"),
    NOT_COMPARABLE: ("open", "–"),
}
"""Class of page.css and sign of each verdict: colour is never the only difference."""


def count_verdicts(claims: Sequence[Json]) -> dict[str, int]:
    """How many claims of summary.json have each of VERDICTS."""
    return {verdict: sum(c["verdict"] == verdict for c in claims) for verdict in VERDICTS}


@dataclass(frozen=True)
class Claims:
    """The claims of summary.json: a table, and on a page cards that a filter chooses from."""

    claims: Sequence[Json]
    joints: int

    def markdown(self) -> str:
        rows = [
            [
                claim["id"],
                claim["statement"],
                _listed(claim["published"]),
                _listed(claim["computed"]),
                f"**{claim['verdict']}**",
                claim["why"],
            ]
            for claim in self.claims
        ]
        header = ["id", "the paper", "published", "computed", "verdict", "why"]
        return Table(header, rows).markdown()

    def html(self, inline: Inline) -> str:
        buttons = f'<button type="button" aria-pressed="true">all {len(self.claims)}</button>'
        for verdict, count in count_verdicts(self.claims).items():
            buttons += (
                f'<button type="button" aria-pressed="false" data-verdict="{verdict}">'
                f"{verdict} {count}</button>"
            )
        cards = "".join(self._card(claim, inline) for claim in self.claims)
        return (
            f'<div class="filter" role="group" aria-label="Claims shown" hidden>{buttons}</div>'
            f'<p class="shown" role="status"></p>{cards}'
        )

    def _card(self, claim: Json, inline: Inline) -> str:
        verdict, anchor = claim["verdict"], html.escape(claim["id"])
        look, sign = LOOKS[verdict]
        values = _value_table(claim["published"], claim["computed"], self.joints)
        return (
            f'<article class="claim" data-verdict="{verdict}" id="claim-{anchor}">'
            f'<p class="verdict {look}"><span aria-hidden="true">{sign}</span> {verdict}</p>'
            f"<h3>{inline(claim['statement'])}</h3>{values.html(inline)}"
            f'<p class="why">{inline(claim["why"])}</p></article>'
        )


def _value_table(published: Any, computed: Any, joints: int) -> Table:
    """Published above computed; what is not of each joint stands below all of them."""
    if isinstance(published, dict):
        header = ["", *(key.replace("_", " ") for key in published)]
        of = (("published", published), ("computed", computed))
        return Table(header, [[label, *map(_listed, x.values())] for label, x in of])
    rows = [*_value_rows("published", published), *_value_rows("computed", computed)]
    of_joints = any(len(row) == joints + 1 for row in rows)
    return Table(["", *(f"joint {k + 1}" for k in range(joints))] if of_joints else [], rows)


def _value_rows(label: str, value: object) -> list[list[str]]:
    if isinstance(value, dict):
        return [
            row
            for key, item in value.items()
            for row in _value_rows(f"{label}, {key.replace('_', ' ')}", item)
        ]
    return [[label, *map(_listed, value if isinstance(value, list) else [value])]]


def _listed(value: object) -> str:
    """A value of the summary in words."""
    if isinstance(value, dict):
        return "; ".join(f"{key.replace('_', ' ')} {_listed(v)}" for key, v in value.items())
    if isinstance(value, list):
        return ", ".join(map(_listed, value))
    if value is None:
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    return plain_number(value) if isinstance(value, float) else str(value)
