"""Suspicions about recordings: units, sides, signs, order, friction, held-out data, excitation."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from sdt_drake.io.arrays import Array
from sdt_drake.io.shown import listed
from sdt_drake.machine.identify.alternatives import Better, better_readings
from sdt_drake.machine.identify.base_parameters import rigid_columns
from sdt_drake.machine.identify.equations import Equations
from sdt_drake.machine.identify.estimation import Estimate
from sdt_drake.machine.identify.unexplained import delay_of, unexplained
from sdt_drake.machine.identify.units import Unit, torque_unit
from sdt_drake.robot.robot import Robot

_WORSE, _WORSE_BY = 1.15, 0.01  # residual of consistent links over that without; more of a torque
_FAR, _FAR_BY = 2.0, 0.05  # held-out residual over the fitted one; more of a torque
_EXPLAINED, _SIMILAR = 0.8, 0.12  # share of a squared residual; difference of similar shares
_SIGN_WIDTH = 0.05  # speed over which friction changes its sign, over the largest speed
_DRIVING, _MIN_SIGMAS = 0.1, 4.0  # friction that drives, over the torque and its standard error
_WEAK = 0.5  # standard deviation of a parameter over its prior one, if hardly excited
_MAX_CONDITION = 300.0  # condition number of sufficient excitation


def suspicious_torques(
    robot: Robot, eq: Equations, estimate: Estimate, consistent: Array, cutoff: float
) -> Iterator[str]:
    """Yield suspicions about the residuals of torques with the right meaning, as sentences.

    Args:
        robot: The robot of the file.
        eq: The equations.
        estimate: The least-squares fit.
        consistent: Torque of physically consistent links with friction [N m], shape (M, n).
        cutoff: Cut-off frequency of the compared torques [Hz].
    """
    predicted = estimate.torque(eq)
    drives, errors = _driving(eq, estimate)
    for k in np.flatnonzero(drives > np.maximum(_DRIVING, _MIN_SIGMAS * errors)).tolist():
        yield (
            f"joint {k + 1}: its friction drives instead of braking: is the sign of tau_{k + 1} or "
            f"q_{k + 1} wrong (torque_factor or direction in the mapping file)?"
        )
    delay = delay_of(eq, cutoff)
    if delay.is_significant:
        yield (
            f"torques are recorded late, or positions early, by {delay.words} (torque_delay: "
            f"{delay.common:.4f} in the mapping file)"
        )
    yield from unexplained(eq, delay)
    yield from worse_held_out(robot, eq, predicted)
    yield from inconsistent(eq, predicted, consistent)


def misread(robot: Robot, eq: Equations) -> list[str]:
    """Return suspicions about the meaning of the columns and the robot's file, as sentences."""
    unit, better = _misread(robot, eq)
    lines = [unit.text] if unit else []
    return [*lines, _better_in_words(better)] if better else lines


def _misread(robot: Robot, eq: Equations) -> tuple[Unit | None, list[Better]]:
    """Return the likely unit of the torques, and better readings of the columns.

    A unit without a name is dropped if another reading explains the torques as they are.
    """
    unit = torque_unit(robot, eq)
    as_they_are = np.ones(robot.n)
    if unit and not unit.is_exact:
        better = better_readings(robot, eq, as_they_are, unit.factor)
        if better:
            return None, better
    return unit, better_readings(robot, eq, unit.factor if unit else as_they_are)


def _better_in_words(better: Sequence[Better]) -> str:
    """Return the sentence on readings that explain the torques equally well."""
    first = better[0]
    k = int(
        np.argmax(np.log(first.before / first.after) + np.log(first.any_before / first.any_after))
    )
    readings = "; or ".join(
        one.reading.words
        + (f" ({one.reading.write} in the mapping file)" if one.reading.write else "")
        for one in better
    )
    file, any_ = (
        f"{100 * after[k]:.0f} % instead of {100 * before[k]:.0f} %"
        for before, after in (
            (first.before, first.after), (first.any_before, first.any_after))
    )  # fmt: skip
    return (
        f"torques are explained better by {readings}: tau_{k + 1} without friction is not "
        f"explained by {file} with the file's links, by {any_} with the best links"
    )


