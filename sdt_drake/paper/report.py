"""The report on the recomputed paper, made from summary.json and the figures beside it."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from sdt_drake.analysis.metrics import METRICS, plain_number
from sdt_drake.io.errors import InputError
from sdt_drake.io.files import read_text, replacing_files, write_text
from sdt_drake.io.shown import formatted
from sdt_drake.paper.claims import (
    BEYOND,
    BY_CONSTRUCTION,
    NOT_COMPARABLE,
    NOT_REPRODUCED,
    OF_THE_PAPER,
    REPRODUCED,
    VERDICTS,
)
from sdt_drake.paper.published import TABLE1, table1
from sdt_drake.pilot.orientation import CAUTION
from sdt_drake.pilot.reported import LEGEND, Judged, verdict_of_all
from sdt_drake.show import documents as doc
from sdt_drake.show.reports.perception import reported_notes, reported_table

RECORDING, SUMMARY = "device.html", "summary.json"
FILES = ("table1.md", doc.MARKDOWN, doc.REPORT)
"""Files of a report, all of them written or none."""

_MAX_FILE_BYTES = 100_000_000
_OTHER_FORM = (LookupError, TypeError, ValueError, AttributeError, ArithmeticError)
"""Errors caused by a summary without the data of the report."""

Json = Mapping[str, Any]
"""A part of summary.json."""

LOOKS = {
    REPRODUCED: ("good", "✓"),
    NOT_REPRODUCED: ("bad", "✗"),
    NOT_COMPARABLE: ("open", "–"),
}
"""The class of page.css and the sign of each verdict; colour is never the only difference."""


def count_verdicts(claims: Sequence[Json]) -> dict[str, int]:
    """Count the claims of summary.json by verdict."""
    return {verdict: sum(c["verdict"] == verdict for c in claims) for verdict in VERDICTS}


def claims_in_words(claims: Sequence[Json]) -> str:
    """Return a sentence for each kind of claim of summary.json, with its verdicts."""
    sentences = []
    for kind, text in _KINDS.items():
        own = [claim for claim in claims if claim.get("kind", OF_THE_PAPER) == kind]
        counts = ", ".join(f"{n} {verdict}" for verdict, n in count_verdicts(own).items() if n)
        if own:
            sentences.append(text.format(n=len(own), counts=counts))
    return " ".join(sentences)


_KINDS = {
    OF_THE_PAPER: "Of {n} claims of the paper that were computed independently: {counts}.",
    BY_CONSTRUCTION: "{n} more agree by construction, as the device is calibrated to them.",
    BEYOND: "{n} ask the same beyond the paper, on the coupled plant: {counts}.",
}


def write_report(folder: Path, studies: Sequence[Mapping[str, object]] = ()) -> Path:
    """Write report.html, report.md and table1.md into a folder that `reproduce` has filled.

    Args:
        folder: the folder with summary.json and the figures.
        studies: chapters at the end, made by `study_chapter`.

    Returns:
        The path of the page.

    Raises:
        InputError: if a file is missing or cannot be used; nothing is written then.
    """
    with _advice(folder):
        values = _values(_read_summary(folder / SUMMARY))
        has_device = (folder / RECORDING).exists()
        text = doc.render("paper.md.j2", **values, has_device=has_device, studies=studies)
        table1 = doc.render("table1.md.j2", **values)
        page = doc.Report(text, folder, symbols=True).page()
    with replacing_files(folder) as new:
        for name, content in zip(FILES, (table1, text, page), strict=True):
            write_text(new / name, content)
    return folder / doc.REPORT


@contextmanager
def _advice(folder: Path) -> Iterator[None]:
    """Add to errors within which command writes the files."""
    try:
        yield
    except InputError as error:
        message = str(error)
    except _OTHER_FORM as error:
        reason = f"has no {error}" if isinstance(error, KeyError) else "has another form"
        message = f"{folder / SUMMARY}: {reason}, as another version has written it"
    else:
        return
    raise InputError(f"{message}; run `sdt-drake reproduce --out {folder}` first")


def _read_summary(path: Path) -> Json:
    if not path.exists():
        raise InputError(f"{path}: is missing")

    def refuse(text: str) -> float:
        raise InputError(f"{path}: contains {text}, expected finite numbers")

    try:
        return json.loads(read_text(path, _MAX_FILE_BYTES), parse_constant=refuse)
    except (json.JSONDecodeError, RecursionError):
        raise InputError(f"{path}: is not JSON") from None


def _numbers(summary: Json) -> dict[str, object]:
    """Return the numbers in the report's sentences."""
    runs = {
        (run["algorithm"], run["controller"]): run
        for run in summary["tracking"]
        if run["plant"] == "coupled" and run["disturbance_amplitude"] == 0
    }
    pi, ctc = runs["consistent", "pi"], runs["consistent", "pi_ctc"]
    printed = runs["printed", "pi_ctc"]
    largest, steady = "max_abs_speed_error", "constant_speed_error"
    of = {entry["controller"]: entry for entry in summary["beyond"]}
    rms_pi, rms_id = (np.array(of[label]["rms_speed_error"]) for label in ("pi", "pi_id"))
    drift, kept = (
        math.degrees(max(of[label]["max_abs_position_error"])) for label in ("pi", "p_pi+id")
    )
    apart = summary["pi_or_pi_ctc"]
    numbers = {
        "pi_error": pi[largest][1],
        "ctc_error": ctc[largest][1],
        "ctc_gain": pi[largest][1] / ctc[largest][1],
        "steady_gain": pi[steady][1] / ctc[steady][1],
        "printed_loss": printed[largest][1] / pi[largest][1],
        "id_gain_min": min(rms_pi / rms_id),
        "id_gain_max": max(rms_pi / rms_id),
        "drift": drift,
        "kept": kept,
        "apart": 100 * apart["share"],
        "apart_rotation": _worst(apart, slice(0, 3)),
        "apart_force": _worst(apart, slice(3, 6)),
    }
    for label, entry in of.items():
        name = label.replace("+", "_")
        numbers[f"felt_{name}"] = 100 * entry["felt"]["share"]
        numbers[f"angles_{name}"] = 100 * entry["felt"]["share_from_angles"]
    return numbers


