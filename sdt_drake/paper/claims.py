"""The paper's claims, each with the computed value and a verdict that follows from the numbers.

Statements and reasons are in claims.yaml.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from decimal import Decimal
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import yaml  # a dependency of Drake

from sdt_drake.analysis.comparison import Compared
from sdt_drake.paper import published as paper
from sdt_drake.paper.reproduction import Reproduction, table1_rows
from sdt_drake.systems.gains import natural_frequency, oscillation_frequency

REPRODUCED = "reproduced"
NOT_REPRODUCED = "not reproduced"
NOT_COMPARABLE = "not comparable"

VERDICTS = (REPRODUCED, NOT_REPRODUCED, NOT_COMPARABLE)

OF_THE_PAPER = "of the paper"
BY_CONSTRUCTION = "by construction"
BEYOND = "beyond the paper"

KINDS = (OF_THE_PAPER, BY_CONSTRUCTION, BEYOND)
"""Kinds of claims: independently computed, agreeing because the device is calibrated to the value,
and ours on a plant that the paper does not have."""

_AS_PRINTED = "the printed digits, rounded"
"""Criterion of agreement with a number, in words."""

_UNPUBLISHED = (
    "the device's geometry, masses and the data of Figure 2 are not published; ours are calibrated "
    "to the other numbers of Table 1"
)


@dataclass(frozen=True)
class Claim:
    """A claim of the paper and its verdict."""

    id: str
    """Short name."""
    kind: str
    """One of KINDS."""
    place: str
    """Section, equation, table or figure of the paper."""
    statement: str
    """The paper's claim in our words."""
    published: object
    """The paper's value."""
    computed: object
    """The value computed here."""
    verdict: str
    """One of VERDICTS."""
    agrees: str
    """Criterion of agreement, in words."""
    why: str
    """Reason of the verdict, in one or two sentences."""
    in_short: str
    """The claim and what was found, in a sentence for a list."""


_Found = tuple[str, object, bool, Mapping[str, object]]
"""Id of a claim, its computed value, whether that supports the claim, and numbers for its texts;
"published" is the paper's value where claims.yaml has none."""


def judge_claims(results: Reproduction) -> list[Claim]:
    """Return all claims of the paper with their verdicts, in the order of the paper."""
    finders = (_figure4, _table1, _frequencies, _algorithm1, _tracking, _inertia, _coupled)
    found = {one[0]: one[1:] for find in finders for one in find(results)}
    claims = []
    for text in _texts():
        computed, holds, own = found[text["id"]]
        numbers = {"unpublished": _UNPUBLISHED, "computed": computed, **own}
        claims.append(
            Claim(
                id=text["id"],
                kind=text.get("kind", OF_THE_PAPER),
                place=text["place"],
                statement=text["statement"].format_map(numbers),
                published=text.get("published", own.get("published")),
                computed=computed,
                verdict=REPRODUCED if holds else text.get("otherwise", NOT_REPRODUCED),
                agrees=text.get("agrees", _AS_PRINTED),
                why=text["why"].format_map(numbers),
                in_short=text.get("in_short", text["statement"]).format_map(numbers),
            )
        )
    return claims


@cache
def _texts() -> Any:
    """Return the texts of claims.yaml, in the order of the paper."""
    return yaml.safe_load(Path(__file__).with_name("claims.yaml").read_text(encoding="utf-8"))


def agrees_as_printed(computed: float, printed: str) -> bool:
    """Return whether `computed`, rounded to the digits of `printed`, is the same number.

    >>> agrees_as_printed(0.954, "0.95"), agrees_as_printed(0.956, "0.95")
    (True, False)
    """
    if not np.isfinite(computed):
        return False
    unit = Decimal(1).scaleb(int(Decimal(printed).as_tuple().exponent))
    return abs(Decimal(computed) - Decimal(printed)) <= unit / 2


# --- Section 3.3, Figure 4, Table 1 ----------------------------------------------------------


def _figure4(results: Reproduction) -> Iterator[_Found]:
    for structure, step in results.steps.items():
        printed = paper.FIGURE4[structure]
        computed = {name: float(getattr(step.metrics, name)) for name in printed}
        holds = all(agrees_as_printed(computed[name], text) for name, text in printed.items())
        published = {name: float(text) for name, text in printed.items()}
        numbers = {"published": published, "zeta": step.zeta}
        yield f"figure4_{structure}", computed, holds, numbers


