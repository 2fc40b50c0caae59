"""The report on the recomputed paper, made from summary.json and the figures beside it."""

import json
import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from sdt_drake.io.errors import InputError
from sdt_drake.io.files import read_text, replacing_files, write_text
from sdt_drake.paper import claims as judged
from sdt_drake.paper import tables
from sdt_drake.pilot.orientation import CAUTION
from sdt_drake.pilot.reported import LEGEND, Judged, verdict_of_all
from sdt_drake.show.documents import MARKDOWN, REPORT, Report, written
from sdt_drake.show.panels import Stored
from sdt_drake.show.reports.perception import reported_notes, reported_table
from sdt_drake.show.sections import Marked, Page, Row, Rows, Section, Table, bullets, said, tiles

TEXTS = Path(__file__).with_name("texts")
RECORDING, SUMMARY, PLOTS = "device.html", "summary.json", "plots.json"
FILES = ("table1.md", MARKDOWN, REPORT)
"""Files of a report, all of them written or none."""

_MAX_FILE_BYTES = 100_000_000
_OTHER_FORM = (LookupError, TypeError, ValueError, AttributeError, ArithmeticError)
"""Errors caused by a summary without the data of the report."""

LOOKS = {
    judged.REPRODUCED: ("good", "✓"),
    judged.NOT_REPRODUCED: ("bad", "✗"),
    judged.NOT_COMPARABLE: ("open", "–"),
}
"""The class of page.css and the sign of each verdict; colour is never the only difference."""


def count_verdicts(claims: Sequence[tables.Json]) -> dict[str, int]:
    """Count the claims of summary.json by verdict."""
    return {verdict: sum(c["verdict"] == verdict for c in claims) for verdict in judged.VERDICTS}


def claims_in_words(claims: Sequence[tables.Json]) -> str:
    """Return a sentence for each kind of claim of summary.json, with its verdicts."""
    sentences = []
    for kind, text in _KINDS.items():
        own = [claim for claim in claims if claim.get("kind", judged.OF_THE_PAPER) == kind]
        counts = ", ".join(f"{n} {verdict}" for verdict, n in count_verdicts(own).items() if n)
        if own:
            sentences.append(text.format(n=len(own), counts=counts))
    return " ".join(sentences)


def errata(claims: Sequence[tables.Json]) -> Marked:
    """Return the list of all claims of summary.json that were not reproduced, as Markdown."""
    parts = []
    for (kind, verdict), title in _LISTED.items():
        own = [c["in_short"] for c in claims if (c["kind"], c["verdict"]) == (kind, verdict)]
        parts += [f"{title.format(n=len(own))}\n\n{bullets(own)}"] if own else []
    return Marked("\n\n".join(parts))


_LISTED = {
    (judged.OF_THE_PAPER, judged.NOT_REPRODUCED): "Not reproduced, {n} claims of the paper:",
    (judged.OF_THE_PAPER, judged.NOT_COMPARABLE): (
        "Not comparable, {n} claims of the paper that need its device or its motion, which are not "
        "published:"
    ),
    (judged.BEYOND, judged.NOT_REPRODUCED): "Beyond the paper, {n} questions that it does not ask:",
}
"""Titles of the lists of claims that do not hold, by kind and verdict."""

_KINDS = {
    judged.OF_THE_PAPER: "Of {n} claims of the paper that were computed independently: {counts}.",
    judged.BY_CONSTRUCTION: "{n} more agree by construction, as the device is calibrated to them.",
    judged.BEYOND: "{n} ask the same beyond the paper, on the coupled plant: {counts}.",
}


def write_report(folder: Path, studies: Sequence[Section] = ()) -> Path:
    """Write report.html, report.md and table1.md into a folder that `reproduce` has filled.

    Args:
        folder: the folder with summary.json and the figures.
        studies: sections at the end, made by `study_chapter`; their figures are written, too.

    Returns:
        The path of the page.

    Raises:
        InputError: if a file is missing or cannot be used; nothing is written then.
    """
    with _advice(folder):
        summary, plots = (_read_json(folder / name) for name in (SUMMARY, PLOTS))
        shown = _values(summary, has_device=(folder / RECORDING).exists())
        shown |= {f"{name}.png": Stored(data) for name, data in plots.items()}
        report = written("report", shown, TEXTS, symbols=True)
        values = [one for one in report.sections if one.title in ("Table 1", "Provenance")]
        report = replace(report, sections=[*report.sections, *studies])
        table1 = Report("Table 1, from the SDF and the reference motion", [], values)
        report.write_parts(folder)
        page = report.page(folder)
    texts = (table1.markdown(), report.markdown(), page)
    with replacing_files(folder) as new:
        for name, content in zip(FILES, texts, strict=True):
            write_text(new / name, content)
    return folder / REPORT


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
    raise InputError(f"{message}; recompute the paper into {folder} first")


