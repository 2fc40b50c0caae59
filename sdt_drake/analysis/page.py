"""report.html: the study as one page that needs nothing else, from the files of its folder."""

from __future__ import annotations

import html
import json
import math
import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import resources
from pathlib import Path

from sdt_drake.analysis.claims import NOT_COMPARABLE, NOT_REPRODUCED, REPRODUCED
from sdt_drake.analysis.report import PROVENANCE
from sdt_drake.analysis.study import Stopwatch, Study
from sdt_drake.errors import InputError, read_text, replacing
from sdt_drake.viewer import record_html

PAGE = "report.html"
RECORDING = "device.html"
SUMMARY = "summary.json"

TITLE = "Computed torque control for a spatial disorientation trainer, recomputed in Drake"
PAPER = "Vidaković, Kvrgić et al., Facta Universitatis, Series Mechanical Engineering 18(2), 2020"
DOI = "10.22190/FUME190919003V"

FIGURES = {
    "figure2": "Reference motion: position, speed and acceleration of each joint (Figure 2).",
    "figure4": "Step response of axis 1 with both structures of the PI controller (Figure 4).",
    "figure7": "Joint speeds on the decoupled axes, Algorithm 1 as printed (Figure 7).",
    "figure8": "Speed errors on the decoupled axes, Algorithm 1 as printed (Figure 8).",
    "coupled_errors": "Speed errors on the coupled MultibodyPlant, with both signs of Algorithm 1.",
    "controllers": "The paper's controllers and more on the coupled plant, model known exactly.",
}
"""The study's figures and their captions; others of the folder come last, with their names."""

DIAGRAMS = {
    "figure3": "Decoupled axes with load torque and dynamic saturation (Figure 3).",
    "figure4": "PI controller on the error (Figure 4).",
    "figure5": "PI controller with its proportional gain in the feedback path (Figure 5).",
    "figure6": "Single joint CTC: the load torque fed forward, the true load disturbed (Figure 6).",
    "coupled_loop": "The MultibodyPlant under PI + CTC, with its load disturbed.",
}
"""The block diagrams and their captions."""

VERDICTS = {
    REPRODUCED: ("good", "✓"),
    NOT_REPRODUCED: ("bad", "✗"),
    NOT_COMPARABLE: ("open", "–"),
}
"""Class and sign of each verdict: colour is never the only difference."""

Quantity = tuple[str, str, float, str]
"""Title, key of the summary, factor, format."""

_SPEED: tuple[Quantity, ...] = (
    ("largest [rad/s]", "max_abs_speed_error", 1, ".5f"),
    ("RMS [rad/s]", "rms_speed_error", 1, ".5f"),
    ("at constant speed [rad/s]", "constant_speed_error", 1, ".5f"),
)
_POSITION: Quantity = ("position [deg]", "max_abs_position_error", math.degrees(1), ".3f")
_SATURATED: Quantity = ("saturated [% of time]", "saturated_fraction", 100, ".1f")
_TORQUE: tuple[Quantity, ...] = (
    ("torque, RMS [% of the motor]", "rms_share", 100, ".1f"),
    ("torque, peak [% of the motor]", "peak_share", 100, ".1f"),
)

_OTHER_FORM = (
    LookupError, TypeError, ValueError, AttributeError, ArithmeticError, RecursionError,
)  # fmt: skip
"""What comes of a summary that does not hold what the page shows."""

_MOST_BYTES = 100_000_000  # of a file

_SVG = "http://www.w3.org/2000/svg"
_XLINK = "http://www.w3.org/1999/xlink"
_DRAWN = {
    "a", "circle", "clipPath", "defs", "desc", "ellipse", "g", "image", "line", "linearGradient",
    "marker", "mask", "path", "pattern", "polygon", "polyline", "radialGradient", "rect", "stop",
    "svg", "symbol", "text", "textPath", "title", "tspan", "use",
}  # fmt: skip
"""The elements of SVG that draw; of the others some act, or hold for the whole page."""

