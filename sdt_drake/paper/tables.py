"""Tables of the report on the recomputed paper."""

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from sdt_drake.analysis.metrics import METRICS, plain_number
from sdt_drake.io.shown import formatted
from sdt_drake.paper.published import TABLE1, table1
from sdt_drake.run.options import in_print
from sdt_drake.show.sections import Marked, Table, spread

Json = Mapping[str, Any]
"""A part of summary.json."""


def value_table(claim: Json) -> Table:
    """Make the table of published and computed values of a claim.

    Values of joints have a column for each joint; other values have the column "all".
    """
    published, computed = claim["published"], claim["computed"]
    if isinstance(published, dict):
        header = ["", *(key.replace("_", " ") for key in published)]
        of = {"published": published, "computed": computed}
        return Table(header, [[name, *map(_listed, x.values())] for name, x in of.items()])
    rows = [*_value_rows("published", published), *_value_rows("computed", computed)]
    n = max(len(values) for _, values in rows)
    if n == 1:
        return Table(["", ""], [[name, *values] for name, values in rows])
    whole = [values if len(values) == n else [""] * n + values for _, values in rows]
    width = max(map(len, whole))
    header = ["", *(f"joint {k + 1}" for k in range(n)), *["all"] * (width - n)]
    cells = [[*values, *[""] * (width - len(values))] for values in whole]
    return Table(header, [[name, *x] for (name, _), x in zip(rows, cells, strict=True)])


def _value_rows(name: str, value: object) -> list[tuple[str, list[str]]]:
    if isinstance(value, dict):
        return [
            row
            for key, item in value.items()
            for row in _value_rows(f"{name}, {key.replace('_', ' ')}", item)
        ]
    return [(name, [_listed(x) for x in (value if isinstance(value, list) else [value])])]


def in_a_cell(value: object) -> str:
    """Return a value of a claim as a short text; values of several kinds are only in its table."""
    if isinstance(value, dict):
        parts = list(value.values())
        nested = any(isinstance(part, (dict, list)) for part in parts)
        return "in its table" if nested else ", ".join(map(in_a_cell, parts))
    if isinstance(value, list):
        return ", ".join(map(in_a_cell, value))
    is_number = isinstance(value, float) and math.isfinite(value)
    return f"{float(f'{value:.4g}'):g}" if is_number else _listed(value)


def _listed(value: object) -> str:
    """Return a value of the summary as text."""
    if value is None:
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    return plain_number(value) if isinstance(value, float) else str(value)


def runs_table(
    labels: Sequence[str],
    names: Iterable[Sequence[str]],
    entries: Sequence[Json],
    metrics: Sequence[str],
) -> Table:
    """Make a table with a row for each entry, and a value of each metric for each joint."""
    rows = [
        [*own, *([METRICS[m].text(value) for value in entry[m]] for m in metrics)]
        for own, entry in zip(names, entries, strict=True)
    ]
    return spread([*labels, *(METRICS[m].column for m in metrics)], rows)


RUN = ("plant", "process", "Algorithm 1", "controller", "A")


def run_cells(run: Json) -> list[str]:
    amplitude = f"{run['disturbance_amplitude']:g}"
    return [run["plant"], run["process"], run["algorithm"], in_print(run["controller"]), amplitude]


def label_cells(entry: Json) -> list[str]:
    return [in_print(entry["controller"])]


def inertia_table(rows: Sequence[Json]) -> Table:
    columns = {
        "i_eff_max": ("I_eff,max [kg m²]", ".2f"),
        "i_eff_median": ("median", ".2f"),
        "i_eff_min": ("min", ".2f"),
        "variation_percent": ("variation [%]", ".2f"),
        "kp": ("K_PS [N m s/rad]", ".1f"),
        "ki": ("K_IS [N m/rad]", ".0f"),
        "zeta_max": ("zeta at max", ".3f"),
        "zeta_median": ("at median", ".3f"),
        "zeta_min": ("at min", ".3f"),
    }
    published = [
        [f"{table1(name)[k]:g}" if name in TABLE1 else "–" for name in columns]
        for k in range(len(rows))
    ]
    names = [f"joint {k + 1}" for k in range(len(rows))]
    return _pairs(columns, names, rows, published)


def steps_table(steps: Json) -> Table:
    columns = {
        "rise_time": ("rise, 10–90 % [s]", ".4f"),
        "settling_time": ("settling, 2 % [s]", ".4f"),
        "overshoot_percent": ("overshoot [%]", ".3f"),
    }
    structures = {"pi": "PI on the error", "p_in_feedback": "I-P"}
    published = [[steps["published"][key][name] for name in columns] for key in structures]
    return _pairs(columns, structures.values(), [steps[key] for key in structures], published)


def _pairs(
    columns: Mapping[str, tuple[str, str]],
    names: Iterable[str],
    computed: Sequence[Json],
    published: Sequence[Sequence[str]],
) -> Table:
    """Make a table with a computed and a published row for each name.

    `columns` contains title and format by key.
    """
    rows = []
    for name, values, printed in zip(names, computed, published, strict=True):
        known = {key: math.nan if values[key] is None else values[key] for key in columns}
        rows.append([name, *(formatted(known[key], spec) for key, (_, spec) in columns.items())])
        rows.append([Marked("*published*"), *printed])
    return Table(["", *(title for title, _ in columns.values())], rows)


def felt_table(beyond: Sequence[Json]) -> Table:
    rows = [
        [
            *label_cells(entry),
            METRICS["felt_share"].text(entry["felt"]["share"]),
            *(f"{value:.2f}" for value in entry["felt"]["largest"]),
        ]
        for entry in beyond
    ]
    header = ["controller", METRICS["felt_share"].column, *beyond[0]["felt"]["channels"]]
    return Table(header, rows)