def _reported(summary: Json) -> list[Judged]:
    """Read people's reports of motions; null in the summary becomes NaN."""

    def read(entry: dict[str, Any]) -> Any:
        return {name: math.nan if value is None else value for name, value in entry.items()}

    return [Judged(**read(entry)) for entry in summary["reported"]]


def findings(summary: Json) -> list[str]:
    """Return the most important results of summary.json as sentences."""
    return doc.bullets("findings.md.j2", **_numbers(summary))


def _worst(felt: Json, channels: slice) -> str:
    multiple, name = max(zip(felt["largest"][channels], felt["channels"][channels], strict=True))
    return f"{multiple:.2f} ({name})"


def _values(summary: Json) -> dict[str, object]:
    """Return the values of paper.md.j2."""
    beyond = [
        {**e, "rms_torque_share": e["rms_share"], "peak_torque_share": e["peak_share"]}
        for e in summary["beyond"]
    ]
    reported = _reported(summary)
    runs, claims, seconds = summary["tracking"], summary["claims"], summary["wall_time_s"]
    counts = count_verdicts(claims).items()
    speeds = ("max_abs_speed_error", "rms_speed_error", "constant_speed_error")
    position = "max_abs_position_error"
    torques = (position, "rms_torque_share", "peak_torque_share")
    times = {**seconds, "sum of the stages": sum(seconds.values())}
    return {
        **_numbers(summary),
        "versions": summary["versions"],
        "verdicts": [(count, verdict, LOOKS[verdict][0]) for verdict, count in counts],
        "claims_in_words": claims_in_words(claims),
        "claims": [
            {
                **claim,
                "place": claim.get("place", ""),
                "sign": LOOKS[claim["verdict"]][1],
                "numbers": value_table(claim),
            }
            for claim in claims
        ],
        "table1": _table1(summary["table1"]),
        "steps": _steps(summary["step_response"]),
        "runs_speeds": _by_joint(_RUN, map(_run, runs), runs, speeds),
        "runs_positions": _by_joint(_RUN, map(_run, runs), runs, (position, "saturated_fraction")),
        "beyond_speeds": _by_joint(["controller"], map(_label, beyond), beyond, speeds),
        "beyond_torques": _by_joint(["controller"], map(_label, beyond), beyond, torques),
        "felt": _felt(beyond),
        "both": verdict_of_all(reported),
        "caution": CAUTION,
        "reported": reported_table(reported),
        "reported_notes": reported_notes(reported),
        "legend": LEGEND,
        "needs": doc.Table(
            ["controller", "blocks", "needs to know"],
            [[*_label(e), str(e["blocks"]), ", ".join(e["needs"])] for e in beyond],
        ),
        "version_table": doc.Table(["", "version"], list(summary["versions"].items())),
        "times": doc.Table(["", "wall time [s]"], [[k, f"{v:.2f}"] for k, v in times.items()]),
    }


