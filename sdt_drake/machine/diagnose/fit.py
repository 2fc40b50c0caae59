"""Findings of a fit on its recordings: signs, friction, held-out data, excitation."""

from collections.abc import Iterator, Sequence

import numpy as np

from sdt_drake.io.arrays import Array
from sdt_drake.io.shown import listed
from sdt_drake.machine.diagnose import constants as c
from sdt_drake.machine.diagnose.explained import like_friction, over_largest, share_explained
from sdt_drake.machine.diagnose.finding import Finding, finding
from sdt_drake.machine.diagnose.residual import left_over
from sdt_drake.machine.identify.base_parameters import rigid_columns
from sdt_drake.machine.identify.equations import Equations
from sdt_drake.machine.identify.estimation import Estimate
from sdt_drake.robot.robot import Robot


def suspicious_torques(
    robot: Robot, eq: Equations, estimate: Estimate, consistent: Array, cutoff: float
) -> list[Finding]:
    """Return what the residuals of torques with the right meaning show.

    Args:
        robot: The robot of the file.
        eq: The equations.
        estimate: The least-squares fit.
        consistent: Torque of physically consistent links with friction [N m], shape (M, n).
        cutoff: Cut-off frequency of the compared torques [Hz].
    """
    predicted = estimate.torque(eq)
    links = rigid_columns(robot, eq.q, eq.v, eq.vd) if np.any(eq.known) else None
    return [
        *driving(eq, estimate),
        *faint(robot, eq, estimate),
        *left_over(eq, cutoff, predicted, links),
        *worse_held_out(robot, eq, predicted),
        *inconsistent(eq, predicted, consistent),
    ]


def worse_held_out(robot: Robot, eq: Equations, predicted: Array) -> Iterator[Finding]:
    """Yield the joints with a far larger residual in held-out data, and its likely cause.

    Causes are another friction or another payload.
    """
    left = eq.tau - predicted
    fitted, held_out = (
        np.array([np.std(left[rows & moves, k]) if (rows & moves).sum() > 20 else np.nan
                  for k, moves in enumerate(eq.moves.T)])
        for rows in (eq.fit, ~eq.fit)
    )  # fmt: skip
    size = np.maximum(np.std(eq.tau, axis=0), 1e-300)
    is_worse = (held_out > c.FAR * fitted) & (held_out - fitted > c.FAR_BY * size)
    worse = np.flatnonzero(is_worse).tolist()
    if not worse:
        return
    rows = np.flatnonzero(~eq.fit)
    rigid = rigid_columns(robot, eq.q[rows], eq.v[rows], eq.vd[rows])
    payload = rigid[:, :, 10 * (eq.n - 1) : 10 * eq.n]
    v, weight = over_largest(eq.speed)[rows], eq.moves[rows] / np.maximum(held_out, 1e-300)
    residual = weight * left[rows]
    of_friction = [
        share_explained(residual[:, k], weight[:, [k]] * like_friction(v[:, k], [c.SIGN_WIDTH]))
        for k in worse
    ]
    of_payload = np.concatenate([weight[:, [k]] * payload[:, k] for k in worse])
    shares = {
        "another payload": share_explained(residual[:, worse].T.ravel(), of_payload),
        "another friction (temperature, wear)": float(np.mean(of_friction)),
    }
    most = max(shares.values())
    cause = "another kind of motion, drift, wear or another payload"
    if most > c.HELD_OUT_EXPLAINED:
        cause = " or ".join(name for name, x in shares.items() if x > most - c.AS_LIKELY)
        cause += f" explains {100 * most:.0f} % of the squared residual"
    joints = listed([f"{100 * held_out[k] / size[k]:.0f} % of tau_{k + 1} "
                     f"({100 * fitted[k] / size[k]:.0f} % in fitted data)"
                     for k in worse])  # fmt: skip
    evidence = dict(zip(("payload", "friction"), shares.values(), strict=True))
    evidence |= {f"held_out_{k + 1}": float(held_out[k] / size[k]) for k in worse}
    evidence |= {f"fitted_{k + 1}": float(fitted[k] / size[k]) for k in worse}
    yield finding("held out", [k + 1 for k in worse], left=joints, cause=cause, **evidence)


