"""The files of `fly`: motion, summary and report."""

import json
import math
from pathlib import Path
from typing import Any, cast

import numpy as np

from sdt_drake.io.arrays import Array
from sdt_drake.io.files import replacing_files
from sdt_drake.io.formats import in_json
from sdt_drake.io.shown import formatted, numbered
from sdt_drake.machine.cueing.candidate import Candidate
from sdt_drake.machine.cueing.program import MAX_STEPS
from sdt_drake.machine.cueing.reach import reach
from sdt_drake.machine.cueing.result import CueingResult
from sdt_drake.motion import margins
from sdt_drake.pilot.canals import CUPULA, low_pass
from sdt_drake.pilot.head import GRAVITY
from sdt_drake.pilot.orientation import CAUTION
from sdt_drake.show.documents import MARKDOWN, REPORT, Report, written
from sdt_drake.show.figures import fly as figures
from sdt_drake.show.panels import Plots
from sdt_drake.show.sections import Table, said
from sdt_drake.show.style import pictures
from sdt_drake.show.view3d.viewer import played

MOTION, SUMMARY = "motion.csv", "summary.json"
_PLOTS, _RECORDING = ("force.png", "attitude.png", "rotation.png"), "3d.html"
FILES = (MOTION, SUMMARY, *pictures("front"), *_PLOTS, _RECORDING, MARKDOWN, REPORT)
"""Names of all files in the folder."""

_TOLD = 0.251, 1.0, 3.981  # frequencies of the report [rad/s]
_MIN_COST = 0.1  # share of an error; a smaller one is not attributed to the torque limits


def write_flown(folder: Path, flown: CueingResult) -> Path:
    """Write motion, summary and report into a folder, all or none, and return the page's path.

    Raises:
        InputError: if a file cannot be written.
    """
    with replacing_files(folder) as new:
        flown.motion.to_csv(new / MOTION)
        text = json.dumps(in_json(flown.numbers), indent=1, ensure_ascii=False, allow_nan=False)
        (new / SUMMARY).write_text(text + "\n", encoding="utf-8")
        fly_report(flown).write(new)
    return folder / REPORT


def fly_report(flown: CueingResult) -> Report:
    """Make the report of a flight."""
    best, flight, numbers = flown.chosen, flown.chosen.flight, cast(Any, flown.numbers)
    own, rest, alignment = (one.figures(flown.felt) for one in (best, flown.rest, flown.alignment))
    rate = flight.angular_rate - low_pass_at(flight.time, flight.angular_rate)
    size = np.linalg.norm(flight.specific_force, axis=1) / GRAVITY
    felt, resting, aligned = (x["felt_vertical_rms_deg"] for x in (own, rest, alignment))
    beside = said("; at rest {:.1f} deg, with alignment {:.1f} deg", resting, aligned)
    panels = {
        "force.png": figures.force_panels(best),
        "attitude.png": figures.attitude_panels(flown),
        "rotation.png": figures.rotation_panels(best),
    }
    free = flown.unlimited.figures(flown.felt) if flown.unlimited else None
    why = "which proves nothing, as the search may have missed a better one"
    if free and _costs(own, free):
        why = "at least the difference is due to the motors"
    return written("fly", {
        **numbers,
        **{name: Plots([shown]) if shown else None for name, shown in panels.items()},
        "front.png": figures.front(flown),
        "flight": flight, "robot": best.robot, "own": own, "rest": rest, "to": alignment,
        "reach": str(reach(best.robot, flight)),
        "sheet": _sheet(numbers["objective"]), "objective": numbers["objective"],
        "answer": flown.answer[0].upper() + flown.answer[1:],
        "online_answer": flown.online_answer if flown.online else None,
        "least": size.min(), "most": size.max(),
        "rate_rms": np.degrees(np.sqrt((rate**2).mean(axis=0).sum())),
        "vertical": "unknown; the model of the pilot does not cover weightlessness" if felt is None
        else said("{:.1f} deg RMS from that in flight{}", felt, beside),
        "free": free, "why": why, "allowed": 100 * numbers["torque_share_allowed"],
        "interrupted": "the interruption" if numbers["interrupted"] else None,
        "summary": Table(*flown.summary()[1:3]),
        "recording": played(
            _RECORDING, "The whole motion, from rest to rest; the aircraft's attitude is in the "
            "plots above.", best.robot, best.motion.time, best.motion.q, title=flight.name,
        ),
        "limits": _limits(best), "max_steps": MAX_STEPS, "found_from": _starts(flown),
        "others": _front(flown),
        "caution": CAUTION,
    })  # fmt: skip