def value_table(claim: Json) -> doc.Table:
    """Make the table of published and computed values of a claim.

    Values of joints have a column for each joint; other values have the column "all".
    """
    published, computed = claim["published"], claim["computed"]
    if isinstance(published, dict):
        header = ["", *(key.replace("_", " ") for key in published)]
        of = {"published": published, "computed": computed}
        return doc.Table(header, [[name, *map(_listed, x.values())] for name, x in of.items()])
    rows = [*_value_rows("published", published), *_value_rows("computed", computed)]
    n = max(len(values) for _, values in rows)
    if n == 1:
        return doc.Table(["", ""], [[name, *values] for name, values in rows])
    whole = [values if len(values) == n else [""] * n + values for _, values in rows]
    width = max(map(len, whole))
    header = ["", *(f"joint {k + 1}" for k in range(n)), *["all"] * (width - n)]
    cells = [[*values, *[""] * (width - len(values))] for values in whole]
    return doc.Table(header, [[name, *x] for (name, _), x in zip(rows, cells, strict=True)])


def _value_rows(name: str, value: object) -> list[tuple[str, list[str]]]:
    if isinstance(value, dict):
        return [
            row
            for key, item in value.items()
            for row in _value_rows(f"{name}, {key.replace('_', ' ')}", item)
        ]
    return [(name, [_listed(x) for x in (value if isinstance(value, list) else [value])])]


def _listed(value: object) -> str:
    """Return a value of the summary as text."""
    if isinstance(value, dict):
        return "; ".join(f"{key.replace('_', ' ')} {_listed(v)}" for key, v in value.items())
    if isinstance(value, list):
        return ", ".join(map(_listed, value))
    if value is None:
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    return plain_number(value) if isinstance(value, float) else str(value)


def _by_joint(
    labels: Sequence[str],
    names: Iterable[Sequence[str]],
    entries: Sequence[Json],
    metrics: Sequence[str],
) -> doc.Table:
    """Make a table with a row for each entry, and a value of each metric for each joint."""
    rows = [
        [*own, *([METRICS[m].text(value) for value in entry[m]] for m in metrics)]
        for own, entry in zip(names, entries, strict=True)
    ]
    return doc.spread([*labels, *(METRICS[m].column for m in metrics)], rows)


_RUN = ("plant", "process", "Algorithm 1", "controller", "A")


def _run(run: Json) -> list[str]:
    amplitude = f"{run['disturbance_amplitude']:g}"
    return [run["plant"], run["process"], run["algorithm"], doc.code(run["controller"]), amplitude]


def _label(entry: Json) -> list[str]:
    return [doc.code(entry["controller"])]


def _table1(rows: Sequence[Json]) -> doc.Table:
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


def _steps(steps: Json) -> doc.Table:
    columns = {
        "rise_time": ("rise, 10–90 % [s]", ".4f"),
        "settling_time": ("settling, 2 % [s]", ".4f"),
        "overshoot_percent": ("overshoot [%]", ".3f"),
    }
    structures = {"pi": "PI on the error", "p_in_feedback": "P in the feedback path"}
    published = [[f"{steps['published'][key][name]:g}" for name in columns] for key in structures]
    return _pairs(columns, structures.values(), [steps[key] for key in structures], published)


def _pairs(
    columns: Mapping[str, tuple[str, str]],
    names: Iterable[str],
    computed: Sequence[Json],
    published: Sequence[Sequence[str]],
) -> doc.Table:
    """Make a table with a computed and a published row for each name.

    `columns` contains title and format by key.
    """
    rows = []
    for name, values, printed in zip(names, computed, published, strict=True):
        known = {key: math.nan if values[key] is None else values[key] for key in columns}
        rows.append([name, *(formatted(known[key], spec) for key, (_, spec) in columns.items())])
        rows.append([doc.Marked("*published*"), *printed])
    return doc.Table(["", *(title for title, _ in columns.values())], rows)


def _felt(beyond: Sequence[Json]) -> doc.Table:
    rows = [
        [
            *_label(entry),
            METRICS["felt_share"].text(entry["felt"]["share"]),
            *(f"{value:.2f}" for value in entry["felt"]["largest"]),
        ]
        for entry in beyond
    ]
    header = ["controller", METRICS["felt_share"].column, *beyond[0]["felt"]["channels"]]
    return doc.Table(header, rows)