def worse_held_out(robot: Robot, eq: Equations, predicted: Array) -> Iterator[str]:
    """Yield a sentence on joints with a far larger residual in held-out data, and its likely cause.

    Causes are another friction or another payload.
    """
    left = eq.tau - predicted
    fitted, judged = (
        np.array([np.std(left[rows & eq.moves[:, k], k]) if (rows & eq.moves[:, k]).sum() > 20
                  else np.nan for k in range(eq.n)])
        for rows in (eq.fit, ~eq.fit)
    )  # fmt: skip
    size = np.maximum(np.std(eq.tau, axis=0), 1e-300)
    worse = np.flatnonzero((judged > _FAR * fitted) & (judged - fitted > _FAR_BY * size))
    if not len(worse):
        return
    rows = np.flatnonzero(~eq.fit)
    columns = rigid_columns(robot, eq.q[rows], eq.v[rows], eq.vd[rows])
    payload = columns[:, :, 10 * (eq.n - 1) : 10 * eq.n]
    v = eq.speed[rows] / np.maximum(np.abs(eq.speed).max(axis=0), 1e-12)
    own = np.stack([np.ones_like(v), v, np.tanh(v / _SIGN_WIDTH)], axis=2)
    weights = [eq.moves[rows, k] / max(judged[k], 1e-300) for k in worse]
    residual = np.concatenate([w * left[rows, k] for w, k in zip(weights, worse, strict=True)])
    by_payload = np.concatenate(
        [w[:, None] * payload[:, k] for w, k in zip(weights, worse, strict=True)]
    )
    shares = {
        "another payload": _explained(residual, by_payload),
        "another friction (temperature, wear)": float(
            np.mean([_explained(w * left[rows, k], w[:, None] * own[:, k])
                     for w, k in zip(weights, worse, strict=True)])
        ),
    }  # fmt: skip
    why = max(shares, key=lambda name: shares[name])
    causes = " or ".join(name for name in shares if shares[name] > shares[why] - _SIMILAR)
    joints = listed([f"{100 * judged[k] / size[k]:.0f} % of tau_{k + 1} "
                     f"({100 * fitted[k] / size[k]:.0f} % in fitted data)"
                     for k in worse.tolist()])  # fmt: skip
    explained = f": {causes} explains {100 * shares[why]:.0f} % of the squared residual"
    other = ": another kind of motion, drift, wear or another payload"
    yield f"held-out data: not explained are {joints}" + (
        explained if shares[why] > _EXPLAINED else other
    )


def _explained(residual: Array, columns: Array) -> float:
    """Return the share of a squared residual that columns explain."""
    found = np.linalg.lstsq(columns, residual, rcond=1e-8)[0]
    rest = residual - columns @ found
    return 1 - float(rest @ rest) / max(float(residual @ residual), 1e-300)


def standing_still(eq: Equations) -> Iterator[str]:
    """Yield sentences on joints that stand still in all, fitted or held-out data."""
    for k in range(eq.n):
        fitted, judged = (np.any(eq.moves[rows, k]) for rows in (eq.fit, ~eq.fit))
        if eq.moves[:, k].mean() < 0.05:
            yield f"joint {k + 1} stands still: its friction and motor are not identified"
        elif not judged:
            yield f"joint {k + 1} stands still in the held-out data: its torque is not validated"
        elif not fitted:
            yield (
                f"joint {k + 1} stands still in the fitted data: its friction and motor are not "
                "identified"
            )


def _driving(eq: Equations, estimate: Estimate) -> tuple[Array, Array]:
    """Return the part of each torque that is friction in the direction of motion, shape (n,).

    It is the mean power of the friction over the RMS torque and speed. Friction brakes, whatever
    tool the robot carries, so a positive value that noise cannot explain shows a wrong sign.

    Returns:
        The part, and its standard error [-].
    """
    r, drives = len(estimate.beta), np.zeros((2, eq.n))
    for k, law in enumerate(estimate.laws):
        rows, part = eq.moves[:, k] & eq.fit, estimate.friction_of(k)
        v, tau = eq.speed[rows, k], eq.tau[rows, k]
        terms = [eq.terms[k].index(term) for term in law.terms]
        power = v @ eq.friction[rows, k][:, terms] / max(np.sqrt(v @ v * (tau @ tau)), 1e-300)
        covariance = estimate.covariance[r:, r:][part, part]
        drives[:, k] = -power @ estimate.friction[part], np.sqrt(power @ covariance @ power)
    return drives[0], drives[1]


def inconsistent(eq: Equations, least: Array, consistent: Array) -> Iterator[str]:
    """Yield sentences on joints whose torque physically consistent links explain far worse.

    Args:
        eq: The equations.
        least: Torque of the least-squares fit [N m], shape (M, n).
        consistent: Torque of the consistent links [N m], shape (M, n).
    """
    size = np.std(eq.tau[eq.fit], axis=0)
    for k in range(eq.n):
        left = [np.std((eq.tau - x)[eq.fit, k]) / size[k] for x in (least, consistent)]
        if left[1] > max(_WORSE * left[0], left[0] + _WORSE_BY):
            yield (
                f"joint {k + 1}: physically consistent links do not explain {100 * left[1]:.1f} % "
                f"of its torque, free base parameters {100 * left[0]:.1f} %"
                + ": something else acts there, such as a counterbalance, a spring or a cable"
                * bool(left[1] > max(2 * left[0], 0.1))
            )


def weakly_excited(
    condition: float, before: Array, after: Array, words: Sequence[str]
) -> list[str]:
    """Return sentences on parameters that the motion hardly excites.

    Args:
        condition: Condition number of the scaled equations.
        before: Prior standard deviations of the base parameters, shape (r,).
        after: Standard deviations of the base parameters, shape (r,).
        words: Names of the base parameters.
    """
    weak = [words[i] for i in np.flatnonzero(after > _WEAK * before).tolist()]
    lines = []
    if condition > _MAX_CONDITION:
        lines.append(
            f"too little excitation: condition number {condition:.3g}, expected less than "
            f"{_MAX_CONDITION:g}"
        )
    if weak:
        names = ", ".join(text.split(" + ")[0].split(" - ")[0] for text in weak[:4])
        more = f" and {len(weak) - 4} more" if len(weak) > 4 else ""
        lines.append(
            f"{len(weak)} of {len(words)} base parameters are hardly excited and stay as in the "
            f"file: those named after {names}{more}"
        )
    return lines