_PIXELS = ("data:image/png", "data:image/jpeg")
_OWN_URL = re.compile(r"(url\(\s*[\"']?#)", re.IGNORECASE)
_OTHER_URL = re.compile(r"url\((?!\s*[\"']?#)|image-set|\\", re.IGNORECASE)  # \ could write any


@dataclass(frozen=True, eq=False)
class Material:
    """What a folder of the study holds.

    Attributes:
        summary: content of summary.json.
        figures: by name, as <svg> elements ready to stand in HTML.
        diagrams: likewise; empty where there was no Graphviz.
        recording: a page that shows the device in motion, or None.
    """

    summary: dict
    figures: dict[str, str]
    diagrams: dict[str, str]
    recording: str | None


def write_study_page(
    study: Study, folder: Path, watch: Stopwatch, announce: Callable[[str], None] = print
) -> Path:
    """Write a recording of the motion, and the page, into the folder of a study just written.

    Args:
        study, folder, watch: as in `write_study`.
        announce: as in `write_page`.
    """
    with watch.stage("3D recording and page"):
        robot, motion = study.design.robot, study.design.motion
        record_html(robot, motion.time, motion.q, folder / RECORDING, title="Reference motion")
        return write_page(folder, announce)


def write_page(
    folder: Path,
    announce: Callable[[str], None] = print,
    chapters: Sequence[tuple[str, str, str]] = (),
) -> Path:
    """Write report.html into a folder that `sdt-drake reproduce` has filled; replaced whole.

    Args:
        folder: of the study.
        announce: called with a line for each further picture of the folder that is left out.
        chapters: to put at the end: id, title and content, HTML.

    Raises:
        InputError: naming the file that is missing or cannot be used.
    """
    text = page(read_material(folder, announce), folder, chapters)
    path = folder / PAGE
    with replacing(path) as partial:
        partial.write_text(text, encoding="utf-8")
    return path


# --- the folder ------------------------------------------------------------------------------


def read_material(folder: Path, announce: Callable[[str], None] = print) -> Material:
    """Read what the page is made of.

    Args:
        folder, announce: as in `write_page`.

    Raises:
        InputError: naming the file that is missing or cannot be used.
    """
    with _advice(folder):
        summary = _read_summary(folder)
        figures = {name: _read_svg(folder / f"{name}.svg", name) for name in FIGURES}
        diagrams = {
            name: _read_svg(folder / "diagrams" / f"{name}.svg", f"diagram-{name}")
            for name in DIAGRAMS
            if _is_drawn(folder / "diagrams", name)
        }
        has_recording = (folder / RECORDING).is_file()
        recording = _read(folder / RECORDING) if has_recording else None
    figures |= _other_figures(folder, announce)
    return Material(summary, figures, diagrams, recording)


@contextmanager
def _advice(folder: Path) -> Iterator[None]:
    """Errors within also say where the files come from."""
    try:
        yield
    except InputError as error:
        raise InputError(f"{error}; run `sdt-drake reproduce --out {folder}` first") from None


def _is_drawn(folder: Path, name: str) -> bool:
    """Whether there must be a picture: without Graphviz the study has the .dot only."""
    return (folder / f"{name}.svg").is_file() or not (folder / f"{name}.dot").is_file()


def _other_figures(folder: Path, announce: Callable[[str], None]) -> dict[str, str]:
    """Pictures that are not of the study; the page can do without those that cannot be used."""
    figures = {}
    others = (path for path in sorted(folder.glob("*.svg")) if path.stem not in FIGURES)
    for k, path in enumerate(others):
        try:
            figures[path.stem] = _read_svg(path, f"more{k}")
        except InputError as error:
            announce(f"{error}, left out")
    return figures


def _read(path: Path) -> str:
    if not path.exists():
        raise InputError(f"{path}: is missing")
    return read_text(path, _MOST_BYTES)


