"""What looks wrong in recordings: units, sides, signs, order, saturation, play, too little
motion."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from sdt_drake.io.arrays import Array
from sdt_drake.io.shown import listed
from sdt_drake.machine.identify.alternatives import Better, better_readings
from sdt_drake.machine.identify.base_parameters import rigid_columns
from sdt_drake.machine.identify.equations import Equations
from sdt_drake.machine.identify.unexplained import delay_of, unexplained
from sdt_drake.machine.identify.units import Unit, torque_unit
from sdt_drake.robot.robot import Robot

_WORSE, _FEW = 1.15, 0.01  # times what base parameters leave, and of the torque: worth a word
_FAR, _BY = 2.0, 0.05  # times what is left where it was fitted; more of a torque
_MOST, _AS_WELL = 0.8, 0.12  # of the square of what is left
_SLOW = 0.05  # of the largest speed, over which friction changes its sign
_FELT = 0.1  # of a torque, that is friction
_SURE = 0.5  # of what was believed before: less is no news
_WEAK = 300.0  # condition number


def suspicious_torques(
    robot: Robot,
    eq: Equations,
    predicted: Array,
    consistent: Array,
    friction: Array,
    cutoff: float,
) -> Iterator[str]:
    """What a fit leaves of torques that are not misread, in sentences.

    Args:
        robot: of the file.
        eq: the equations.
        predicted: torque after the fit [N m], shape (M, n).
        consistent: likewise, of links that can be.
        friction: what of `predicted` is friction, shape (M, n).
        cutoff: below which torques are compared [Hz].
    """
    drives = _driving(eq, friction)
    for k in range(robot.n):
        if drives[k] < -_FELT:
            yield (
                f"tau_{k + 1} drives as no friction does: sign of tau_{k + 1} or of q_{k + 1} "
                "(torque_factor or direction in the mapping file)?"
            )
    delay = delay_of(eq, cutoff)
    if delay.is_told:
        yield (
            f"torques are recorded late, or positions early, by {delay.words} (torque_delay: "
            f"{delay.common:.4f} in the mapping file)"
        )
    yield from unexplained(eq, delay)
    yield from worse_held_out(robot, eq, predicted)
    yield from inconsistent(eq, predicted, consistent)


def misread(robot: Robot, eq: Equations) -> list[str]:
    """What the torques say against the mapping and the robot's file, in sentences."""
    unit, better = _misread(robot, eq)
    said = [unit.text] if unit else []
    return [*said, _better_in_words(better)] if better else said


def _misread(robot: Robot, eq: Equations) -> tuple[Unit | None, list[Better]]:
    """The unit of the torques, and other readings of the columns that explain them better; a unit
    without a name is none, where columns in another order make torques as they are."""
    unit = torque_unit(robot, eq)
    as_they_are = np.ones(robot.n)
    if unit and not unit.is_exact:
        better = better_readings(robot, eq, as_they_are, by_file=False)
        if better:
            return None, better
    return unit, better_readings(robot, eq, unit.factor if unit else as_they_are)


def _better_in_words(better: Sequence[Better]) -> str:
    """The sentence on readings that explain the torques equally well."""
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
        f"{100 * before[k]:.0f} to {100 * after[k]:.0f} %"
        for before, after in (
            (first.before, first.after), (first.any_before, first.any_after))
    )  # fmt: skip
    return (
        f"torques are explained by {readings}: of tau_{k + 1}, friction apart, links of the file "
        f"leave {file}, any links {any_}"
    )


