"""The paper's claims, each with what was computed here and a verdict made from the numbers."""

from __future__ import annotations

from dataclasses import dataclass
from decimal import Decimal

import numpy as np

from sdt_drake import paper
from sdt_drake.analysis.study import Run, Study, table1
from sdt_drake.control import natural_frequency, oscillation_frequency

REPRODUCED = "reproduced"
NOT_REPRODUCED = "not reproduced"
NOT_COMPARABLE = "not comparable"

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
        verdict: REPRODUCED, NOT_REPRODUCED or NOT_COMPARABLE.
        why: reason, in one or two sentences.
    """

    id: str
    statement: str
    published: object
    computed: object
    verdict: str
    why: str


def judge(study: Study) -> list[Claim]:
    """All claims, in the order of the paper."""
    claims: list[Claim] = []
    for make in (_figure4, _table1, _frequencies, _algorithm1, _tracking, _inertia, _coupled):
        claims += make(study)
    return claims


def agrees_as_printed(computed: float, printed: str) -> bool:
    """Whether `computed`, rounded to the digits of `printed`, is the same number."""
    if not np.isfinite(computed):
        return False
    unit = Decimal(1).scaleb(int(Decimal(printed).as_tuple().exponent))
    return abs(Decimal(computed) - Decimal(printed)) <= unit / 2


def _verdict(holds: bool, otherwise: str = NOT_REPRODUCED) -> str:
    return REPRODUCED if holds else otherwise


# --- Section 3.3 and Figure 4 ----------------------------------------------------------------


def _figure4(study: Study) -> list[Claim]:
    names = {"pi": "PI on the error", "p_in_feedback": "P in the feedback path"}
    half_digit = {"rise_time": 5e-4, "settling_time": 5e-3, "overshoot_percent": 0.01}
    claims = []
    for structure, step in study.steps.items():
        published = paper.FIGURE4[structure]
        computed = {name: float(getattr(step.metrics, name)) for name in published}
        holds = all(
            abs(computed[name] - value) <= max(STEP_TOLERANCE * value, half_digit[name])
            for name, value in published.items()
        )
        claims.append(
            Claim(
                f"figure4_{structure}",
                f"Step response of axis 1, {names[structure]}, zeta {step.zeta:g}: rise time [s], "
                "settling time [s], overshoot [%]",
                published,
                computed,
                _verdict(holds),
                "simulated with the Drake diagram at our I_eff,1; rise is 10-90 %, settling 2 %",
            )
        )
    return claims


# --- Table 1 ---------------------------------------------------------------------------------


def _table1(study: Study) -> list[Claim]:
    rows = table1(study.design)
    return [
        _column(
            "table1_i_eff_max", "Largest effective inertia, motor side [kg m²]", rows, "i_eff_max",
            NOT_REPRODUCED, "by construction: the device is calibrated to these four values",
        ),
        _column(
            "table1_kp", "K_PS for the printed zeta [N m s/rad]", rows, "kp",
            NOT_REPRODUCED, "K_PS = 2 zeta sqrt(I_eff,max K_IS)",
        ),
        _column(
            "table1_ki", "K_IS = 0.25 omega_r² I_eff,max [N m/rad]", rows, "ki", NOT_REPRODUCED,
            f"the formula is the paper's own; with it joints {_agreeing(rows, 'ki')} agree, and "
            "K_IS,4 is 2.72e5",
        ),
        _column(
            "table1_zeta_max", "zeta at the largest inertia", rows, "zeta_max",
            NOT_REPRODUCED, "chosen by the authors; the gains are tuned to them",
        ),
        _column(
            "table1_zeta_median", "zeta at the median inertia", rows, "zeta_median",
            NOT_COMPARABLE, f"depends on how the inertia varies: {_UNPUBLISHED}",
        ),
        _column(
            "table1_zeta_min", "zeta at the smallest inertia", rows, "zeta_min",
            NOT_COMPARABLE, f"follows from the variation of the inertia, see there: {_UNPUBLISHED}",
        ),
        *_variations(rows),
    ]  # fmt: skip


def _column(
    id_: str, statement: str, rows: list[dict], key: str, otherwise: str, why: str
) -> Claim:
    computed = [row[key] for row in rows]
    holds = all(map(agrees_as_printed, computed, paper.TABLE1[key]))
    published = paper.table1(key)
    return Claim(id_, statement, published, computed, _verdict(holds, otherwise), why)


def _agreeing(rows: list[dict], key: str) -> str:
    """The joints whose value is the printed one."""
    agree = (
        str(row["joint"])
        for row, printed in zip(rows, paper.TABLE1[key], strict=True)
        if agrees_as_printed(row[key], printed)
    )
    return ", ".join(agree)


def _variations(rows: list[dict]) -> list[Claim]:
    reasons = {
        1: (NOT_COMPARABLE, f"no chain of this kind that we tried swings so far; {_UNPUBLISHED}"),
        2: (NOT_REPRODUCED, "by construction: the device is calibrated to it"),
        3: (NOT_COMPARABLE, _UNPUBLISHED),
        4: (
            NOT_REPRODUCED,
            "d_nn of the last link of a rigid serial chain does not depend on q (Eq. 2): its "
            "effective inertia is constant, whatever the device",
        ),
    }
    claims = []
    for row in rows:
        otherwise, why = reasons[row["joint"]]
        printed = paper.TABLE1["variation_percent"][row["joint"] - 1]
        computed = row["variation_percent"]
        holds = agrees_as_printed(computed, printed)
        claims.append(
            Claim(
                f"variation_joint_{row['joint']}",
                f"Variation of the effective inertia of joint {row['joint']} along the motion [%]",
                float(printed),
                computed,
                _verdict(holds, otherwise),
                why,
            )
        )
    return claims


def _frequencies(study: Study) -> list[Claim]:
    design = study.design
    at_max = design.inertia.maximum
    ratio = float(
        oscillation_frequency(design.gains, at_max)[0] / natural_frequency(design.gains, at_max)[0]
    )
    highest = natural_frequency(design.gains, design.inertia.minimum) / paper.OMEGA_R
    return [
        Claim(
            "omega_0k",
            "Oscillation frequency of the closed loop over omega_n, zeta 0.95",
            float(paper.OMEGA_0_OVER_OMEGA_N),
            ratio,
            _verdict(agrees_as_printed(ratio, paper.OMEGA_0_OVER_OMEGA_N)),
            "the paper's own formula, sqrt(1 - 0.95²), gives 0.312",
        ),
        Claim(
            "bandwidth_rule",
            "The gains keep omega_n of every joint at or below 0.5 omega_r",
            0.5,
            highest.tolist(),
            _verdict(bool(np.all(highest <= 0.5 * (1 + 1e-9)))),
            "it holds at the largest inertia only: omega_n = sqrt(K_IS / I_eff) grows as the "
            "inertia falls; given is omega_n / omega_r at the smallest inertia of each joint",
        ),
    ]


# --- Algorithm 1 -----------------------------------------------------------------------------


def _algorithm1(study: Study) -> list[Claim]:
    printed = study.run("axis", "i_eff_max", "printed", "pi", False).design
    vd = printed.motion.vd
    worst, third = {}, np.zeros_like(vd, dtype=bool)
    coupled = printed.torques.coupled
    for sign in ("printed", "consistent"):
        design = study.run("axis", "i_eff_max", sign, "pi", False).design
        split = design.robot.gear_ratio * (
            design.loads.load_torque - design.loads.alleviating_torque
        )
        worst[sign] = float(np.max(np.abs(split - coupled)))
        third |= np.abs(split - coupled) > 1e-6
    helps = printed.loads.alleviating_torque * vd
    return [
        Claim(
            "algorithm1_split",
            "Algorithm 1 splits tau_coupled: r (tau_LD - tau_alleviate) = tau_coupled "
            "[largest error, N m]",
            0.0,
            worst | {"share_of_samples": third.mean(axis=0).tolist()},
            _verdict(worst["printed"] < 1e-6),
            "the third branch as printed, tau_LD = -tau_k / r, misses by 2 tau_k, in the given "
            "share of the motion; with tau_LD = +tau_k / r the split is exact",
        ),
        Claim(
            "alleviating_sign",
            "tau_alleviate always has the sign of the acceleration",
            True,
            bool(np.all(helps >= 0)),
            _verdict(bool(np.all(helps >= 0))),
            "checked at every sample of the motion; true of Algorithm 1 by its branches",
        ),
    ]


# --- Section 4, Figures 7 and 8 --------------------------------------------------------------


def _tracking(study: Study) -> list[Claim]:
    pi = study.run("axis", "i_eff_max", "printed", "pi", False)
    ctc = study.run("axis", "i_eff_max", "printed", "pi_ctc", True)
    error_pi, error_ctc = pi.tracking.max_abs_speed_error, ctc.tracking.max_abs_speed_error
    steady_pi, steady_ctc = _steady(pi), _steady(ctc)
    share_pi, share_ctc = _share_of_speed(pi), _share_of_speed(ctc)
    jump, lead = _jump_before_peak(pi, joint=1)
    return [
        Claim(
            "ctc_improves_tracking",
            "CTC improves the tracking in the decoupled models: largest speed error with PI "
            "and with PI + CTC [rad/s]",
            "improvement",
            {"pi": error_pi.tolist(), "pi_ctc": error_ctc.tolist()},
            _verdict(
                bool(np.all(error_ctc <= error_pi * 1.001) and np.any(error_ctc < 0.5 * error_pi))
            ),
            f"joint 2 improves {error_pi[1] / error_ctc[1]:.1f} times, joint 3 "
            f"{error_pi[2] / error_ctc[2]:.1f} times, joints 1 and 4 hardly: there the lag of the "
            "reference, 2 zeta / omega_n times its acceleration, is the error. With the consistent "
            "sign of Algorithm 1 the improvement of joint 2 shrinks to "
            f"{_ratio_consistent(study):.2f} times",
        ),
        Claim(
            "pi_small_steady_error",
            "With PI alone a small error remains where the speed of joints 2 and 4 is constant "
            "[rad/s]",
            "small",
            steady_pi,
            _verdict(all(share_ctc[j] < share_pi[j] < 10 for j in share_pi)),
            f"{share_pi['joint 2']:.1f} and {share_pi['joint 4']:.1f} % of the speed, from 1 s "
            "after it became constant: the load varies, and the gains are limited",
        ),
        Claim(
            "ctc_zero_steady_error",
            "With CTC the error is zero where the speed of joints 2 and 4 is constant [rad/s]",
            0.0,
            steady_ctc,
            _verdict(all(share < 1 for share in share_ctc.values())),
            f"{share_ctc['joint 2']:.1f} and {share_ctc['joint 4']:.1f} % of the speed, zero at "
            "the scale of Figure 8; it cannot be zero, as 5 % of the load are not compensated",
        ),
        Claim(
            "joint2_errors_from_load_jumps",
            "The short large errors of joint 2 with PI come from sudden changes of its load "
            "torque [N m within one period, in the 0.1 s before the largest error]",
            "sudden and large",
            {"jump": jump, "seconds_before_peak": lead},
            _verdict(bool(jump > 1000)),
            "but the jumps are made by the printed sign of Algorithm 1: the load changes by "
            "2 tau_coupled when the reference acceleration starts or ends. With the consistent "
            "sign the load is continuous there and the largest error is "
            f"{_joint2(study, 'consistent', 'i_eff_max', 'pi'):.3f} rad/s",
        ),
    ]


def _inertia(study: Study) -> list[Claim]:
    at = {
        (process, controller): study.run(
            "axis", process, "printed", controller, controller == "pi_ctc"
        ).tracking.max_abs_speed_error
        for process in ("i_eff_max", "i_eff_min")
        for controller in ("pi", "pi_ctc")
    }
    change = 100 * (at["i_eff_min", "pi"] / at["i_eff_max", "pi"] - 1)
    change_ctc = 100 * (at["i_eff_min", "pi_ctc"] / at["i_eff_max", "pi_ctc"] - 1)
    others = np.delete(change, 1)
    claims = [
        _joint2_error_claim(process, float(at[process, "pi"][1]))
        for process in ("i_eff_max", "i_eff_min")
    ]
    return [
        *claims,
        Claim(
            "deterioration_at_i_eff_min",
            "With PI, the smallest inertia makes the errors little larger, except for joint 2 "
            "[change of the largest error, %]",
            "insignificant except joint 2 (+11.5 %)",
            change.tolist(),
            _verdict(bool(np.all(others < 2) and change[1] > 10), NOT_COMPARABLE),
            "the motion and the inertias are not published; I_eff,min is taken as the published "
            "I_eff,max less the published variation, for joint 4 too. Joint 2 does lose most, but "
            "through the printed sign of Algorithm 1: with the consistent one its error changes by "
            f"{_change_consistent(study):.2f} %",
        ),
        Claim(
            "ctc_insensitive_to_inertia",
            "With CTC, the error of joint 2 hardly depends on the inertia [change, %]",
            "insignificant",
            float(change_ctc[1]),
            _verdict(bool(abs(change_ctc[1]) < 1)),
            "what remains with CTC is the reference lag, which does not depend on the inertia "
            "(2 zeta / omega_n = K_PS / K_IS)",
        ),
    ]


def _change_consistent(study: Study) -> float:
    """Of the largest PI error of joint 2 with the smallest inertia, consistent sign [%]."""
    at_min, at_max = (
        _joint2(study, "consistent", process, "pi") for process in ("i_eff_min", "i_eff_max")
    )
    return 100 * (at_min / at_max - 1)


def _joint2_error_claim(process: str, computed: float) -> Claim:
    published = paper.JOINT2_PI_MAX_ERROR[process]
    return Claim(
        f"joint2_pi_error_{process}",
        f"Largest speed error of joint 2 with PI, process with {process} [rad/s]",
        published,
        computed,
        _verdict(abs(computed / published - 1) < 0.02, NOT_COMPARABLE),
        "the motion of Figure 2 is not published. In the linear loop at I_eff,max a full reversal "
        "of the motor's ±3950 N m gives 0.91 rad/s, so saturation or reference lag is part of the "
        "published value",
    )


# --- beyond the paper: the coupled plant -----------------------------------------------------


def _coupled(study: Study) -> list[Claim]:
    pi = study.run("coupled", "multibody", "consistent", "pi", False)
    ctc = study.run("coupled", "multibody", "consistent", "pi_ctc", False)
    printed = study.run("coupled", "multibody", "printed", "pi_ctc", False)
    largest = {
        name: run.tracking.max_abs_speed_error.tolist()
        for name, run in (("pi", pi), ("pi_ctc", ctc), ("pi_ctc_printed_sign", printed))
    }
    steady = {
        name: _steady(run)
        for name, run in (("pi", pi), ("pi_ctc", ctc), ("pi_ctc_printed_sign", printed))
    }
    share = _share_of_speed(ctc)
    gain = largest["pi"][1] / largest["pi_ctc"][1]
    less = {j: steady["pi"][j] / steady["pi_ctc"][j] for j in share}
    return [
        Claim(
            "ctc_on_coupled_plant",
            "Beyond the paper: CTC considerably improves the tracking of the coupled "
            "MultibodyPlant [largest speed error, rad/s]",
            "considerable improvement",
            largest,
            _verdict(gain >= 2),
            f"joint 2 improves by a factor of {gain:.2f}: coupling acts physically, and the lag of "
            "the reference, which CTC does not touch, is most of the largest error. With the sign "
            "as printed, the error of joint 2 is "
            f"{largest['pi_ctc_printed_sign'][1] / largest['pi'][1]:.1f} times that of PI alone",
        ),
        Claim(
            "ctc_steady_on_coupled_plant",
            "Beyond the paper: CTC removes the error of joints 2 and 4 at constant speed on the "
            "coupled MultibodyPlant [rad/s]",
            0.0,
            steady,
            _verdict(all(value < 1 for value in share.values())),
            f"the largest error of joint 2 is {less['joint 2']:.1f} times less than with PI "
            f"({_middle_error(pi) / _middle_error(ctc):.1f} times from 11 to 16.5 s), of joint 4 "
            f"{less['joint 4']:.1f} times (below 1: more): the load of the reference is fed "
            "forward when joint 2 should start to reverse, but joint 2 lags its reference, and the "
            "real coupling comes later. With the printed sign the error of joint 2 is "
            f"{steady['pi_ctc_printed_sign']['joint 2'] / steady['pi']['joint 2']:.1f} "
            "times that of PI",
        ),
    ]


# --- numbers that several claims need --------------------------------------------------------


def _middle(run: Run) -> np.ndarray:
    """The constant-speed segment of joint 2 in the middle of the motion."""
    return (run.recording.time > 11) & (run.recording.time < 16.5)


def _steady(run: Run) -> dict[str, float]:
    """Largest error of joints 2 and 4 where their speed is constant [rad/s]."""
    errors = run.tracking.constant_speed_error
    return {"joint 2": float(errors[1]), "joint 4": float(errors[3])}


def _share_of_speed(run: Run) -> dict[str, float]:
    """The same over the largest speed of the joint [%]."""
    speed = np.abs(run.recording.v_ref).max(axis=0)
    steady = _steady(run)
    return {name: 100 * steady[name] / speed[int(name[-1]) - 1] for name in steady}


def _middle_error(run: Run) -> float:
    """Largest error of joint 2 in that segment [rad/s]."""
    return float(np.abs(run.recording.speed_error[_middle(run), 1]).max())


def _joint2(study: Study, sign: str, process: str, controller: str) -> float:
    run = study.run("axis", process, sign, controller, controller == "pi_ctc")
    return float(run.tracking.max_abs_speed_error[1])


def _ratio_consistent(study: Study) -> float:
    pi, pi_ctc = (_joint2(study, "consistent", "i_eff_max", name) for name in ("pi", "pi_ctc"))
    return pi / pi_ctc


def _jump_before_peak(run: Run, joint: int) -> tuple[float, float]:
    """Largest change of the load within a period [N m] in the 0.1 s before the largest error,
    and how long before it was [s]."""
    error = np.abs(run.recording.speed_error[:, joint])
    peak = int(np.argmax(error))
    if peak == 0:
        return 0.0, 0.0
    start = max(peak - round(0.1 / run.design.motion.period), 0)
    changes = np.abs(np.diff(run.recording.load_torque[start : peak + 1, joint]))
    i = int(np.argmax(changes))
    return float(changes[i]), (len(changes) - i) * run.design.motion.period