def _read_summary(folder: Path) -> dict:
    path = folder / SUMMARY

    def finite(text: str) -> float:  # NaN and Infinity come here too, which are no JSON
        if not math.isfinite(float(text)):
            raise InputError(f"{path}: holds {text}, expected finite numbers")
        return float(text)

    text = _read(path)
    try:
        summary = json.loads(text, parse_float=finite, parse_constant=finite)
    except InputError:
        raise
    except (ValueError, RecursionError):
        raise InputError(f"{path}: is not JSON") from None
    if not isinstance(summary, dict):
        raise InputError(f"{path}: is not the summary of a study")
    return summary


def _read_svg(path: Path, prefix: str) -> str:
    text = _read(path)
    try:
        root = ElementTree.fromstring(text)
        if root.tag == f"{{{_SVG}}}svg" and "viewBox" in root.attrib:
            return inline_svg(root, prefix)
    except (ElementTree.ParseError, ValueError, RecursionError):
        pass
    raise InputError(f"{path}: is not an SVG picture")


def inline_svg(root: ElementTree.Element, prefix: str) -> str:
    """An <svg> element that shares a document with others: ids its own, nothing that acts.

    Args:
        root: of the picture; changed.
        prefix: of its ids.
    """
    drawn = {f"{{{_SVG}}}{tag}" for tag in _DRAWN}
    for parent in root.iter():
        for element in list(parent):
            if element.tag not in drawn:
                parent.remove(element)
        for key, value in list(parent.attrib.items()):
            kept = _kept(key.rpartition("}")[2].lower(), value, prefix)
            if kept is None:
                del parent.attrib[key]
            else:
                parent.set(key, kept)
    width = root.attrib.pop("width", "")
    if not re.fullmatch(r"[\d.]+[a-z]*", width):
        width = "100%"
    root.attrib.pop("height", None)
    root.set("style", f"stroke-linejoin: round; stroke-linecap: butt; width: {width}")
    root.set("aria-hidden", "true")  # the figure around it has the words
    ElementTree.register_namespace("", _SVG)
    ElementTree.register_namespace("xlink", _XLINK)
    return ElementTree.tostring(root, encoding="unicode")


def _kept(name: str, value: str, prefix: str) -> str | None:
    """The value of an attribute within the page; None if it acts, or asks for something outside."""
    if name == "id":
        return f"{prefix}-{value}"
    if name in ("href", "src"):
        if value.startswith("#"):
            return f"#{prefix}-{value[1:]}"
        return value if value.startswith(_PIXELS) else None
    # A class would get the rules of the page.
    if name.startswith("on") or name == "class" or _OTHER_URL.search(value):
        return None
    return _OWN_URL.sub(rf"\g<1>{prefix}-", value)


# --- the page --------------------------------------------------------------------------------


def page(material: Material, folder: Path, chapters: Sequence[tuple[str, str, str]] = ()) -> str:
    """The HTML text; arguments as in `write_page`.

    Raises:
        InputError: if the summary lacks what the page shows.
    """
    try:
        sections = _sections(material)
        header = _header(material.summary)
    except _OTHER_FORM as error:
        reason = f"has no {error}" if isinstance(error, KeyError) else "has another form"
        with _advice(folder):
            raise InputError(f"{folder / SUMMARY}: {reason}, it is of another version") from None
    recording = ""
    if material.recording is not None:
        # In a script a text ends at "</script", and only there.
        text = json.dumps(material.recording).replace("<", "\\u003c")
        recording = f'<script type="application/json" id="recording-page">{text}</script>'
    return document(TITLE, header, [*sections, *chapters], recording)


