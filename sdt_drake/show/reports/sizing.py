"""The report of a sizing: the chosen motors, their margins, and why others are ruled out."""

import json
import math
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from sdt_drake.analysis.metrics import family_of, metric_of
from sdt_drake.io.resources import PACKAGE_PREFIX
from sdt_drake.io.shown import formatted, listed
from sdt_drake.run.options import canonical, in_print
from sdt_drake.show import sections as doc
from sdt_drake.show.documents import MARKDOWN, REPORT, Report, written
from sdt_drake.show.figures.fronts import sizing_front
from sdt_drake.show.sections import Marked, joined, said
from sdt_drake.show.style import pictures
from sdt_drake.studies.sizing import Sizing, short_name
from sdt_drake.studies.verdicts import Verdict, nearest, recommend

FIGURE = "front"
FILES = (*pictures(FIGURE), MARKDOWN, REPORT)
"""Names of the report's files."""

_MIN_MARGIN = 0.1  # share of a limit; motors with less are named


def sizing_report(sizing: Sizing, verdicts: Sequence[Verdict], failed: str) -> Report:
    """Make the report of a sizing.

    Args:
        sizing: the sizing.
        verdicts: verdicts on all candidates with all controllers.
        failed: failed runs in a sentence; "" if there are none.
    """
    answers = [_answer(sizing, verdicts, label) for label in sizing.controllers]
    answers.sort(key=_heavy)
    best, count = answers[0], len(verdicts) // len(sizing.controllers)
    chosen = best["chosen"]
    sets = [(x["label"], x["chosen"].candidate) for x in answers if x["chosen"]]
    unjudged = any(x["unjudged"] for x in answers)
    missed = [f"with {x['label']}, {'; '.join(x['reasons'])}" for x in answers]
    return written("sizing", {
        "name": sizing.name, "failed": failed or None, "count": count,
        "set": _set(chosen) if chosen else None, "mass": chosen and chosen.mass,
        "labels": chosen and listed([x for x, one in sets if one == chosen.candidate]),
        "motions": ", ".join(map(short_name, sizing.motions)), "kept": best["kept"],
        "lighter": best["lighter"] or None, "reasons": "; ".join(best["reasons"]),
        "none": None if chosen else count, "missed": "; ".join(missed),
        "meets": "is known to meet all requirements, as runs failed" if unjudged
        else "meets all requirements",
        "in_short": doc.bullets(_in_short(answer, count) for answer in answers),
        "tight": "below a tenth" if best["tight"] else None,
        "fields": doc.fenced(best["fields"]) if chosen else None,
        "repeated": f"with pauses of {sizing.pause:g} s" if sizing.pause else "back to back",
        "margins": [x for one in answers for x in (one["margins"], one["out"]) if x],
        "motors": motor_table(sizing, verdicts),
        f"{FIGURE}.png": sizing_front(f"{sizing.name}: motors and tracking", verdicts),
    })  # fmt: skip


def _in_short(answer: dict[str, Any], count: int) -> Marked:
    """Return the chosen or the nearest set of a controller."""
    label, chosen, shown = answer["label"], answer["chosen"], answer["shown"]
    failed = ""
    if answer["unjudged"]:
        failed = f" {answer['unjudged']} of them cannot be judged, as runs failed."
    if chosen is None:
        return said(
            "**With {}:** none of {} candidates.{} The nearest, {}, misses {}: {}.",
            label, count, Marked(failed), _set(shown), len(shown.missed),
            "; ".join(shown.missed[:3]),
        )  # fmt: skip
    text = said(
        "**With {}:** {}, {:g} kg; {} of {} candidates meet all requirements.{}",
        label, _set(chosen), chosen.mass, answer["kept"], count, Marked(failed),
    )  # fmt: skip
    tight = said("Less than a tenth of a limit is left at {}.", ", ".join(answer["tight"]))
    return joined([text, tight], " ") if answer["tight"] else text


def _set(verdict: Verdict) -> str:
    """Return the motors of a candidate, with its structure if that is scaled."""
    scale = verdict.candidate.structure_scale
    scaled = f" at structure scale {scale:g}" if scale != 1 else ""
    return ", ".join(verdict.candidate.motors) + scaled


def _answer(sizing: Sizing, verdicts: Sequence[Verdict], label: str) -> dict[str, Any]:
    """Return the result for a controller."""
    own = [v for v in verdicts if v.controller == label]
    chosen = recommend(verdicts, label)
    shown = chosen or nearest(verdicts, label)
    return {
        "label": in_print(label),
        "chosen": chosen,
        "shown": shown,
        "kept": sum(v.feasible for v in own),
        "lighter": sum(v.mass < chosen.mass for v in own) if chosen else 0,
        "unjudged": sum(not v.judged for v in own),
        "reasons": [text for text, _ in _limits(own, chosen).most_common(3)],
        "tight": [] if chosen is None else _tight(chosen),
        "fields": _fields(sizing, shown),
        "margins": _margins(shown) if shown.worst else None,
        "out": _ruled_out(own, in_print(label)),
    }