def _table1(results: Reproduction) -> Iterator[_Found]:
    rows = table1_rows(results.design)
    for key in ("i_eff_max", "kp", "ki", "zeta_max", "zeta_median", "zeta_min"):
        computed = [row[key] for row in rows]
        agree = list(map(agrees_as_printed, computed, paper.TABLE1[key]))
        agreeing = ", ".join(str(k + 1) for k in np.flatnonzero(agree))
        numbers = {"published": paper.table1(key), "agreeing": agreeing}
        yield f"table1_{key}", computed, all(agree), numbers
    for row, printed in zip(rows, paper.TABLE1["variation_percent"], strict=True):
        variation, of_paper = row["variation_percent"], {"published": float(printed)}
        holds = agrees_as_printed(variation, printed)
        yield f"variation_joint_{row['joint']}", variation, holds, of_paper


def _frequencies(results: Reproduction) -> Iterator[_Found]:
    gains, inertia = results.design.tuning.gains, results.design.tuning.inertia
    at_max = inertia.maximum
    ratio = oscillation_frequency(gains, at_max)[0] / natural_frequency(gains, at_max)[0]
    printed = paper.OMEGA_0_OVER_OMEGA_N
    holds = agrees_as_printed(ratio, printed)
    yield "omega_0k", float(ratio), holds, {"published": float(printed)}
    highest = natural_frequency(gains, inertia.minimum) / paper.OMEGA_R
    yield "bandwidth_rule", highest.tolist(), bool(np.all(highest <= 0.5 * (1 + 1e-9))), {}


# --- Algorithm 1 -----------------------------------------------------------------------------


def _algorithm1(results: Reproduction) -> Iterator[_Found]:
    design = {sign: results.axis("pi", sign).design for sign in ("printed", "consistent")}
    miss = {}
    for sign, of in design.items():
        split = of.device.simulated.gear_ratio * (
            of.loads.load_torque - of.loads.alleviating_torque
        )
        miss[sign] = np.abs(split - design["printed"].torques.coupled)
    worst = {sign: float(values.max()) for sign, values in miss.items()}
    third = np.maximum(*miss.values()) > 1e-6
    own = design["printed"].torques.inertial
    share, share_moving = third.mean(axis=0), (third & (own != 0)).mean(axis=0)
    computed = worst | {"share_of_samples": share.tolist()}
    numbers = {"moving": ", ".join(f"{100 * s:.1f}" for s in share_moving)}
    numbers |= {"least": f"{100 * share.min():.0f}", "most": f"{100 * share.max():.0f}"}
    yield "algorithm1_split", computed, worst["printed"] < 1e-6, numbers
    helps = design["printed"].loads.alleviating_torque * design["printed"].reference.tracked.vd >= 0
    yield "alleviating_sign", bool(helps.all()), bool(helps.all()), {}


# --- Section 4, Figures 7 and 8 --------------------------------------------------------------


def _tracking(results: Reproduction) -> Iterator[_Found]:
    pi, ctc = results.axis("pi"), results.axis("pi_ctc")
    error_pi, error_ctc = pi.tracking.max_abs_speed_error, ctc.tracking.max_abs_speed_error
    _, gain_2, gain_3, _ = error_pi / error_ctc
    consistent = {name: _joint_2(results.axis(name, "consistent")) for name in ("pi", "pi_ctc")}
    gain_consistent = consistent["pi"] / consistent["pi_ctc"]
    errors = {"pi": error_pi.tolist(), "pi_ctc": error_ctc.tolist()}
    holds = bool(np.all(error_ctc <= error_pi * 1.001) and np.any(error_ctc < 0.5 * error_pi))
    numbers = {"gain_2": gain_2, "gain_3": gain_3, "gain_consistent": gain_consistent}
    yield "ctc_improves_tracking", errors, holds, numbers
    share_pi, share_ctc = _share_of_speed(pi), _share_of_speed(ctc)
    holds = all(share_ctc[name] < share_pi[name] < 10 for name in share_pi)
    yield "pi_small_steady_error", _steady(pi), holds, share_pi
    holds = all(share < 1 for share in share_ctc.values())
    yield "ctc_zero_steady_error", _steady(ctc), holds, share_ctc
    jump, lead = _jump_before_peak(pi, joint=1)
    jumps, numbers = {"jump": jump, "seconds_before_peak": lead}, {"consistent": consistent["pi"]}
    yield "joint2_errors_from_load_jumps", jumps, jump > 1000, numbers