def document(
    title: str, header: str, sections: Sequence[tuple[str, str, str]], end: str = ""
) -> str:
    """A page of this look, whole and without anything from elsewhere.

    Args:
        title: of the window, HTML.
        header: <header> of the page.
        sections: id, title and content of each, HTML.
        end: put behind them.
    """
    links = "".join(f'<a href="#{id_}">{text}</a>' for id_, text, _ in sections)
    body = "".join(
        f'<section id="{id_}"><h2>{text}</h2>{content}</section>' for id_, text, content in sections
    )
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        # Nothing from elsewhere, whatever stands in the page.
        '<meta http-equiv="Content-Security-Policy" '
        "content=\"default-src 'unsafe-inline' 'unsafe-eval' data: blob:\">\n"
        f'<link rel="icon" href="data:,">\n<title>{title}</title>\n'
        f"<style>\n{_asset('page.css')}</style>\n</head>\n<body>\n"
        f'{header}\n<nav aria-label="Sections">{links}</nav>\n<main>\n{body}\n</main>\n'
        f"{end}\n<script>\n{_asset('page.js')}</script>\n</body>\n</html>\n"
    )


def _asset(name: str) -> str:
    return resources.files("sdt_drake.analysis").joinpath(name).read_text(encoding="utf-8")


def _header(summary: Mapping) -> str:
    versions = summary["versions"]
    made = f"sdt_drake {escape(versions['package'])}, drake {escape(versions['drake'])}"
    return (
        f"<header><h1>{TITLE}</h1>"
        f'<p>{escape(PAPER)}, doi <span class="nowrap">{DOI}</span>. {made}.</p>'
        '<button type="button" id="theme" hidden>Dark</button></header>'
    )


def _sections(material: Material) -> list[tuple[str, str, str]]:
    """Id, title and content of each."""
    summary = material.summary

    def figure(name: str) -> str:
        return html_figure(FIGURES[name], material.figures[name])

    sections = [
        ("summary", "Summary", _summary(summary)),
        ("claims", "Claims", _claims(summary["claims"], len(summary["table1"]))),
        ("motion", "Motion", figure("figure2")),
        ("table1", "Table 1", _table1(summary["table1"])),
        ("step", "Step response", _steps(summary["step_response"]) + figure("figure4")),
        ("models", "Models", _models(material.diagrams)),
        (
            "axes",
            "Decoupled axes",
            "<p>The paper's models: each motor turns a constant inertia against the load torque of "
            f"the reference.</p>{figure('figure7')}{figure('figure8')}",
        ),
        (
            "coupled",
            "Coupled plant",
            "<p>Here the joints move each other by their dynamics; the controllers are the same."
            f"</p>{figure('coupled_errors')}",
        ),
        ("runs", "Runs", _runs(summary["tracking"])),
        ("beyond", "Beyond the paper", _beyond(summary["beyond"]) + figure("controllers")),
    ]
    others = [name for name in material.figures if name not in FIGURES]
    if others:
        shown = "".join(
            html_figure(f"{name.replace('_', ' ').capitalize()}.", material.figures[name])
            for name in others
        )
        sections.append(("more", "More figures", shown))
    if material.recording is not None:
        sections.append(("device", "Device in 3D", _recording(material.recording)))
    sections.append(("provenance", "Provenance", _provenance(summary)))
    return sections


def _summary(summary: Mapping) -> str:
    claims = summary["claims"]
    counts = {verdict: sum(c["verdict"] == verdict for c in claims) for verdict in VERDICTS}
    tiles = "".join(
        f'<li class="{VERDICTS[verdict][0]}"><strong>{count}</strong> {verdict}</li>'
        for verdict, count in counts.items()
    )
    found = "".join(f"<li>{text}</li>" for text in findings(summary))
    return (
        "<p>The paper says that computed torque control (CTC) improves the tracking of a four-axis "
        f"trainer. Each of its {len(claims)} claims is computed again, with its own models and on "
        f'a multibody plant whose joints move each other:</p><ul class="tiles">{tiles}</ul>'
        "<h3>What we found</h3>"
        f'<ul class="findings">{found}</ul>'
    )


