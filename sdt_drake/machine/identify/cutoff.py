"""Choice of the cut-off frequency of the compared torques, and of the source of speeds.

Every cut-off c predicts the same torque y, which contains all frequencies up to the highest cut-off
F. Columns and torques below c give parameters. The parameters and the columns below c give the
prediction. The mean square of the difference has two parts, if the noise of torques and positions
is independent. One is the noise of y, which is the same for all c. The other is the error of the
prediction: motion above c, noise of positions below c, and wrong parameters. So a lower cut-off
has no advantage from comparing less. Parameters are fitted to other windows of time than those that
are predicted (cross-validation). Held-out data take no part.

By Parseval's theorem, one spectrum of the columns in Hann windows gives the normal equations of all
cut-offs.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from sdt_drake.io.arrays import Array
from sdt_drake.machine.identify.base_parameters import Unknown, rigid_columns, rigid_parameters
from sdt_drake.machine.identify.equations import slowest_and_fastest
from sdt_drake.machine.identify.estimation import Prior, solved
from sdt_drake.machine.identify.filtering import Smooth, Stretch, amplitude_left, smooth
from sdt_drake.robot.robot import Robot

CUTOFFS = (1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0, 12.0, 16.0, 20.0)
"""Cut-offs that are tried [Hz], up to a tenth of the sample rate."""

_TOLERANCE = 0.07  # relative error within which cut-offs are as good as the best
_MAX_SHARE = 0.1  # highest cut-off over the sample rate
_MAX_WINDOW, _WINDOWS = 10.0, 6.0  # length of a window [s]; windows in the longest stretch
_PERIODS = 4.0  # least periods of a cut-off in a window
_STOP_BAND = 1.5  # frequency above which filters leave nothing, over the highest cut-off
_FOLDS = 5  # cross-validation
_ROUNDS = 4  # iterations of the weights
_WIDTHS = (0.05, 0.2)  # widths of sigmoids over the largest speed, in place of a friction law


class _Spectra(NamedTuple):
    """Spectra of the columns [rigid, friction, torque] of each joint in windows of time."""

    frequency: Array
    """Frequencies [Hz], shape (F,)."""
    windows: Array
    """Complex spectra, shape (windows, n, F, columns)."""
    moves: Array
    """Mask of the joints that move, shape (n,)."""
    rigid: int
    """Number of base parameters."""


def chosen(
    robot: Robot,
    unknown: Unknown,
    prior: Prior,
    stretches: Sequence[Stretch],
    cutoff: float | None = None,
) -> tuple[float, bool]:
    """Choose the cut-off frequency and the source of speeds with the smallest prediction error.

    The choice is the geometric middle of the cut-offs that are as good as the best one. Recorded
    speeds are used where they predict torques better than differentiated positions do.

    Args:
        robot: The robot with its known parameters.
        unknown: The parameters to identify.
        prior: Prior of the base parameters.
        stretches: Fitted stretches, with or without recorded speeds.
        cutoff: A fixed cut-off [Hz]; then only the source of speeds is chosen.

    Returns:
        The cut-off [Hz], and True if recorded speeds are used, False if positions are
        differentiated.
    """
    top = cutoff or highest(stretches)
    best, least = (top, False), np.inf
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
            good = np.array(tried)[error <= least + np.log1p(_TOLERANCE)]
            best = float(np.sqrt(good[0] * good[-1])), speeds
    return best


def highest(stretches: Sequence[Stretch]) -> float:
    """Return the highest cut-off that is tried [Hz]."""
    return min(CUTOFFS[-1], _MAX_SHARE / max(one.period for one in stretches))


def _spectra(robot: Robot, unknown: Unknown, stretches: Sequence[Stretch], top: float) -> _Spectra:
    """Return the spectra of stretches, for cut-offs up to `top` [Hz]."""
    motions = [smooth(one, top) for one in stretches]
    slowest, fastest = slowest_and_fastest(robot, motions, top)
    lasts = min(_MAX_WINDOW, max(len(m.time) * m.period for m in motions) / _WINDOWS)
    counts = [round(lasts / motion.period) for motion in motions]
    below = min(2 + int(_STOP_BAND * top * lasts), *(1 + count // 2 for count in counts))
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
    """Return the columns [rigid, friction, torque] of some samples, shape (n, N, columns)."""
    rigid = rigid_columns(robot, motion.q[part], motion.v[part], motion.vd[part])
    v, tau = robot.gear_speed(motion.v[part]), robot.gear_torque(motion.tau[part])
    is_known = np.ones(rigid.shape[2], dtype=bool)
    is_known[unknown.columns] = False
    left = tau - rigid[:, :, is_known] @ rigid_parameters(robot)[is_known]
    sigmoids = [np.tanh(v / width) for width in (slowest, *np.outer(_WIDTHS, fastest))]
    friction = np.stack([v, np.ones_like(v), *sigmoids], axis=2)
    every = np.concatenate([rigid[:, :, unknown.independent], friction, left[:, :, None]], axis=2)
    return every.swapaxes(0, 1)


def _error(spectra: _Spectra, prior: Prior, cutoff: float, top: float) -> float:
    """Return the logarithm of the RMS prediction error of the torque below `top`.

    It is the mean over the joints, in windows that the parameters were not fitted to.
    """
    X, below = spectra.windows, spectra.frequency < 2 * cutoff
    keep = amplitude_left(spectra.frequency, cutoff)
    seen = keep[below, None] * X[:, :, below]
    grams = (seen.conj().swapaxes(2, 3) @ seen).real  # each window and joint
    every = np.arange(len(X))
    left = np.zeros(X.shape[1])
    for fold in np.array_split(every, min(_FOLDS, len(X))):
        apart = (every < fold[0] - 1) | (every > fold[-1] + 1)  # windows overlap by a half
        size = 2 * cutoff / spectra.frequency[1] * apart.sum()
        x = _fitted(grams[apart].sum(axis=0), prior, spectra.rigid, size)
        predicted = keep[:, None] * np.einsum("wkfp,kp->wkf", X[fold][..., :-1], x).swapaxes(1, 2)
        y = amplitude_left(spectra.frequency, top)[:, None] * X[fold][..., -1].swapaxes(1, 2)
        left += np.sum(np.abs(y - predicted) ** 2, axis=(0, 1))
    shares = np.log(np.maximum(left[spectra.moves], 1e-300)) / 2
    return float(shares.sum() / max(len(shares), 1))


def _fitted(grams: Array, prior: Prior, r: int, size: float) -> Array:
    """Fit base parameters and friction; return those of each joint, shape (n, columns - 1).

    Joints are weighted by their residuals. `size` is the number of independent samples.
    """
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
