"""The frequency below which torques are compared, and where speeds come from: by what is held out.

Each cut-off c makes a prediction of the same torque y, the one below the highest cut-off F: columns
and torques below c give parameters, and these with the columns below c the prediction. With noise
of the torque that has nothing to do with that of positions, the mean square of y less the
prediction is that of the noise below F, which is the same for all c, and the error of the
prediction: what of the motion lies above c, what noise of positions brings in below it, and what of
the parameters is wrong. A lower cut-off gains nothing by comparing less. Fits are to other parts of
the time than errors are of, by cross-validation within what is for fitting: no choice sees what is
held out to judge.

By Parseval's theorem one spectrum of the columns, in Hann windows, gives the normal equations of
all cut-offs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from sdt_drake.io.arrays import Array
from sdt_drake.machine.identify.base_parameters import Unknown, rigid_columns, rigid_parameters
from sdt_drake.machine.identify.equations import slowest_and_fastest
from sdt_drake.machine.identify.estimation import Prior, solved
from sdt_drake.machine.identify.filtering import Smooth, Stretch, amplitude_left, smooth
from sdt_drake.robot.robot import Robot

CUTOFFS = (1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0, 12.0, 16.0, 20.0)
"""Cut-offs that are tried [Hz]; no higher than a tenth of the samples' rate."""

_AS_WELL = 0.07  # of an error: cut-offs that leave no more are as good as the best
_SHARE = 0.1  # of the rate of samples, the highest cut-off
_LONGEST, _WINDOWS = 10.0, 6.0  # s, of a window, and how many of them the longest stretch has
_PERIODS = 4.0  # of a cut-off, in a window
_BEYOND = 1.5  # times the highest cut-off, from where filters leave nothing
_FOLDS = 5
_ROUNDS = 4
_WIDTHS = (0.05, 0.2)  # of sigmoids, over the largest speed: friction that no law is chosen for yet


class Choice(NamedTuple):
    """A cut-off frequency [Hz], and whether recorded speeds are used."""

    cutoff: float
    speeds: bool


@dataclass(frozen=True, eq=False)
class _Spectra:
    """Columns of windows of time, of joint k [rigid, friction, torque] by frequency.

    Attributes:
        frequency: [Hz], shape (F,).
        windows: shape (windows, n, F, columns), complex.
        moves: joints that move, shape (n,).
        rigid: number of base parameters.
    """

    frequency: Array
    windows: Array
    moves: Array
    rigid: int


def chosen(
    robot: Robot,
    unknown: Unknown,
    prior: Prior,
    stretches: Sequence[Stretch],
    cutoff: float | None = None,
) -> Choice:
    """Choose the middle of the cut-offs that predict the same torque as well as the best one, and
    recorded speeds where they predict it better than differentiated positions.

    Args:
        robot: gives what is known.
        unknown: what is not.
        prior: of the base parameters.
        stretches: what is for fitting, with recorded speeds or without.
        cutoff: given, so that the speeds alone are chosen [Hz].
    """
    top = cutoff or highest(stretches)
    best, least = Choice(top, speeds=False), np.inf
    is_recorded = all(one.v is not None for one in stretches)
    if cutoff and not is_recorded:
        return best
    for speeds in (False, True)[: 1 + is_recorded]:
        used = [one if speeds else replace(one, v=None) for one in stretches]
        spectra = _spectra(robot, unknown, used, top)
        lasts = 1 / spectra.frequency[1]
        tried = [c for c in CUTOFFS if _PERIODS / lasts <= c < top and not cutoff] + [top]
        error = np.array([_error(spectra, prior, c, top) for c in tried])
        if error.min() < least:
            least = error.min()
            as_well = np.array(tried)[error <= least + np.log1p(_AS_WELL)]
            best = Choice(float(np.sqrt(as_well[0] * as_well[-1])), speeds)
    return best


def highest(stretches: Sequence[Stretch]) -> float:
    """The highest cut-off that is tried [Hz]."""
    return min(CUTOFFS[-1], _SHARE / max(one.period for one in stretches))