def findings(summary: Mapping) -> list[str]:
    """The main results, in words with their numbers, as HTML; those whose runs are there."""
    runs = {
        (r["algorithm"], r["controller"]): r
        for r in summary["tracking"]
        if r["plant"] == "coupled" and r["disturbance_amplitude"] == 0
    }
    beyond = {entry["controller"]: entry for entry in summary["beyond"]}
    return [
        *_ctc_findings(runs),
        *_id_findings(beyond),
        "<b>The device and the motion are ours</b>, as the paper publishes neither geometry nor "
        "masses: what depends on them is marked <i>not comparable</i>.",
    ]


def _ctc_findings(runs: Mapping[tuple[str, str], Mapping]) -> list[str]:
    """What CTC changes on the coupled plant; nothing without errors to compare."""
    if not {("consistent", "pi"), ("consistent", "pi_ctc")} <= set(runs):
        return []
    pi, ctc = runs["consistent", "pi"], runs["consistent", "pi_ctc"]
    errors = pi["max_abs_speed_error"]
    k = errors.index(max(errors))  # the joint with most to gain
    with_pi, with_ctc = errors[k], ctc["max_abs_speed_error"][k]
    if not (with_pi and with_ctc):
        return []
    steady = [run["constant_speed_error"][k] for run in (pi, ctc)]
    ratio = f", and at constant speed {steady[0] / steady[1]:.1f} times less" if all(steady) else ""
    texts = [
        f"<b>On the coupled plant CTC changes the largest speed error of joint {k + 1} from "
        f"{with_pi:.3f} to {with_ctc:.3f} rad/s</b>, {with_pi / with_ctc:.2f} times less"
        f"{ratio}. What remains is mostly the lag of the loop behind its reference, which CTC "
        "does not touch."
    ]
    printed = runs.get(("printed", "pi_ctc"))
    if printed:
        worse = printed["max_abs_speed_error"][k] / with_pi
        texts.append(
            "<b>The sign that the paper prints in the third branch of Algorithm 1 does not "
            f"hold.</b> With it, the largest error of joint {k + 1} on the coupled plant is "
            f"{worse:.1f} times that of PI alone."
        )
    return texts


def _id_findings(beyond: Mapping[str, Mapping]) -> list[str]:
    """What the whole inverse dynamics is worth; nothing without errors to compare."""
    if not {"pi", "pi_id", "p_pi+id"} <= set(beyond):
        return []
    before, after = (beyond[label]["rms_speed_error"] for label in ("pi", "pi_id"))
    if not all(after):
        return []
    gains = [b / a for b, a in zip(before, after, strict=True)]
    drift, kept = (
        math.degrees(max(beyond[label]["max_abs_position_error"])) for label in ("pi", "p_pi+id")
    )
    return [
        f"<b>Feeding the whole inverse dynamics forward pays: {min(gains):.0f} to "
        f"{max(gains):.0f} times less RMS speed error</b> with the same gains. With a position "
        f"loop around it the joints stay within {kept:.2g} deg of their reference; a speed "
        f"loop alone drifts by up to {drift:.1f} deg.{_felt_finding(beyond)}"
    ]


def _felt_finding(beyond: Mapping[str, Mapping]) -> str:
    """What the pilot could feel of the error; nothing for a device without a head."""
    felt = [beyond[label].get("felt") for label in ("pi", "pi_ctc", "p_pi+id")]
    if not all(felt):
        return ""
    pi, ctc, cascade = (f"{100 * item['share']:.0f} %" for item in felt)
    return (
        f" The pilot could feel the error {pi} of the time with PI, {ctc} with PI + CTC, and "
        f"{cascade} with this cascade."
    )


def _claims(claims: Sequence[Mapping], joints: int) -> str:
    buttons = f'<button type="button" aria-pressed="true">all {len(claims)}</button>'
    for verdict in VERDICTS:
        count = sum(claim["verdict"] == verdict for claim in claims)
        buttons += (
            f'<button type="button" aria-pressed="false" data-verdict="{verdict}">'
            f"{verdict} {count}</button>"
        )
    articles = "".join(_claim(claim, joints) for claim in claims)
    return (
        f'<div class="filter" role="group" aria-label="Claims shown" hidden>{buttons}</div>'
        f'<p class="shown" role="status"></p>{articles}'
    )


