"""The report on the recomputed paper, made from summary.json and the figures beside it."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from sdt_drake.io.errors import InputError
from sdt_drake.io.files import read_text, replacing_files, write_text
from sdt_drake.paper.claims import (
    BEYOND,
    BY_CONSTRUCTION,
    NOT_COMPARABLE,
    NOT_REPRODUCED,
    OF_THE_PAPER,
    REPRODUCED,
    VERDICTS,
)
from sdt_drake.paper.tables import (
    RUN,
    Json,
    felt_table,
    inertia_table,
    label_cells,
    run_cells,
    runs_table,
    steps_table,
    value_table,
)
from sdt_drake.pilot.orientation import CAUTION
from sdt_drake.pilot.reported import LEGEND, Judged, verdict_of_all
from sdt_drake.show.documents import MARKDOWN, REPORT, Report
from sdt_drake.show.reports.perception import reported_notes, reported_table
from sdt_drake.show.sections import (
    Block,
    Box,
    Marked,
    Page,
    Picture,
    Section,
    Table,
    bullets,
    prose,
    said,
    tiles,
)

TEXTS = Path(__file__).with_name("texts")
RECORDING, SUMMARY = "device.html", "summary.json"
FILES = ("table1.md", MARKDOWN, REPORT)
"""Files of a report, all of them written or none."""

_MAX_FILE_BYTES = 100_000_000
_OTHER_FORM = (LookupError, TypeError, ValueError, AttributeError, ArithmeticError)
"""Errors caused by a summary without the data of the report."""

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
        summary = _read_summary(folder / SUMMARY)
        sections = list(_sections(summary, has_device=(folder / RECORDING).exists()))
        report = Report(_TITLE, [_about(summary)], [*sections, *studies], symbols=True)
        values = [section for section in sections if section.title in ("Table 1", "Provenance")]
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


def findings(summary: Json) -> list[Marked]:
    """Return the most important results of summary.json as sentences."""
    return list(map(Marked, prose("findings", TEXTS, **_numbers(summary)).splitlines()))


def _worst(felt: Json, channels: slice) -> str:
    multiple, name = max(zip(felt["largest"][channels], felt["channels"][channels], strict=True))
    return f"{multiple:.2f} ({name})"


# --- sections --------------------------------------------------------------------------------

_TITLE = "Computed torque control for a spatial disorientation trainer, recomputed in Drake"


def _about(summary: Json) -> Marked:
    return said(
        "Vidaković, Kvrgić et al., Facta Universitatis, Series Mechanical Engineering 18(2), "
        "2020, doi 10.22190/FUME190919003V. sdt_drake {package}, drake {drake}.",
        **summary["versions"],
    )


def _sections(summary: Json, *, has_device: bool) -> Iterator[Section]:
    """Make the sections of the report in their order."""
    claims = summary["claims"]
    yield Section("Summary", _summary(summary))
    if has_device:
        turn = "The reference motion in 3D; drag to turn the view."
        yield Section("Device in 3D", [turn, Page(RECORDING, "Load the 3D recording")])
    yield Section("Claims", list(map(_claim, claims)))
    yield Section(
        "Motion",
        [Picture("figure2.png", "Reference motion: position, speed and acceleration of each joint "
                 "(Figure 2).")],
    )  # fmt: skip
    yield Section(
        "Table 1",
        ["Values from the device's mass matrix along the motion, and those of the paper; inertias "
         "and gains are motor side.", inertia_table(summary["table1"])],
    )  # fmt: skip
    yield Section(
        "Step response",
        [steps_table(summary["step_response"]),
         Picture("figure4.png", "Step response of axis 1 with both structures of the PI controller "
                 "(Figure 4).")],
    )  # fmt: skip
    drawn = "Drawn from the loops that are simulated, with the load torque on line and the elements"
    pictures = [Picture(f"diagrams/{name}.svg", words) for name, words in _DIAGRAMS.items()]
    yield Section("Models", [f"{drawn} of the PI controller.", *pictures])
    yield Section(
        "Decoupled axes",
        ["The paper's models: each motor turns a constant inertia against the load torque of the "
         "reference.",
         Picture("figure7.png", "Joint speeds on the decoupled axes, Algorithm 1 as printed "
                 "(Figure 7)."),
         Picture("figure8.png", "Speed errors on the decoupled axes, Algorithm 1 as printed "
                 "(Figure 8).")],
    )  # fmt: skip
    yield Section(
        "Coupled plant",
        ["Here the joints influence each other by their dynamics; the controllers are the same. "
         "The figure at the top of this page shows the speed errors."],
    )  # fmt: skip
    yield Section("Runs", _runs(summary["tracking"]))
    yield Section("Beyond the paper", _beyond(summary))
    times = {**summary["wall_time_s"], "sum of the stages": sum(summary["wall_time_s"].values())}
    yield Section(
        "Provenance",
        [prose("provenance", TEXTS),
         Table(["", "version"], list(summary["versions"].items())),
         Table(["", "wall time [s]"], [[k, f"{v:.2f}"] for k, v in times.items()])],
    )  # fmt: skip


_DIAGRAMS = {
    "figure3": "Decoupled axes with load torque and dynamic saturation (Figure 3).",
    "figure4": "PI controller on the error (Figure 4).",
    "figure5": "PI controller with its proportional gain in the feedback path (Figure 5).",
    "figure6": "Single joint CTC: the load torque fed forward, the true load disturbed (Figure 6).",
    "coupled_loop": "The MultibodyPlant under PI + CTC, with its load disturbed.",
}
_SPEEDS = ("max_abs_speed_error", "rms_speed_error", "constant_speed_error")
_POSITION = "max_abs_position_error"


def _summary(summary: Json) -> list[Block]:
    claims = summary["claims"]
    errors = "Speed errors on the coupled MultibodyPlant, with both signs of Algorithm 1."
    return [
        prose("summary", TEXTS, **_numbers(summary)),
        Picture("coupled_errors.png", errors),
        Marked("### Findings"),
        bullets(findings(summary)),
        prose("claims", TEXTS, counted=claims_in_words(claims)),
        tiles((n, verdict, LOOKS[verdict][0]) for verdict, n in count_verdicts(claims).items()),
    ]


def _claim(claim: Json) -> Box:
    verdict, place = claim["verdict"], claim.get("place", "")
    blocks = [
        said("{} **{}** {:code}", LOOKS[verdict][1], verdict, claim["id"]),
        said("### {}", claim["statement"]),
        *([place] if place else []),
        value_table(claim),
        claim["why"],
    ]
    return Box("article", blocks, f' class="claim" data-verdict="{verdict}"')


def _runs(runs: Sequence[Json]) -> list[Block]:
    speeds = runs_table(RUN, map(run_cells, runs), runs, _SPEEDS)
    positions = runs_table(RUN, map(run_cells, runs), runs, (_POSITION, "saturated_fraction"))
    return [
        prose("runs", TEXTS),
        speeds,
        "Largest position error, and saturated share of time.",
        positions,
    ]


def _beyond(summary: Json) -> list[Block]:
    """Make the part on more controllers, on what a pilot feels, and on predictions of that."""
    runs, numbers, reported = summary["beyond"], _numbers(summary), _reported(summary)
    shares = [{**e, "rms_torque_share": e["rms_share"], "peak_torque_share": e["peak_share"]}
              for e in runs]  # fmt: skip
    torques = (_POSITION, "rms_torque_share", "peak_torque_share")
    controllers = "The paper's controllers and more on the coupled plant, model known exactly."
    needs = [[*label_cells(e), ", ".join(e["needs"])] for e in runs]
    return [
        prose("beyond", TEXTS, **numbers),
        Picture("controllers.png", controllers),
        "Errors of each joint's speed, joint side.",
        runs_table(["controller"], map(label_cells, runs), runs, _SPEEDS),
        "Largest position error, and torques as shares of the motor's largest.",
        runs_table(["controller"], map(label_cells, runs), shares, torques),
        Marked("### Does the pilot notice that CTC is missing?"),
        prose("felt", TEXTS, **numbers),
        felt_table(runs),
        Marked("### Can what a pilot feels be predicted?"),
        said("{} {}", verdict_of_all(reported), CAUTION),
        reported_table(reported),
        bullets(reported_notes(reported)),
        LEGEND,
        "The cost of each controller: the number of Drake systems in its loop, and the data that "
        "it needs.",
        Table(["controller", "needs to know"], needs),
    ]