def _costs(own: dict[str, float | None], free: dict[str, float | None]) -> bool:
    """Check if more than a tenth of either error is due to the torque limits."""
    return any(
        (own[name] or 0) - (free[name] or 0) > _MIN_COST * (own[name] or 0)
        for name in ("g_error_rms", "felt_rotation_rms_deg_s")
    )


def low_pass_at(time: Array, rate: Array) -> Array:
    """Filter a rate at any times by the canals' low pass."""
    period = 0.02
    even = np.arange(0.0, time[-1] + period, period)
    columns = np.stack([np.interp(even, time, column) for column in rate.T], axis=1)
    slow = low_pass(columns, CUPULA, period)
    return np.stack([np.interp(time, even, column) for column in slow.T], axis=1)


def _sheet(objective: Any) -> Table:
    """Make the table of gain, phase and errors of each signal."""
    at = [int(np.argmin(np.abs(objective["frequencies_rad_s"] - x))) for x in _TOLD]
    rows = []
    for name, one in objective["signals"].items():
        response = (
            f"{formatted(one['gain'][k], '.2f')}, {formatted(one['phase_deg'][k], '.0f')}"
            for k in at
        )
        errors = ("correlation", ".2f", 1), ("delay_s", ".2f", 1), ("nrmse", ".0f", 100)
        told = (formatted(factor * one[key], form) for key, form, factor in errors)
        rows.append((name, *response, *told, f"{100 * one['false']:.0f}"))
    return Table(
        ["", *(f"gain, phase at {x:g} rad/s [-, deg]" for x in _TOLD), "correlation", "delay [s]",
         "NRMSE [%]", "false cues [%]"], rows,
    )  # fmt: skip


def _starts(flown: CueingResult) -> Table:
    rows = flown.numbers["starts"]
    assert isinstance(rows, list)
    best = min((row["cost"] for row in rows), default=1.0)
    return Table(
        ["sense of the arm, seat", *_ERRORS, "cost above the best [%]", "beside the best"],
        [
            (f"{'+' if row['sense'] > 0 else '−'}, {row['seat_deg']:.0f} deg", *_errors(row),
             f"{100 * (row['cost'] / best - 1):.1f}", row["reason"] or "–")
            for row in rows
        ],
    )  # fmt: skip


_ERRORS = ["G error [G]", "felt rotation error [deg/s]", "felt vertical [deg]"]


def _number(value: float | None) -> float:
    return math.nan if value is None else value


def _errors(row: Any) -> tuple[str, str, str]:
    return (f"{row['g_error_rms']:.3f}", f"{row['felt_rotation_rms_deg_s']:.1f}",
            formatted(_number(row["felt_vertical_rms_deg"]), ".1f"))  # fmt: skip


def _front(flown: CueingResult) -> Table:
    rows = cast(Any, flown.numbers["front"])
    return Table(
        ["weight of G", *_ERRORS, "found by"],
        [(formatted(_number(row["g_weight"]), ".2g"), *_errors(row), row["origin"])
         for row in rows],
    )  # fmt: skip


def _limits(candidate: Candidate) -> Table:
    """Make the table of the largest used share of each limit, by joint."""
    share = margins(candidate.robot, candidate.motion).share
    return Table(
        ["joint", *(f"{name} [%]" for name in share)],
        [
            [name, *(f"{100 * values[:, k].max():.1f}" for values in share.values())]
            for k, name in enumerate(numbered(candidate.robot.joint_names))
        ],
    )