def worse_held_out(robot: Robot, eq: Equations, predicted: Array) -> Iterator[str]:
    """Joints of which far more is left where the fit has seen nothing, and what would explain it:
    another friction, or another payload."""
    left = eq.tau - predicted
    fitted, judged = (
        np.array([np.std(left[rows & eq.moves[:, k], k]) if (rows & eq.moves[:, k]).sum() > 20
                  else np.nan for k in range(eq.n)])
        for rows in (eq.fit, ~eq.fit)
    )  # fmt: skip
    size = np.maximum(np.std(eq.tau, axis=0), 1e-300)
    worse = np.flatnonzero((judged > _FAR * fitted) & (judged - fitted > _BY * size))
    if not len(worse):
        return
    rows = np.flatnonzero(~eq.fit)
    columns = rigid_columns(robot, eq.q[rows], eq.v[rows], eq.vd[rows])
    payload = columns[:, :, 10 * (eq.n - 1) : 10 * eq.n]
    v = eq.v[rows] / np.maximum(np.abs(eq.v).max(axis=0), 1e-12)
    own = np.stack([np.ones_like(v), v, np.tanh(v / _SLOW)], axis=2)
    weights = [eq.moves[rows, k] / max(judged[k], 1e-300) for k in worse]
    wanted = np.concatenate([w * left[rows, k] for w, k in zip(weights, worse, strict=True)])
    by_payload = np.concatenate(
        [w[:, None] * payload[:, k] for w, k in zip(weights, worse, strict=True)]
    )
    shares = {
        "another payload there": _explained(wanted, by_payload),
        "another friction there, as of another temperature, or wear": float(
            np.mean([_explained(w * left[rows, k], w[:, None] * own[:, k])
                     for w, k in zip(weights, worse, strict=True)])
        ),
    }  # fmt: skip
    why = max(shares, key=lambda name: shares[name])
    told = " or ".join(name for name in shares if shares[name] > shares[why] - _AS_WELL)
    joints = listed([f"{100 * judged[k] / size[k]:.0f} % of tau_{k + 1} is left, "
                     f"{100 * fitted[k] / size[k]:.0f} % where it was fitted"
                     for k in worse.tolist()])  # fmt: skip
    explained = f": {told} explains {100 * shares[why]:.0f} % of it (of its square)"
    other = ": another motion than was fitted, drift, wear or another payload"
    yield f"held out {joints}" + (explained if shares[why] > _MOST else other)


def _explained(wanted: Array, columns: Array) -> float:
    """Share of a square that columns explain."""
    found = np.linalg.lstsq(columns, wanted, rcond=1e-8)[0]
    rest = wanted - columns @ found
    return 1 - float(rest @ rest) / max(float(wanted @ wanted), 1e-300)


def standing_still(eq: Equations) -> Iterator[str]:
    """Joints that stand still, or do where others are fitted or judged by."""
    still = [k for k in range(eq.n) if eq.moves[:, k].mean() < 0.05]
    for k in still:
        yield f"joint {k + 1} stands still: nothing is said of its friction and its motor"
    for k in range(eq.n):
        fitted, judged = (np.any(eq.moves[rows, k]) for rows in (eq.fit, ~eq.fit))
        if k not in still and not judged:
            yield f"joint {k + 1} stands still in all that is held out: nothing judges its torque"
        elif k not in still and not fitted:
            yield (
                f"joint {k + 1} stands still but in what is held out: nothing is said of its "
                "friction and its motor"
            )


def _driving(eq: Equations, friction: Array) -> Array:
    """How much of each torque is friction that brakes, below 0 that drives, shape (n,): a tool that
    the file does not have may turn its torque round, but friction has one sign."""
    rows = eq.moves & eq.fit[:, None]
    size = np.sqrt(np.sum(rows * eq.v**2, axis=0) * np.sum(rows * eq.tau**2, axis=0))
    return np.asarray(np.sum(rows * friction * eq.v, axis=0) / np.maximum(size, 1e-300))


def inconsistent(eq: Equations, least: Array, consistent: Array) -> Iterator[str]:
    """Joints of which links that can be explain less than the base parameters, free of bodies."""
    size = np.std(eq.tau[eq.fit], axis=0)
    for k in range(eq.n):
        left = [np.std((eq.tau - x)[eq.fit, k]) / size[k] for x in (least, consistent)]
        if left[1] > max(_WORSE * left[0], left[0] + _FEW):
            yield (
                f"joint {k + 1}: links that can be leave {100 * left[1]:.1f} % of its torque, "
                f"base parameters that no body need have {100 * left[0]:.1f} %"
                + ": something else acts there, such as a counterbalance, a spring or a cable"
                * bool(left[1] > max(2 * left[0], 0.1))
            )


def weakly_excited(
    condition: float, before: Array, after: Array, words: Sequence[str]
) -> list[str]:
    """What a motion says too little of.

    Args:
        condition: of the scaled equations.
        before, after: standard deviations of the base parameters, shape (r,).
        words: what these are.
    """
    weak = [words[i] for i in np.flatnonzero(after > _SURE * before).tolist()]
    said = []
    if condition > _WEAK:
        said.append(
            f"too little excitation: condition number {condition:.3g}, expected below {_WEAK:g}"
        )
    if weak:
        names = ", ".join(text.split(" + ")[0].split(" - ")[0] for text in weak[:4])
        more = f" and {len(weak) - 4} more" if len(weak) > 4 else ""
        said.append(
            f"{len(weak)} of {len(words)} base parameters are hardly excited, and stay as in the "
            f"file: those named after {names}{more}"
        )
    return said