def _spectra(robot: Robot, unknown: Unknown, stretches: Sequence[Stretch], top: float) -> _Spectra:
    motions = [smooth(one, top) for one in stretches]
    slowest, fastest = slowest_and_fastest(motions, top)
    lasts = min(_LONGEST, max(len(m.time) * m.period for m in motions) / _WINDOWS)
    counts = [round(lasts / motion.period) for motion in motions]
    below = min(2 + int(_BEYOND * top * lasts), *(1 + count // 2 for count in counts))
    windows = []
    for motion, count in zip(motions, counts, strict=True):
        window = motion.period * np.hanning(count)[:, None]
        for start in range(0, len(motion.time) - count + 1, count // 2):
            part = slice(start, start + count)
            columns = _columns(robot, unknown, motion, part, slowest, fastest)
            windows.append(np.fft.rfft(window * columns, axis=1)[:, :below])
    moves = np.isfinite(slowest)
    return _Spectra(np.arange(below) / lasts, np.array(windows), moves, len(unknown.independent))


def _columns(
    robot: Robot, unknown: Unknown, motion: Smooth, part: slice, slowest: Array, fastest: Array
) -> Array:
    """Columns of some samples, shape (n, N, columns)."""
    v = motion.v[part]
    rigid = rigid_columns(robot, motion.q[part], v, motion.vd[part])
    is_known = np.ones(rigid.shape[2], dtype=bool)
    is_known[unknown.columns] = False
    left = motion.tau[part] - rigid[:, :, is_known] @ rigid_parameters(robot)[is_known]
    sigmoids = [np.tanh(v / width) for width in (slowest, *np.outer(_WIDTHS, fastest))]
    friction = np.stack([v, np.ones_like(v), *sigmoids], axis=2)
    every = np.concatenate([rigid[:, :, unknown.independent], friction, left[:, :, None]], axis=2)
    return every.swapaxes(0, 1)


def _error(spectra: _Spectra, prior: Prior, cutoff: float, top: float) -> float:
    """Mean over the joints of the log of the RMS that predictions below a cut-off leave of the
    torque below `top`, in windows of time that their parameters have not seen."""
    X, below = spectra.windows, spectra.frequency < 2 * cutoff
    keep = amplitude_left(spectra.frequency, cutoff)
    seen = keep[below, None] * X[:, :, below]
    grams = (seen.conj().swapaxes(2, 3) @ seen).real  # of each window and joint
    every = np.arange(len(X))
    left = np.zeros(X.shape[1])
    for fold in np.array_split(every, min(_FOLDS, len(X))):
        apart = (every < fold[0] - 1) | (every > fold[-1] + 1)  # windows overlap by a half
        size = 2 * cutoff / spectra.frequency[1] * apart.sum()
        x = _fitted(grams[apart].sum(axis=0), prior, spectra.rigid, size)
        told = keep[:, None] * np.einsum("wkfp,kp->wkf", X[fold][..., :-1], x).swapaxes(1, 2)
        wanted = amplitude_left(spectra.frequency, top)[:, None] * X[fold][..., -1].swapaxes(1, 2)
        left += np.sum(np.abs(wanted - told) ** 2, axis=(0, 1))
    shares = np.log(np.maximum(left[spectra.moves], 1e-300)) / 2
    return float(shares.sum() / max(len(shares), 1))


def _fitted(grams: Array, prior: Prior, r: int, size: float) -> Array:
    """Parameters of each joint's columns, shape (n, columns - 1): base parameters, the same for
    all, and friction; each joint is weighted by what it leaves, of `size` samples."""
    n, f = len(grams), grams.shape[1] - 1 - r
    places = [np.r_[:r, r + k * f : r + (k + 1) * f] for k in range(n)]
    left = grams[:, -1, -1]
    for _ in range(_ROUNDS):
        H, h = np.zeros((r + n * f,) * 2), np.zeros(r + n * f)
        H[:r, :r], h[:r] = prior.precision, prior.precision @ prior.mean
        for k, at in enumerate(places):
            weighted = size / max(left[k], 1e-300) * grams[k]
            H[np.ix_(at, at)] += weighted[:-1, :-1]
            h[at] += weighted[:-1, -1]
        x = solved(H, h)[places]
        z = np.column_stack([x, -np.ones(n)])
        left = np.einsum("kp,kpq,kq->k", z, grams, z)
    return np.asarray(x)