def _read_json(path: Path) -> tables.Json:
    if not path.exists():
        raise InputError(f"{path}: is missing")

    def refuse(text: str) -> float:
        raise InputError(f"{path}: contains {text}, expected finite numbers")

    try:
        return json.loads(read_text(path, _MAX_FILE_BYTES), parse_constant=refuse)
    except (json.JSONDecodeError, RecursionError):
        raise InputError(f"{path}: is not JSON") from None


def _numbers(summary: tables.Json) -> dict[str, object]:
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


def _reported(summary: tables.Json) -> list[Judged]:
    """Read people's reports of motions; null in the summary becomes NaN."""

    def read(entry: dict[str, Any]) -> Any:
        return {name: math.nan if value is None else value for name, value in entry.items()}

    return [Judged(**read(entry)) for entry in summary["reported"]]


def findings(summary: tables.Json) -> list[Marked]:
    """Return the most important results of summary.json as sentences."""
    text = read_text(TEXTS / "findings.md", _MAX_FILE_BYTES)
    return list(map(Marked, said(text, **_numbers(summary)).splitlines()))


def _worst(felt: tables.Json, channels: slice) -> str:
    multiple, name = max(zip(felt["largest"][channels], felt["channels"][channels], strict=True))
    return f"{multiple:.2f} ({name})"


# --- sections --------------------------------------------------------------------------------


def _values(summary: tables.Json, *, has_device: bool) -> dict[str, Any]:
    """Return the numbers, tables and texts of the report by name."""
    claims, runs, beyond = (summary[name] for name in ("claims", "tracking", "beyond"))
    reported, labels = _reported(summary), list(map(tables.label_cells, beyond))
    shares = [{**e, "rms_torque_share": e["rms_share"], "peak_torque_share": e["peak_share"]}
              for e in beyond]  # fmt: skip
    times = {**summary["wall_time_s"], "sum of the stages": sum(summary["wall_time_s"].values())}
    turn = "The reference motion in 3D; drag to turn the view."
    cells = list(map(tables.run_cells, runs))
    return {
        **_numbers(summary), **summary["versions"],
        "findings": bullets(findings(summary)), "counted": claims_in_words(claims),
        "verdicts": tiles(_tiles(claims)), "errata": errata(claims),
        "device": [turn, Page(RECORDING, "Load the 3D recording")] if has_device else [],
        "claims": Rows(["claim", "place", "published", "computed", "verdict"],
                       list(map(_claim, claims))),
        "table1": tables.inertia_table(summary["table1"]),
        "steps": tables.steps_table(summary["step_response"]),
        "run_speeds": tables.runs_table(tables.RUN, cells, runs, _SPEEDS),
        "run_positions": tables.runs_table(
            tables.RUN, cells, runs, (_POSITION, "saturated_fraction")
        ),
        "speeds": tables.runs_table(["controller"], labels, beyond, _SPEEDS),
        "positions": tables.runs_table(
            ["controller"], labels, shares, (_POSITION, "rms_torque_share", "peak_torque_share")
        ),
        "felt": tables.felt_table(beyond), "verdict": verdict_of_all(reported), "caution": CAUTION,
        "reported": reported_table(reported), "reports": bullets(reported_notes(reported)),
        "legend": LEGEND,
        "needs": Table(
            ["controller", "needs to know"],
            [[*own, ", ".join(e["needs"])] for own, e in zip(labels, beyond, strict=True)],
        ),
        "versions": Table(["", "version"], list(summary["versions"].items())),
        "times": Table(["", "wall time [s]"], [[k, f"{v:.2f}"] for k, v in times.items()]),
    }  # fmt: skip


def _tiles(claims: Sequence[tables.Json]) -> Iterator[tuple[int, str, str]]:
    """Yield counts of the paper's own claims by verdict, then of those that are no test of it."""
    of = {kind: [c for c in claims if c["kind"] == kind] for kind in judged.KINDS}
    for verdict, n in count_verdicts(of[judged.OF_THE_PAPER]).items():
        yield n, verdict, LOOKS[verdict][0]
    yield len(of[judged.BY_CONSTRUCTION]), judged.BY_CONSTRUCTION, LOOKS[judged.NOT_COMPARABLE][0]
    for verdict, n in count_verdicts(of[judged.BEYOND]).items():
        if n:
            yield n, f"{judged.BEYOND}: {verdict}", LOOKS[verdict][0]


_SPEEDS = ("max_abs_speed_error", "rms_speed_error", "constant_speed_error")
_POSITION = "max_abs_position_error"


def _claim(claim: tables.Json) -> Row:
    verdict, (look, sign) = claim["verdict"], LOOKS[claim["verdict"]]
    values = [tables.in_a_cell(claim[name]) for name in ("published", "computed")]
    cells = [claim["statement"], claim["place"], *values, f"{sign} {verdict}"]
    own = [tables.value_table(claim), f"Agreement: {claim['agrees']}.", claim["why"]]
    return Row(cells, own, verdict, look)
