"""The paper's claims, each with what was computed here and a verdict made from the numbers.

What the claims say, and why they hold or not, stands in pages/claims.yaml.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from decimal import Decimal
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import yaml  # of Drake itself

from sdt_drake.analysis import paper
from sdt_drake.analysis.comparison import Compared
from sdt_drake.analysis.reproduction import Reproduction, table1_rows
from sdt_drake.systems.gains import natural_frequency, oscillation_frequency

REPRODUCED = "reproduced"
NOT_REPRODUCED = "not reproduced"
NOT_COMPARABLE = "not comparable"

VERDICTS = (REPRODUCED, NOT_REPRODUCED, NOT_COMPARABLE)

STEP_TOLERANCE = 0.01
"""Relative difference at which a step metric still agrees with the printed one; at least half a
unit of the last printed digit."""

_UNPUBLISHED = (
    "the device's geometry, masses and the data of Figure 2 are not published; ours are calibrated "
    "to the other numbers of Table 1"
)


@dataclass(frozen=True)
class Claim:
    """A claim of the paper, and what became of it.

    Attributes:
        id: short name.
        statement: what the paper says, in our words.
        published: its value.
        computed: ours.
        verdict: one of VERDICTS.
        why: reason, in one or two sentences.
    """

    id: str
    statement: str
    published: object
    computed: object
    verdict: str
    why: str


@dataclass(frozen=True)
class _Found:
    """What was computed for a claim, whether it holds then, and the numbers in its words."""

    id: str
    computed: object
    holds: bool
    published: object = None
    numbers: Mapping[str, object] = field(default_factory=dict)


def judge_claims(results: Reproduction) -> list[Claim]:
    """Judge all claims of the paper, in its order."""
    finders = (_figure4, _table1, _frequencies, _algorithm1, _tracking, _inertia, _coupled)
    found = {f.id: f for find in finders for f in find(results)}
    claims = []
    for text in _texts():
        own = found[text["id"]]
        numbers = {"unpublished": _UNPUBLISHED, **own.numbers}
        claims.append(
            Claim(
                id=own.id,
                statement=text["statement"].format_map(numbers),
                published=text.get("published", own.published),
                computed=own.computed,
                verdict=REPRODUCED if own.holds else text.get("otherwise", NOT_REPRODUCED),
                why=text["why"].format_map(numbers),
            )
        )
    return claims


@cache
def _texts() -> Any:
    """What claims.yaml says of each claim, in the order of the paper."""
    return yaml.safe_load(Path(__file__).with_name("claims.yaml").read_text(encoding="utf-8"))


def agrees_as_printed(computed: float, printed: str) -> bool:
    """Whether `computed`, rounded to the digits of `printed`, is the same number."""
    if not np.isfinite(computed):
        return False
    unit = Decimal(1).scaleb(int(Decimal(printed).as_tuple().exponent))
    return abs(Decimal(computed) - Decimal(printed)) <= unit / 2


# --- Section 3.3, Figure 4, Table 1 ----------------------------------------------------------


def _figure4(results: Reproduction) -> Iterator[_Found]:
    half_digit = {"rise_time": 5e-4, "settling_time": 5e-3, "overshoot_percent": 0.01}
    for structure, step in results.steps.items():
        published = paper.FIGURE4[structure]
        computed = {name: float(getattr(step.metrics, name)) for name in published}
        holds = all(
            abs(computed[name] - value) <= max(STEP_TOLERANCE * value, half_digit[name])
            for name, value in published.items()
        )
        yield _Found(f"figure4_{structure}", computed, holds, published, {"zeta": step.zeta})


def _table1(results: Reproduction) -> Iterator[_Found]:
    rows = table1_rows(results.design)
    for key in ("i_eff_max", "kp", "ki", "zeta_max", "zeta_median", "zeta_min"):
        computed = [row[key] for row in rows]
        agree = list(map(agrees_as_printed, computed, paper.TABLE1[key]))
        agreeing = ", ".join(str(k + 1) for k in np.flatnonzero(agree))
        published = paper.table1(key)
        yield _Found(f"table1_{key}", computed, all(agree), published, {"agreeing": agreeing})
    for row, printed in zip(rows, paper.TABLE1["variation_percent"], strict=True):
        variation = row["variation_percent"]
        holds = agrees_as_printed(variation, printed)
        yield _Found(f"variation_joint_{row['joint']}", variation, holds, float(printed))


def _frequencies(results: Reproduction) -> Iterator[_Found]:
    gains, inertia = results.design.gains, results.design.inertia
    at_max = inertia.maximum
    ratio = oscillation_frequency(gains, at_max)[0] / natural_frequency(gains, at_max)[0]
    printed = paper.OMEGA_0_OVER_OMEGA_N
    yield _Found("omega_0k", float(ratio), agrees_as_printed(ratio, printed), float(printed))
    highest = natural_frequency(gains, inertia.minimum) / paper.OMEGA_R
    holds = bool(np.all(highest <= 0.5 * (1 + 1e-9)))
    yield _Found("bandwidth_rule", highest.tolist(), holds)


# --- Algorithm 1 -----------------------------------------------------------------------------


def _algorithm1(results: Reproduction) -> Iterator[_Found]:
    design = {sign: results.axis("pi", sign).design for sign in ("printed", "consistent")}
    miss = {}
    for sign, of in design.items():
        split = of.robot.gear_ratio * (of.loads.load_torque - of.loads.alleviating_torque)
        miss[sign] = np.abs(split - design["printed"].torques.coupled)
    worst = {sign: float(values.max()) for sign, values in miss.items()}
    share = (np.maximum(*miss.values()) > 1e-6).mean(axis=0)
    computed = worst | {"share_of_samples": share.tolist()}
    yield _Found("algorithm1_split", computed, worst["printed"] < 1e-6)
    helps = design["printed"].loads.alleviating_torque * design["printed"].motion.vd >= 0
    yield _Found("alleviating_sign", bool(helps.all()), bool(helps.all()))


# --- Section 4, Figures 7 and 8 --------------------------------------------------------------


def _tracking(results: Reproduction) -> Iterator[_Found]:
    pi, ctc = results.axis("pi"), results.axis("pi_ctc")
    error_pi, error_ctc = pi.tracking.max_abs_speed_error, ctc.tracking.max_abs_speed_error
    _, gain_2, gain_3, _ = error_pi / error_ctc
    consistent = {name: _joint_2(results.axis(name, "consistent")) for name in ("pi", "pi_ctc")}
    gain_consistent = consistent["pi"] / consistent["pi_ctc"]
    yield _Found(
        "ctc_improves_tracking",
        {"pi": error_pi.tolist(), "pi_ctc": error_ctc.tolist()},
        bool(np.all(error_ctc <= error_pi * 1.001) and np.any(error_ctc < 0.5 * error_pi)),
        numbers={"gain_2": gain_2, "gain_3": gain_3, "gain_consistent": gain_consistent},
    )
    share_pi, share_ctc = _share_of_speed(pi), _share_of_speed(ctc)
    yield _Found(
        "pi_small_steady_error",
        _steady(pi),
        all(share_ctc[name] < share_pi[name] < 10 for name in share_pi),
        numbers=share_pi,
    )
    holds = all(share < 1 for share in share_ctc.values())
    yield _Found("ctc_zero_steady_error", _steady(ctc), holds, numbers=share_ctc)
    jump, lead = _jump_before_peak(pi, joint=1)
    yield _Found(
        "joint2_errors_from_load_jumps",
        {"jump": jump, "seconds_before_peak": lead},
        jump > 1000,
        numbers={"consistent": consistent["pi"]},
    )


def _inertia(results: Reproduction) -> Iterator[_Found]:
    for process, published in paper.JOINT2_PI_MAX_ERROR.items():
        computed = _joint_2(results.axis("pi", process=process))
        holds = abs(computed / published - 1) < 0.02
        yield _Found(f"joint2_pi_error_{process}", computed, holds, published)
    change = _change(results, "pi", "printed")
    others = np.delete(change, 1)
    yield _Found(
        "deterioration_at_i_eff_min",
        change.tolist(),
        bool(np.all(others < 2) and change[1] > 10),
        numbers={"consistent": _change(results, "pi", "consistent")[1]},
    )
    with_ctc = float(_change(results, "pi_ctc", "printed")[1])
    yield _Found("ctc_insensitive_to_inertia", with_ctc, abs(with_ctc) < 1)


# --- beyond the paper: the coupled plant -----------------------------------------------------


def _coupled(results: Reproduction) -> Iterator[_Found]:
    runs = {
        "pi": results.coupled("pi"),
        "pi_ctc": results.coupled("pi_ctc"),
        "pi_ctc_printed_sign": results.coupled("pi_ctc", "printed"),
    }
    largest = {name: run.tracking.max_abs_speed_error.tolist() for name, run in runs.items()}
    of_joint_2 = {name: errors[1] for name, errors in largest.items()}
    gain = of_joint_2["pi"] / of_joint_2["pi_ctc"]
    printed = of_joint_2["pi_ctc_printed_sign"] / of_joint_2["pi"]
    numbers = {"gain": gain, "printed": printed}
    yield _Found("ctc_on_coupled_plant", largest, gain >= 2, numbers=numbers)
    steady = {name: _steady(run) for name, run in runs.items()}
    pi, ctc = steady["pi"], steady["pi_ctc"]
    yield _Found(
        "ctc_steady_on_coupled_plant",
        steady,
        all(share < 1 for share in _share_of_speed(runs["pi_ctc"]).values()),
        numbers={
            "less_2": pi["joint 2"] / ctc["joint 2"],
            "less_4": pi["joint 4"] / ctc["joint 4"],
            "less_middle": _middle_error(runs["pi"]) / _middle_error(runs["pi_ctc"]),
            "printed": steady["pi_ctc_printed_sign"]["joint 2"] / pi["joint 2"],
        },
    )


# --- numbers that several claims need --------------------------------------------------------


def _joint_2(run: Compared) -> float:
    """Largest speed error of joint 2 [rad/s]."""
    return float(run.tracking.max_abs_speed_error[1])


def _change(results: Reproduction, controller: str, sign: str) -> np.ndarray:
    """Of the largest speed errors with the smallest inertia, shape (n,) [%]."""
    at_min, at_max = (
        results.axis(controller, sign, process).tracking.max_abs_speed_error
        for process in ("i_eff_min", "i_eff_max")
    )
    return 100 * (at_min / at_max - 1)


def _steady(run: Compared) -> dict[str, float]:
    """Largest error of joints 2 and 4 where their speed is constant [rad/s]."""
    errors = run.tracking.constant_speed_error
    return {"joint 2": float(errors[1]), "joint 4": float(errors[3])}


def _share_of_speed(run: Compared) -> dict[str, float]:
    """The same over the largest speed of the joint [%]."""
    share = 100 * run.tracking.constant_speed_error / np.abs(run.recording.v_ref).max(axis=0)
    return {"share_2": share[1], "share_4": share[3]}


def _middle_error(run: Compared) -> float:
    """Largest error of joint 2 at its constant speed in the middle of the motion [rad/s]."""
    time = run.recording.time
    return float(np.abs(run.recording.speed_error[(time > 11) & (time < 16.5), 1]).max())


def _jump_before_peak(run: Compared, joint: int) -> tuple[float, float]:
    """Largest change of the load within a period [N m] in the 0.1 s before the largest error,
    and how long before it was [s]."""
    period = run.design.motion.period
    peak = int(np.argmax(np.abs(run.recording.speed_error[:, joint])))
    start = max(peak - round(0.1 / period), 0)
    changes = np.abs(np.diff(run.recording.load_torque[start : peak + 1, joint]))
    i = int(np.argmax(changes))
    return float(changes[i]), (len(changes) - i) * period