def _claim(claim: Mapping, joints: int) -> str:
    verdict = claim["verdict"]
    look, sign = VERDICTS[verdict]
    return (
        f'<article class="claim" data-verdict="{verdict}" id="claim-{escape(claim["id"])}">'
        f'<p class="verdict {look}"><span aria-hidden="true">{sign}</span> {verdict}</p>'
        f"<h3>{_pretty(claim['statement'])}</h3>"
        f"{_values(claim['published'], claim['computed'], joints)}"
        f'<p class="why">{_pretty(claim["why"])}</p></article>'
    )


def _values(published: object, computed: object, joints: int) -> str:
    """Published above computed."""
    same_keys = isinstance(published, dict) and isinstance(computed, dict)
    if same_keys and list(published) == list(computed):
        header = [_pretty(key.replace("_", " ")) for key in published]
        rows = [
            ["published", *(_number(value, 6) for value in published.values())],
            ["computed", *(_number(value, 4) for value in computed.values())],
        ]
        return html_table(["", *header], rows)
    rows = [*_value_rows("published", published, 6), *_value_rows("computed", computed, 4)]
    header = [f"joint {k + 1}" for k in range(joints)] if len(rows[-1]) == joints + 1 else []
    return html_table(["", *header] if header else [], rows)


def _value_rows(label: str, value: object, digits: int) -> list[list[str]]:
    if isinstance(value, dict):
        return [
            row
            for key, item in value.items()
            for row in _value_rows(f"{label}, {_pretty(key.replace('_', ' '))}", item, digits)
        ]
    values = value if isinstance(value, list) else [value]
    return [[label, *(_number(item, digits) for item in values)]]


def _table1(rows: Sequence[Mapping]) -> str:
    columns = (
        ("i_eff_max", "I_eff,max [kg m²]", ".2f"),
        ("i_eff_median", "median", ".2f"),
        ("i_eff_min", "min", ".2f"),
        ("variation_percent", "variation [%]", ".2f"),
        ("kp", "K_PS [N m s/rad]", ".4g"),
        ("ki", "K_IS [N m/rad]", ".4g"),
        ("zeta_max", "zeta at max", ".3f"),
        ("zeta_median", "at median", ".3f"),
        ("zeta_min", "at min", ".3f"),
    )
    body = []
    for row in rows:
        body.append(
            [f"joint {escape(row['joint'])}"] + [_format(row[key], f) for key, _, f in columns]
        )
        body.append(
            ["<i>published</i>"] + [_number(row["published"][key]) for key, _, _ in columns]
        )
    return (
        "<p>From the mass matrix of the device along the motion, beside what the paper prints; "
        "inertias and gains are motor side.</p>"
        + html_table(["", *(_pretty(title) for _, title, _ in columns)], body, "pairs")
    )


def _steps(steps: Mapping) -> str:
    names = {"pi": "PI on the error", "p_in_feedback": "P in the feedback path"}
    columns = (
        ("rise_time", "rise, 10–90 % [s]", ".4f"),
        ("settling_time", "settling, 2 % [s]", ".4f"),
        ("overshoot_percent", "overshoot [%]", ".3f"),
    )
    rows = []
    for structure, name in names.items():
        published = steps["published"][structure]
        rows.append([name, *(_format(steps[structure][key], f) for key, _, f in columns)])
        rows.append(["<i>published</i>", *(_number(published[key]) for key, _, _ in columns)])
    return html_table(["", *(title for _, title, _ in columns)], rows, "pairs")