def _heavy(answer: dict[str, Any]) -> tuple[float, float]:
    """Return the key by which answers are sorted: mass, then error."""
    chosen = answer["chosen"]
    return (chosen.mass, chosen.error) if chosen else (math.inf, math.inf)


def _fields(sizing: Sizing, verdict: Verdict) -> str:
    """Return device and controller of a candidate as the YAML of a scenario."""
    catalogue = sizing.device.catalogue
    kind, _, feedforward = canonical(verdict.controller).partition("+")
    shared = catalogue if catalogue.startswith(PACKAGE_PREFIX) else Path(catalogue).name
    device: dict[str, object] = {"catalogue": shared, "fitted": sizing.device.fitted}
    if sizing.device.gear_ratio is not None:
        device["gear_ratio"] = sizing.device.gear_ratio
    device["motors"] = [*verdict.candidate.motors]
    lines = [f"  {name}: {json.dumps(value)}" for name, value in device.items()]
    lines.append(f"  structure_scale: {verdict.candidate.structure_scale:g}")
    law = [f"  kind: {kind}", *([f"  feedforward: {feedforward}"] if feedforward else [])]
    return "\n".join(["device:", *lines, "controller:  # beside what it has", *law])


def _tight(verdict: Verdict) -> list[str]:
    """Return the joints with less than a tenth of a limit left."""
    joints = range(1, len(verdict.candidate.motors) + 1)
    nearest_limits = [(k, verdict.tightest(k)) for k in joints]
    return [
        f"joint {k} ({metric_of(name).title})"
        for k, name in nearest_limits
        if verdict.used[name] > 1 - _MIN_MARGIN
    ]


def _margins(verdict: Verdict) -> doc.Table:
    """Make the table of the nearest limit of each joint and the margin to it."""
    rows = []
    for k, id_ in enumerate(verdict.candidate.motors):
        name = verdict.tightest(k + 1)
        value, motion = verdict.worst[name]
        metric, used = metric_of(name), 100 * verdict.used[name]
        rows.append((
            f"{k + 1}", id_, metric.title, f"{metric.text(value)} {metric.unit}",
            formatted(used, ".0f"), formatted(100 - used, ".0f"), motion,
        ))  # fmt: skip
    kind = "Margins" if verdict.feasible else "The nearest set misses"
    return doc.Table(
        ("joint", "motor", "nearest limit", "value", "used [%]", "margin [%]", "in motion"), rows,
        title=f"{kind}, with {in_print(verdict.controller)}",
    )  # fmt: skip


def _in_words(name: str) -> str:
    """Return a limit as text, such as "torque used of joint 2"."""
    joint = family_of(name)[1]
    return metric_of(name).title + (f" of joint {joint}" if joint else "")


def _limits(verdicts: Sequence[Verdict], chosen: Verdict | None) -> Counter[str]:
    """Count the limits missed by candidates lighter than the chosen one; by all without one."""
    return Counter(
        _in_words(name) if name in v.used else name
        for v in verdicts
        if chosen is None or v.mass < chosen.mass
        for name in v.beyond
    )


def _ruled_out(verdicts: Sequence[Verdict], label: str) -> doc.Table | None:
    """Make the table of how many candidates each limit rules out."""
    counts = Counter(name for v in verdicts for name in v.beyond)
    alone = Counter(v.beyond[0] for v in verdicts if len(v.beyond) == 1)
    rows = [
        (_in_words(name), f"{count}", f"{alone[name]}") for name, count in counts.most_common(10)
    ]
    header = (f"limit, with {label}", f"of {len(verdicts)} candidates, miss it", "miss it alone")
    return doc.Table(header, rows, f"What rules candidates out, with {label}") if rows else None


def motor_table(sizing: Sizing, verdicts: Sequence[Verdict]) -> doc.Table:
    """Make the table of the motors of each joint, with the sets that meet all requirements."""
    rows, catalogue = [], sizing.catalogue
    for k, ids in enumerate(sizing.motors):
        for motor in sorted((catalogue.motor(x, "motors") for x in ids), key=lambda m: m.mass):
            kept = [
                [v.feasible for v in verdicts
                 if v.controller == label and v.candidate.motors[k] == motor.id]
                for label in sizing.controllers
            ]  # fmt: skip
            peak = motor.peak_torque * motor.gear_ratio
            rows.append((
                f"{k + 1}", motor.id, f"{motor.mass:g}", f"{peak:.5g}",
                *(f"{sum(own)} of {len(own)}" for own in kept),
            ))  # fmt: skip
    header = ("joint", "motor", "mass [kg]", "peak torque, behind its gear [N m]")
    enough = [f"enough in sets, {in_print(label)}" for label in sizing.controllers]
    return doc.Table((*header, *enough), rows)
