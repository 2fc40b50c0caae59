"""From recordings to a robot: cut-off frequency, friction, base parameters, links that can be."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError, retelling
from sdt_drake.io.shown import Shown, Summary, of_joints
from sdt_drake.machine.identify.base_parameters import Unknown, rigid_parameters
from sdt_drake.machine.identify.consistency import (
    Consistent,
    links_of,
    nearest_consistent,
    rigid_scale,
)
from sdt_drake.machine.identify.cutoff import CUTOFFS, Choice, chosen
from sdt_drake.machine.identify.equations import Equations, equations
from sdt_drake.machine.identify.estimation import Estimate, Prior, estimate
from sdt_drake.machine.identify.filtering import FEWEST, HIGHEST, Stretch, spread, stretches
from sdt_drake.machine.identify.suspicions import (
    misread,
    standing_still,
    suspicious_torques,
    weakly_excited,
)
from sdt_drake.machine.recordings import Recorded, check_different, check_recording
from sdt_drake.robot.robot import Robot

HELD_OUT = 1 / 3
"""Of each recording, its end, if none are named to validate."""

MOST_ROWS = 20_000
"""Of equations, about: a row takes the memory of a thousand numbers. Of longer recordings parts are
compared."""

_ALIKE, _NEARLY_ALL = 0.15, 0.9  # of the usual size of a state, and the share of states
_ROWS = 4.0  # in a period of the cut-off
_BELIEF = 1.0  # standard deviation of a parameter over its scale, before anything is measured

Parts = list[tuple[int, float, Stretch]]


@dataclass(frozen=True, eq=False, repr=False)
class Identified(Shown):
    """What recordings say of a robot.

    Attributes:
        nominal: the robot of the file.
        unknown: what was to be found.
        recordings: what it was found from, then what it was judged by.
        equations: all rows, of fitting and of judging.
        estimate: base parameters and friction.
        consistent: links and motors that can be.
        friction: parameters of friction beside these, as in `estimate`, shape (f,).
        predicted: torque of the consistent robot with friction, joint side [N m], shape (M, n).
        cutoff: below which torques were compared [Hz].
        speeds: whether recorded speeds were used.
        notes: what was done to the recordings, in words.
        warnings: what is suspicious, in words.
    """

    nominal: Robot
    unknown: Unknown
    recordings: tuple[Recorded, ...]
    equations: Equations
    estimate: Estimate
    consistent: Consistent
    friction: Array
    predicted: Array
    cutoff: float
    speeds: bool
    notes: tuple[str, ...]
    warnings: tuple[str, ...]

    def summary(self) -> Summary:
        left = {"left by the file [%]": self.equations.nominal, "identified [%]": self.predicted}
        columns = {name: (".2f", 100 * self.left(tau, held_out=True)) for name, tau in left.items()}
        files = ", ".join(recorded.path.name for recorded in self.recordings)
        title = f"{self.nominal.name} from {files}: left of torques, held out"
        return of_joints(title, columns, self.nominal.joint_names)

    def left(self, predicted: Array, *, held_out: bool) -> Array:
        """RMS of what a prediction leaves, over the RMS of the measured torque, shape (n,).

        Where a joint rests, friction may be anything: that does not count.
        """
        eq = self.equations
        rows = (eq.fit != held_out)[:, None] & eq.moves
        error = np.sum(rows * (eq.tau - predicted) ** 2, axis=0)
        with np.errstate(invalid="ignore"):  # a joint that never moves
            return np.asarray(np.sqrt(error / np.sum(rows * eq.tau**2, axis=0)))


def identify(
    robot: Robot,
    recordings: Sequence[Recorded],
    *,
    validate: Sequence[Recorded] = (),
    only: str | None = None,
    payload: str = "payload",
    cutoff: float | None = None,
    held_out: float = HELD_OUT,
) -> Identified:
    """Identify a robot from recordings.

    Args:
        robot: where to start from; gives the kinematics, and what is not to be found.
        recordings: with q and tau.
        validate: recordings to judge by; by default the last third of each of the others.
        only: "payload" or "friction" to take everything else as it is in the file.
        payload: the link that is meant by it.
        cutoff: below which torques are compared [Hz]; by default `cutoff.chosen`.
        held_out: share of each recording, at its end, to judge by where nothing is to validate.

    Raises:
        InputError: for recordings that say nothing: too short, no torque, nothing moves; for one
            that is there twice, a payload that is no link, a cut-off that samples know nothing of.
    """
    path = recordings[0].path
    check_different([*recordings, *validate])
    parts, notes = parts_of(recordings, validate, held_out)
    unknown, free = _unknown(robot, only, payload)
    prior = belief(robot, unknown)
    _check_cutoff(cutoff, parts)
    cutoff, speeds = _choice(robot, unknown, prior, parts, cutoff)
    few = few_of(parts, cutoff)
    if not speeds:
        few = [(source, end, replace(stretch, v=None)) for source, end, stretch in few]
    eq = equations(robot, unknown, few, cutoff)
    _check_rows(eq, cutoff, path)
    found = estimate(eq, prior)
    r, S, N = len(found.beta), found.covariance, found.misfit
    checked = [(x, one) for x in (*recordings, *validate) for one in check_recording(robot, x)]
    spoilt = any(one.spoils for _, one in checked)
    wrong = [] if spoilt else misread(robot, eq)
    warnings = [*(f"{x.path.name}: {one}" for x, one in checked), *standing_still(eq), *wrong]
    with retelling(lambda problem: problem._replace(found="; ".join([problem.found, *wrong]))):
        consistent = nearest_consistent(robot, unknown, free, found.beta, N[:r, :r], S[:r, :r])
    change = consistent.beta - found.beta
    # What friction has to do with the base parameters, it follows them.
    friction = found.friction + N[r:, :r] @ np.linalg.solve(N[:r, :r], change)
    predicted = eq.known + np.einsum("mkr,r->mk", eq.rigid, consistent.beta)
    predicted = predicted + found.friction_torque(eq, friction)
    before, after = (np.sqrt(np.diagonal(x)) for x in (np.linalg.inv(prior.precision), S[:r, :r]))
    least, rubs = found.torque(eq), found.friction_torque(eq, found.friction)
    if not spoilt and not wrong:
        warnings += suspicious_torques(robot, eq, least, predicted, rubs, cutoff)
    warnings += weakly_excited(found.condition, before, after, unknown.base.words)
    return Identified(
        nominal=robot,
        unknown=unknown,
        recordings=(*recordings, *validate),
        equations=eq,
        estimate=found,
        consistent=consistent,
        friction=friction,
        predicted=predicted,
        cutoff=cutoff,
        speeds=speeds,
        notes=(*notes, *_left_out(parts, few), *_speeds_in_words(parts, speeds), *_repeated(eq)),
        warnings=tuple(warnings),
    )


def parts_of(
    recordings: Sequence[Recorded], validate: Sequence[Recorded], held_out: float
) -> tuple[Parts, list[str]]:
    """The stretches of recordings, each with where what is held out begins, and what was done."""
    parts: Parts = []
    notes = []
    for number, recorded in enumerate((*recordings, *validate)):
        _check_alive(recorded)
        found, said = stretches(recorded)
        notes += [f"{recorded.path.name}: {line}" for line in (*recorded.notes, *said)]
        held_from = -np.inf if number >= len(recordings) else np.inf
        if not validate:
            start, end = found[0].start, found[-1].end
            held_from = end - held_out * (end - start)
        parts += [(number, held_from, stretch) for stretch in found]
    return parts, notes


def _choice(
    robot: Robot, unknown: Unknown, prior: Prior, parts: Parts, cutoff: float | None
) -> Choice:
    """The cut-off, unless one is given, and whether speeds are the recorded ones: by what is for
    fitting alone."""
    fitted = [(source, end, stretch.before(end)) for source, end, stretch in parts]
    fitted = [part for part in fitted if len(part[2].q) > FEWEST]
    if not fitted:
        return Choice(cutoff or CUTOFFS[0], speeds=False)
    return chosen(robot, unknown, prior, [one for *_, one in few_of(fitted, CUTOFFS[-1])], cutoff)


def few_of(parts: Parts, cutoff: float) -> Parts:
    """As much of long recordings as takes about MOST_ROWS, each its share."""
    sources = sorted({source for source, *_ in parts})
    seconds = MOST_ROWS / (_ROWS * cutoff) / len(sources)
    few: Parts = []
    for source in sources:
        own = [(held_from, stretch) for other, held_from, stretch in parts if other == source]
        windows = spread([stretch for _, stretch in own], seconds, cutoff)
        few += [(source, own[0][0], window) for window in windows]
    return few


def _left_out(parts: Parts, few: Parts) -> Iterator[str]:
    """The sentence on what `few_of` leaves out."""
    lasts, whole = (sum(x.end - x.start for *_, x in every) for every in (few, parts))
    if lasts < whole:
        told = f"{lasts:.3g} s of {whole:.3g} s, in {len(few)} parts evenly over it"
        yield f"long: compared are {told}"


def _speeds_in_words(parts: Parts, used: bool) -> Iterator[str]:
    """The sentence on where speeds come from, if some were recorded."""
    if all(stretch.v is not None for *_, stretch in parts):
        one, other = ("recorded", "differentiated")[:: 1 if used else -1]
        yield f"speeds are the {one} ones: torques are predicted better with them than the {other}"


def _repeated(eq: Equations) -> Iterator[str]:
    """The sentence on a motion that is held out, where the fit has seen it all."""
    sizes = [np.maximum(x.std(axis=0), 1e-9) for x in (eq.q, eq.v, eq.vd)]  # a joint may stand
    states = np.hstack([x / size for x, size in zip((eq.q, eq.v, eq.vd), sizes, strict=True)])
    away, _ = cKDTree(states[eq.fit]).query(states[~eq.fit])
    if np.mean(away < _ALIKE * np.sqrt(states.shape[1])) > _NEARLY_ALL:
        yield (
            "what is held out repeats the motion that was fitted: it judges noise, and no other "
            "motion (--validate names a recording of one)"
        )


def _check_alive(recorded: Recorded) -> None:
    """Refuse a recording in which there is nothing to be seen."""
    q, tau = recorded.signals["q"], recorded.signals["tau"]
    dead = np.flatnonzero(np.ptp(tau, axis=0) == 0)
    if len(dead):
        what = "zero" if not tau[0, dead[0]] else f"{tau[0, dead[0]]:g} N m"
        raise InputError(f"{recorded.path}: tau_{dead[0] + 1} is {what} all the time")
    if np.all(np.ptp(q, axis=0) < 1e-6):
        raise InputError(f"{recorded.path}: no joint moves")


def _check_cutoff(cutoff: float | None, parts: Parts) -> None:
    """Refuse a frequency that filters would leave as it is."""
    most = HIGHEST / max(stretch.period for *_, stretch in parts)
    if cutoff is not None and cutoff >= most:
        raise InputError(
            f"--cutoff: {cutoff:g} Hz, expected less than {most:.4g} Hz, {HIGHEST:g} "
            "of the samples' rate"
        )


def _check_rows(eq: Equations, cutoff: float, path: Path) -> None:
    """Refuse recordings of which nothing is left to fit, or to judge by."""
    for rows, what in ((eq.fit, "to fit"), (~eq.fit, "to judge by")):
        if not rows.any():
            raise InputError(
                f"{path}: compared below {cutoff:.3g} Hz nothing is left {what}, expected a "
                "longer recording, another --held-out or a higher --cutoff"
            )
    if not eq.moves.any():
        raise InputError(f"{path}: no joint moves, but for noise")


def _unknown(robot: Robot, only: str | None, payload: str) -> tuple[Unknown, list[str]]:
    """What is to be found, and the links that may change."""
    if only == "friction":
        return Unknown.nothing(), []
    if only == "payload":
        return Unknown.body(robot, payload), [payload]
    return Unknown.everything(robot), [link.name for link in links_of(robot)]


def belief(robot: Robot, unknown: Unknown) -> Prior:
    """Prior of the base parameters: those of the file, good to the scale of what they are made
    of."""
    whole = _BELIEF * rigid_scale(robot)
    K = unknown.base.combination
    covariance = (K * whole[unknown.columns] ** 2) @ K.T
    mean = K @ rigid_parameters(robot)[unknown.columns]
    return Prior(mean, np.asarray(np.linalg.inv(covariance), dtype=np.float64))