def _models(diagrams: Mapping[str, str]) -> str:
    text = (
        "<p>Drawn by the builders of the loops that are simulated, with the load torque on line "
        "and the elements of the PI controller.</p>"
    )
    if not diagrams:
        return (
            f"{text}<p>Here they are in diagrams/*.dot only: Graphviz was not installed when the "
            "study was written.</p>"
        )
    return text + "".join(
        html_figure(DIAGRAMS[name], svg, "wide") for name, svg in diagrams.items()
    )


def _runs(runs: Sequence[Mapping]) -> str:
    labels = ["plant", "Algorithm 1", "controller", "A"]

    def label(run: Mapping) -> list[str]:
        process = {"i_eff_max": ", I_eff,max", "i_eff_min": ", I_eff,min"}.get(run["process"], "")
        return [
            _pretty(run["plant"] + process),
            escape(run["algorithm"]),
            f"<code>{escape(run['controller'])}</code>",
            f"{run['disturbance_amplitude']:g}",
        ]

    return (
        "<p>Largest, RMS and constant-speed error (from 1 s after the speed became constant) of "
        "each joint's speed, joint side. "
        + _pretty("I_eff,min is the published I_eff,max less the published variation. ")
        + "A is the amplitude of the disturbance.</p>"
        + _by_joint(labels, label, runs, _SPEED)
        + "<p>Largest position error, and share of time in saturation.</p>"
        + _by_joint(labels, label, runs, (_POSITION, _SATURATED))
    )


def _beyond(entries: Sequence[Mapping]) -> str:
    def label(entry: Mapping) -> list[str]:
        return [f"<code>{escape(entry['controller'])}</code>"]

    needs = [[*label(e), escape(e["blocks"]), escape(", ".join(e["needs"]))] for e in entries]
    return (
        "<p>The same motion on the coupled plant with more controllers: an ideal drive, no "
        "friction, and a model that is exact. Errors of each joint's speed, joint side.</p>"
        + _by_joint(["controller"], label, entries, _SPEED)
        + "<p>Largest position error, and torques as shares of the motor's largest.</p>"
        + _by_joint(["controller"], label, entries, (_POSITION, *_TORQUE))
        + _felt(entries)
        + "<p>What each costs: Drake systems in its loop, and what it needs to know.</p>"
        + html_table(["controller", "blocks", "needs to know"], needs, "words")
    )


def _felt(entries: Sequence[Mapping]) -> str:
    """What the pilot could feel of the errors; nothing for a device without a head."""
    if not all(entry.get("felt") for entry in entries):
        return ""
    channels = entries[0]["felt"]["channels"]
    rows = [
        [
            f"<code>{escape(entry['controller'])}</code>",
            _format(100 * entry["felt"]["share"], ".1f"),
            *(_format(value, ".2f") for value in entry["felt"]["largest"]),
        ]
        for entry in entries
    ]
    return (
        "<p>What the pilot could feel of the errors: share of time, and the largest error in the "
        "axes of the head, in multiples of what attentive people in silence and dark just feel. "
        "What is said not to be felt is not; what could be felt need not be.</p>"
        + html_table(["controller", "felt [% of time]", *map(escape, channels)], rows)
    )


def _recording(text: str) -> str:
    size = len(text.encode()) / 1e6
    return (
        "<p>The reference motion in 3D; drag to look from elsewhere.</p>"
        f'<div class="recording"><button type="button" hidden>Load the 3D recording '
        f"({size:.1f} MB, within this page)</button>"
        f"<noscript>It needs JavaScript.</noscript></div>"
    )


def _provenance(summary: Mapping) -> str:
    seconds = summary["wall_time_s"]
    stages = [[escape(stage), f"{value:.2f}"] for stage, value in seconds.items()]
    stages.append(["sum of the stages", f"{sum(seconds.values()):.2f}"])
    versions = [[escape(k), escape(v)] for k, v in summary["versions"].items()]
    return (
        f"<p>{escape(PROVENANCE)}</p>"
        '<div class="columns">'
        f"<div><h3>Versions</h3>{html_table([], versions)}</div>"
        f"<div><h3>Wall time [s]</h3>{html_table([], stages)}</div></div>"
    )