def _inertia(results: Reproduction) -> Iterator[_Found]:
    for process, printed in paper.JOINT2_PI_MAX_ERROR.items():
        computed = _joint_2(results.axis("pi", process=process))
        holds = agrees_as_printed(computed, printed)
        yield f"joint2_pi_error_{process}", computed, holds, {"published": float(printed)}
    change = _change(results, "pi", "printed")
    holds = bool(np.all(np.delete(change, 1) < 2) and change[1] > 10)
    numbers = {"consistent": _change(results, "pi", "consistent")[1]}
    yield "deterioration_at_i_eff_min", change.tolist(), holds, numbers
    with_ctc = float(_change(results, "pi_ctc", "printed")[1])
    yield "ctc_insensitive_to_inertia", with_ctc, abs(with_ctc) < 1, {}


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
    numbers = {"gain": gain, "printed": of_joint_2["pi_ctc_printed_sign"] / of_joint_2["pi"]}
    yield "ctc_on_coupled_plant", largest, gain >= 2, numbers
    steady = {name: _steady(run) for name, run in runs.items()}
    pi, ctc = steady["pi"], steady["pi_ctc"]
    holds = all(share < 1 for share in _share_of_speed(runs["pi_ctc"]).values())
    numbers = {
        "less_2": pi["joint 2"] / ctc["joint 2"],
        "less_4": pi["joint 4"] / ctc["joint 4"],
        "less_middle": _middle_error(runs["pi"]) / _middle_error(runs["pi_ctc"]),
        "printed": steady["pi_ctc_printed_sign"]["joint 2"] / pi["joint 2"],
    }
    yield "ctc_steady_on_coupled_plant", steady, holds, numbers


# --- numbers that several claims need --------------------------------------------------------


def _joint_2(run: Compared) -> float:
    """Return the largest speed error of joint 2 [rad/s]."""
    return float(run.tracking.max_abs_speed_error[1])


def _change(results: Reproduction, controller: str, sign: str) -> np.ndarray:
    """Return the change of the largest speed errors from largest to smallest inertia [%], (n,)."""
    at_min, at_max = (
        results.axis(controller, sign, process).tracking.max_abs_speed_error
        for process in ("i_eff_min", "i_eff_max")
    )
    return 100 * (at_min / at_max - 1)


def _steady(run: Compared) -> dict[str, float]:
    """Return the largest speed errors of joints 2 and 4 at constant speed [rad/s]."""
    errors = run.tracking.constant_speed_error
    return {"joint 2": float(errors[1]), "joint 4": float(errors[3])}


def _share_of_speed(run: Compared) -> dict[str, float]:
    """Return the errors of `_steady` over the largest speed of their joint [%]."""
    share = 100 * run.tracking.constant_speed_error / np.abs(run.recording.v_ref).max(axis=0)
    return {"share_2": share[1], "share_4": share[3]}


def _middle_error(run: Compared) -> float:
    """Return the largest error of joint 2 at constant speed from 11 to 16.5 s [rad/s]."""
    time = run.recording.time
    return float(np.abs(run.recording.speed_error[(time > 11) & (time < 16.5), 1]).max())


def _jump_before_peak(run: Compared, joint: int) -> tuple[float, float]:
    """Return the largest jump of the load in the 0.1 s before the largest error.

    Returns:
        Change of the load torque within one period [N m], and its lead over the error [s].
    """
    period = run.design.reference.tracked.period
    peak = int(np.argmax(np.abs(run.recording.speed_error[:, joint])))
    start = max(peak - round(0.1 / period), 0)
    changes = np.abs(np.diff(run.recording.load_torque[start : peak + 1, joint]))
    i = int(np.argmax(changes))
    return float(changes[i]), (len(changes) - i) * period