def standing_still(eq: Equations) -> Iterator[Finding]:
    """Yield joints that stand still in all, fitted or held-out data."""
    for k, moves in enumerate(eq.moves.T):
        share = float(moves.mean())
        if share < c.MOVES_SHARE:
            yield finding("still", (k + 1,), moving=share)
        elif not np.any(moves[~eq.fit]):
            yield finding("still/held out", (k + 1,), moving=share)
        elif not np.any(moves[eq.fit]):
            yield finding("still/fitted", (k + 1,), moving=share)


def driving(eq: Equations, estimate: Estimate) -> Iterator[Finding]:
    """Yield joints whose friction drives.

    The measure is the mean power of the friction over the RMS torque and speed. Friction brakes,
    whatever tool the robot carries, so a positive value that noise cannot explain shows a wrong
    sign.
    """
    r = len(estimate.beta)
    for k, law in enumerate(estimate.laws):
        rows, part = eq.moves[:, k] & eq.fit, estimate.friction_of(k)
        v, tau = eq.speed[rows, k], eq.tau[rows, k]
        terms = [eq.terms[k].index(term) for term in law.terms]
        power = v @ eq.friction[rows, k][:, terms] / max(np.sqrt(v @ v * (tau @ tau)), 1e-300)
        drives = -float(power @ estimate.friction[part])
        error = float(np.sqrt(power @ estimate.covariance[r:, r:][part, part] @ power))
        if drives > max(c.DRIVING, c.DRIVING_SIGMAS * error):
            remedy = "torque_factor or direction"
            yield finding("driving", (k + 1,), remedy, power=drives, error=error)


def faint(robot: Robot, eq: Equations, estimate: Estimate) -> Iterator[Finding]:
    """Yield joints whose friction is far less of the motor's limit than that of all others.

    Joints of one robot have similar gears. A torque in another unit shows by its friction where the
    links tell nothing.
    """
    rubs = estimate.friction_torque(eq, estimate.friction) * eq.moves
    size = np.sqrt(np.mean(rubs**2, axis=0)) / robot.effort_limit
    for k in np.flatnonzero(eq.moves.any(axis=0)).tolist():
        others = float(np.delete(size, k).min(initial=np.inf))
        if c.RUBS < others < np.inf and size[k] < c.FAINT * others:
            yield finding("unit/friction", (k + 1,), share=float(size[k]), others=others)


def inconsistent(eq: Equations, least: Array, consistent: Array) -> Iterator[Finding]:
    """Yield joints whose torque physically consistent links explain far worse.

    Args:
        eq: The equations.
        least: Torque of the least-squares fit [N m], shape (M, n).
        consistent: Torque of the consistent links [N m], shape (M, n).
    """
    size = np.std(eq.tau[eq.fit], axis=0)
    free, linked = (np.std((eq.tau - x)[eq.fit], axis=0) / size for x in (least, consistent))
    for k in range(eq.n):
        if linked[k] > max(c.WORSE * free[k], free[k] + c.WORSE_BY):
            cause = ": something else acts there, such as a counterbalance, a spring or a cable"
            cause *= bool(linked[k] > max(c.ELSE * free[k], c.ELSE_BY))
            left = {"consistent": float(linked[k]), "free": float(free[k])}
            yield finding("inconsistent", (k + 1,), cause=cause, **left)


def weakly_excited(
    condition: float, before: Array, after: Array, words: Sequence[str]
) -> Iterator[Finding]:
    """Yield what the motion hardly excites.

    Args:
        condition: Condition number of the scaled equations.
        before: Prior standard deviations of the base parameters, shape (r,).
        after: Standard deviations of the base parameters, shape (r,).
        words: Names of the base parameters.
    """
    if condition > c.MAX_CONDITION:
        yield finding("excitation/condition", condition=condition, expected=c.MAX_CONDITION)
    weak = [words[i] for i in np.flatnonzero(after > c.WEAK * before).tolist()]
    if weak:
        names = ", ".join(text.split(" + ")[0].split(" - ")[0] for text in weak[:4])
        more = f" and {len(weak) - 4} more" if len(weak) > 4 else ""
        yield finding("excitation", parameters=len(weak), of=len(words), names=names + more)