# --- pieces ----------------------------------------------------------------------------------


def _by_joint(
    labels: Sequence[str],
    label: Callable[[Mapping], list[str]],
    entries: Sequence[Mapping],
    quantities: Sequence[Quantity],
) -> str:
    """A row for each entry; each quantity has a column for each joint."""
    joints = len(entries[0][quantities[0][1]])
    head = "".join(f'<th rowspan="2" scope="col">{text}</th>' for text in labels)
    head += "".join(
        f'<th class="first" colspan="{joints}" scope="colgroup">{title}, joint</th>'
        for title, _, _, _ in quantities
    )
    numbers = "".join(f"<th{_first(k)} scope='col'>{k + 1}</th>" for k in range(joints))
    rows = []
    for entry in entries:
        name, *others = label(entry)
        words = "".join(f'<td class="word">{text}</td>' for text in others)
        values = "".join(
            f"<td{_first(k)}>{_format(None if value is None else factor * value, spec)}</td>"
            for _, key, factor, spec in quantities
            for k, value in enumerate(entry[key])
        )
        rows.append(f'<tr><th scope="row">{name}</th>{words}{values}</tr>')
    return _boxed(f"<tr>{head}</tr><tr>{numbers * len(quantities)}</tr>", rows, "joints")


def _first(k: int) -> str:
    """The first joint begins a group of columns."""
    return "" if k else ' class="first"'


def html_table(header: Sequence[str], rows: Iterable[Sequence[str]], look: str = "") -> str:
    """Cells are HTML; the first of each row names it."""
    head = "".join(f'<th scope="col">{text}</th>' if text else "<td></td>" for text in header)
    lines = [
        f'<tr><th scope="row">{first}</th>{"".join(f"<td>{cell}</td>" for cell in cells)}</tr>'
        for first, *cells in rows
    ]
    return _boxed(f"<tr>{head}</tr>" if header else "", lines, look)


def _boxed(head: str, lines: Sequence[str], look: str) -> str:
    """A table that scrolls in its own box where the screen is narrow."""
    thead = f"<thead>{head}</thead>" if head else ""
    return (
        f'<div class="scroll" tabindex="0"><table class="{look}">{thead}'
        f"<tbody>{''.join(lines)}</tbody></table></div>"
    )


def html_figure(caption: str, svg: str, look: str = "") -> str:
    text = escape(caption)
    return (
        f'<figure><div class="canvas scroll {look}" role="img" aria-label="{text}" tabindex="0">'
        f"{svg}</div><figcaption>{text}</figcaption></figure>"
    )


def _number(value: object, digits: int = 6) -> str:
    """A value of the summary."""
    if value is None:
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, int | float):
        text = f"{value:.{digits}g}"
        if 1e4 <= abs(value) < 1e7:
            text = f"{float(text):,.0f}".replace(",", "\u202f")  # thousands apart
        return text.replace("e+0", "e").replace("e-0", "e-")
    return _pretty(str(value))


def _format(value: float | None, spec: str) -> str:
    return "–" if value is None else format(value, spec)


def escape(text: object) -> str:
    return html.escape(str(text))


_GREEK = {"omega": "ω", "zeta": "ζ", "tau": "τ"}
_SYMBOL = re.compile(
    r"(?<![A-Za-z_])(?:(omega|zeta|tau|I|K|d)_([A-Za-z0-9]+(?:,(?:max|min|\d)(?![\w]))?)"
    r"|(omega|zeta|tau)(?![A-Za-z_]))"
)


def _pretty(text: str) -> str:
    """Escaped, with the symbols of the equations as they are printed."""

    def symbol(match: re.Match[str]) -> str:
        letter, index, alone = match.groups()
        if alone:
            return _GREEK[alone]
        return f"{_GREEK.get(letter, letter)}<sub>{index}</sub>"

    return _SYMBOL.sub(symbol, escape(text))
