"""Weighted, robust least squares of all joints at once, with the covariance of the result.

Each joint is weighted by its own residual, and outliers count less (Huber, "Robust estimation of a
location parameter", Annals of Mathematical Statistics 35(1), 1964). Filtered residuals are
correlated in time, so the covariance is

    (X' W X)^-1 X' W Gamma W X (X' W X)^-1

Gamma is the covariance of residuals with the power spectrum that they have in the recording.
Janot, Vandanjon and Gautier whiten instead ("A generic instrumental variable approach for
industrial robot identification", IEEE Trans. Control Systems Technology 22(1), 2014).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sdt_drake.io.arrays import Array, Index
from sdt_drake.machine.identify.equations import Equations
from sdt_drake.machine.identify.friction import USUAL, FrictionLaw

_HUBER = 2.5  # standard deviations up to which residuals count fully
_ROUNDS = 8  # iterations of the weights
_ROUND_OFF = 1e-14  # relative to the largest eigenvalue
_FOLDS = 5  # cross-validation
_PASSES = 2  # over the joints, to choose friction laws
_MAX_RATIO = 0.98
"""Largest error of a friction law over that of a law with fewer parameters, for it to be chosen."""


@dataclass(frozen=True, eq=False)
class Prior:
    """The wide prior distribution of the base parameters.

    It decides only the parameters that a recording does not excite.
    """

    mean: Array
    """Mean of the base parameters, shape (r,)."""
    precision: Array
    """Inverse of the covariance, shape (r, r)."""


@dataclass(frozen=True, eq=False)
class Estimate:
    """The parameters that solve the equations, with their covariance."""

    beta: Array
    """Base parameters, shape (r,)."""
    laws: tuple[FrictionLaw, ...]
    """The friction law of each joint."""
    friction: Array
    """Parameters of the friction terms, joint by joint, shape (f,)."""
    covariance: Array
    """Covariance of beta and friction, shape (r + f, r + f)."""
    misfit: Array
    """Covariance of beta and friction in white noise, shape (r + f, r + f). Its inverse weights
    changes of the parameters by the residual torque that they add."""
    days: Array
    """Difference of each recording's own parameters from beta and friction, to first order, shape
    (recordings, r + f). The spread widens `covariance`."""
    condition: float
    """Condition number of the equations with columns of length 1."""
    rivals: tuple[list[tuple[FrictionLaw, Array]], ...]
    """Other laws of each joint that explain the data as well, with their parameters; empty if the
    laws were given."""

    def friction_of(self, k: int) -> slice:
        """Return the place of joint k's parameters in `friction`, k from 0."""
        return _joint_part(self.laws, k)

    def friction_torque(self, eq: Equations, friction: Array) -> Array:
        """Return the torque of friction parameters, joint side [N m], shape (M, n)."""
        r = len(self.beta)
        return np.stack([X[:, r:] @ friction for X in _columns(eq, self.laws)], axis=1)

    def torque(self, eq: Equations) -> Array:
        """Return the predicted torque in every row of equations, joint side [N m], shape (M, n)."""
        x = np.concatenate([self.beta, self.friction])
        return eq.known + np.stack([X @ x for X in _columns(eq, self.laws)], axis=1)


def estimate(eq: Equations, prior: Prior, chosen: Sequence[FrictionLaw] | None = None) -> Estimate:
    """Estimate base parameters and friction from equations.

    Args:
        eq: The equations; only rows with `fit` are used.
        prior: Prior of the base parameters.
        chosen: The friction law of each joint. By default cross-validation chooses them.
    """
    given, chosen = chosen is not None, list(chosen or [USUAL] * eq.n)
    rivals: list[list[tuple[FrictionLaw, Array]]] = [[] for _ in chosen]
    x, weights, X = _robust(eq, prior, chosen)
    for _ in range(0 if given else _PASSES):
        selection = _Selection(eq, prior, weights)
        for k in range(eq.n):
            chosen[k] = selection.best(k, chosen)
        rivals = [selection.rivals(k, chosen) for k in range(eq.n)]
        x, weights, X = _robust(eq, prior, chosen)
    r = eq.rigid.shape[2]
    covariance, misfit, condition = _covariance(eq, prior, x, weights, X)
    days = _days(eq, x, weights, X, misfit)
    # The standard error of the mean over recordings is at least that of their spread.
    mean = np.sum(days**2, axis=0) / max(1, len(days) * (len(days) - 1))
    variance = np.diagonal(covariance)
    variance = np.where(variance > 0, variance, np.nan)  # 0: no data, so nothing is known
    wider = np.sqrt(np.maximum(1.0, mean / variance))
    covariance = covariance * np.outer(wider, wider)
    laws, others = tuple(chosen), tuple(rivals)
    return Estimate(x[:r], laws, x[r:], covariance, misfit, days, condition, others)


# --- least squares ---------------------------------------------------------------------------


def _joint_part(chosen: Sequence[FrictionLaw], k: int) -> slice:
    """Return the place of joint k's friction parameters among those of all joints."""
    start = sum(len(law.terms) for law in chosen[:k])
    return slice(start, start + len(chosen[k].terms))


def _columns(eq: Equations, chosen: Sequence[FrictionLaw]) -> list[Array]:
    """Return the columns of all unknown parameters for each joint, shape (M, p)."""
    r, f = eq.rigid.shape[2], sum(len(law.terms) for law in chosen)
    columns = []
    for k, law in enumerate(chosen):
        X = np.zeros((len(eq.tau), r + f))
        X[:, :r] = eq.rigid[:, k]
        terms = [eq.terms[k].index(term) for term in law.terms]
        X[:, r:][:, _joint_part(chosen, k)] = eq.friction[:, k, terms]
        columns.append(X)
    return columns


def _robust(
    eq: Equations, prior: Prior, chosen: Sequence[FrictionLaw]
) -> tuple[Array, Array, list[Array]]:
    """Return the solution, the weights of all rows, shape (M, n), and the columns."""
    X = _columns(eq, chosen)
    y = eq.tau - eq.known
    used = eq.moves & eq.fit[:, None]
    weights = used / np.maximum(
        np.sum(used * y**2, axis=0) / np.maximum(used.sum(axis=0), 1), 1e-300
    )
    r = len(prior.mean)
    places = [np.flatnonzero(np.any(Xk, axis=0)) for Xk in X]  # other joints' friction is 0
    owns = [(at, Xk[:, at]) for at, Xk in zip(places, X, strict=True)]
    for _ in range(_ROUNDS):
        H, h = np.zeros((X[0].shape[1],) * 2), np.zeros(X[0].shape[1])
        H[:r, :r], h[:r] = prior.precision, prior.precision @ prior.mean
        for k, (at, own) in enumerate(owns):
            weighted = weights[:, k, None] * own
            H[np.ix_(at, at)] += weighted.T @ own
            h[at] += weighted.T @ y[:, k]
        x = solved(H, h)
        left = np.abs(y - np.stack([Xk @ x for Xk in X], axis=1))
        scale = np.array([_spread(left[used[:, k], k]) for k in range(eq.n)])
        weights = used / np.maximum(left / (_HUBER * scale), 1.0) / scale**2
    return x, weights, X


def solved(H: Array, h: Array) -> Array:
    """Solve the normal equations H x = h; unknowns without an equation are 0."""
    size = np.sqrt(np.maximum(np.diagonal(H), 1e-300))
    scaled = H / np.outer(size, size) + 1e-13 * np.eye(len(H))
    return np.asarray(np.linalg.solve(scaled, h / size) / size)


def _spread(left: Array) -> float:
    """Return a robust standard deviation of residuals, given their absolute values."""
    return max(float(np.median(left)) / 0.6745, 1e-9) if len(left) else 1.0


def _covariance(
    eq: Equations, prior: Prior, x: Array, weights: Array, X: list[Array]
) -> tuple[Array, Array, float]:
    """Return the covariance of x, that in white noise, and the condition number."""
    r = len(prior.mean)
    information = np.sum([Xk.T @ (weights[:, k, None] * Xk) for k, Xk in enumerate(X)], axis=0)
    size = np.sqrt(np.maximum(np.diagonal(information), 1e-300))
    values = np.linalg.eigvalsh(information / np.outer(size, size))
    whole = information.copy()
    whole[:r, :r] += prior.precision
    whole += np.diag(1e-12 * np.maximum(np.diagonal(whole), 1e-12))
    inverse = np.linalg.inv(whole)
    middle = np.zeros_like(whole)
    middle[:r, :r] = prior.precision
    for k, Xk in enumerate(X):
        w, left = weights[:, k], eq.tau[:, k] - eq.known[:, k] - Xk @ x
        for part in np.unique(eq.part):
            rows = eq.fit & (eq.part == part)
            if rows.sum() > 2:
                middle += _coloured(Xk[rows], w[rows], left[rows], inverse)
    regular = values[0] > _ROUND_OFF * values[-1]
    condition = float(np.sqrt(values[-1] / values[0])) if regular else float("inf")
    return inverse @ middle @ inverse, inverse, condition


def _days(eq: Equations, x: Array, weights: Array, X: list[Array], misfit: Array) -> Array:
    """Return the difference of each recording's own parameters from x, shape (recordings, p).

    It is a step of Newton's method from x, with the mean information of all recordings.
    """
    sources = np.unique(eq.source[eq.fit])
    left = weights * (eq.tau - eq.known - np.stack([Xk @ x for Xk in X], axis=1))
    slopes = [
        sum(Xk[rows].T @ left[rows, k] for k, Xk in enumerate(X))
        for rows in (eq.fit & (eq.source == source) for source in sources)
    ]
    away = np.array(slopes) - np.mean(slopes, axis=0)  # without the slope of the prior
    return np.asarray(len(sources) * away @ misfit)


def _coloured(X: Array, w: Array, left: Array, inverse: Array) -> Array:
    """Return X' W Gamma W X of a joint's residuals in a stretch, summed over frequencies.

    Gamma has the spectrum of the weighted residuals: weights are 0 at rest, smaller for outliers.
    Power is related to the time in which the joint moves.
    """
    used = w > 0
    count, moving = len(left), max(used.sum(), 1)
    X = X * used[:, None]
    F, spectrum = np.fft.rfft(X, axis=0), np.abs(np.fft.rfft(w * left)) ** 2 / moving
    # The fit has removed a share of the noise at the frequencies of its columns.
    weighted = np.fft.rfft(w[:, None] * X, axis=0)
    taken = np.einsum("fi,ij,fj->f", weighted.conj(), inverse, F).real / moving
    window = np.ones(min(max(3, int(np.sqrt(len(spectrum)))), len(spectrum)))
    smooth = np.convolve(spectrum, window, "same")
    power = smooth / np.maximum(np.convolve(1 - taken, window, "same"), 0.2 * len(window))
    twice = np.full(len(power), 2.0)
    twice[[0, -1] if count % 2 == 0 else [0]] = 1.0
    return np.asarray((F.conj().T @ ((power * twice)[:, None] * F)).real / count)


# --- friction laws ---------------------------------------------------------------------------


class _Selection:
    """A selection of friction laws by cross-validation.

    It holds X' W X of every fold and joint. From these follow fits and errors of every law. The
    friction of each joint is eliminated, so that each law is tried with all base parameters free.
    """

    def __init__(self, eq: Equations, prior: Prior, weights: Array):
        self.eq, self.prior = eq, prior
        self.r = eq.rigid.shape[2]
        rows = np.flatnonzero(eq.fit)
        folds = np.array_split(rows, _FOLDS)  # neighbouring rows are correlated
        columns = list(enumerate(eq.augmented))
        self.grams = np.array(
            [[X[rows].T @ (weights[rows, k, None] * X[rows]) for rows in folds] for k, X in columns]
        )
        self.whole = self.grams.sum(axis=1, keepdims=True)
        self.rest = self.whole - self.grams  # shape (n, folds, ., .)
        self.left: list[dict[FrictionLaw, Array]] = [{} for _ in range(eq.n)]  # by fold

    def best(self, k: int, chosen: Sequence[FrictionLaw]) -> FrictionLaw:
        """Return the law of joint k with the least error in other folds; if similar, a simple one.

        A law with more parameters must reduce the error to _MAX_RATIO.
        """
        others = self._others(k, chosen, self.rest)
        found, least, limit = USUAL, np.inf, np.inf
        candidates = self.eq.laws[k]
        size = candidates[0].size
        for law in candidates:
            if law.size > size:
                size, limit = law.size, _MAX_RATIO * least
            self.left[k][law] = self._left(k, self._places(k, law), *others)
            left = float(self.left[k][law].sum())
            if left < min(least, limit):
                found, least = law, left
        return found

    def rivals(self, k: int, chosen: Sequence[FrictionLaw]) -> list[tuple[FrictionLaw, Array]]:
        """Return laws of joint k, with parameters, that are nearly as good as the chosen one.

        Their error is larger by less than its standard error over the folds.
        """
        others, found = self._others(k, chosen, self.whole), []
        for law, left in self.left[k].items():
            more = left - self.left[k][chosen[k]]
            if law != chosen[k] and more.sum() < np.sqrt(_FOLDS) * more.std(ddof=1):
                _, friction = self._solved(self.whole[k], self._places(k, law), *others)
                found.append((law, friction[0, :, 0]))
        return found

    def _others(self, k: int, chosen: Sequence[FrictionLaw], grams: Array) -> tuple[Array, Array]:
        """Return the normal equations of beta alone: the prior and all joints except k."""
        A, b = self.prior.precision, self.prior.precision @ self.prior.mean
        for j, law in enumerate(chosen):
            if j != k:
                own = self._without_friction(grams[j], self._places(j, law))
                A, b = A + own[0], b + own[1]
        return A, b

    def _places(self, k: int, law: FrictionLaw) -> Index:
        """Return the columns of a law."""
        return np.array([self.r + self.eq.terms[k].index(term) for term in law.terms])

    def _without_friction(self, grams: Array, at: Index) -> tuple[Array, Array]:
        """Return the normal equations of beta with the friction parameters eliminated."""
        r = self.r
        cross = grams[:, at, :r], grams[:, at, -1:]
        own = _firm(grams[np.ix_(np.arange(len(grams)), at, at)])
        A, b = (np.linalg.solve(own, part) for part in cross)
        left = np.swapaxes(cross[0], 1, 2)
        return grams[:, :r, :r] - left @ A, grams[:, :r, -1] - (left @ b)[..., 0]

    def _left(self, k: int, at: Index, A: Array, b: Array) -> Array:
        """Return the squared residuals of joint k in each fold, fitted to the other folds."""
        beta, friction = self._solved(self.rest[k], at, A, b)
        z = np.concatenate([beta, friction, -np.ones((_FOLDS, 1, 1))], axis=1)
        cut = np.array([*range(self.r), *at, self.grams.shape[-1] - 1])
        seen = self.grams[k][np.ix_(np.arange(_FOLDS), cut, cut)]
        return np.asarray((np.swapaxes(z, 1, 2) @ seen @ z)[:, 0, 0])

    def _solved(self, grams: Array, at: Index, A: Array, b: Array) -> tuple[Array, Array]:
        """Return base parameters and friction of a joint, a column for each fold."""
        own = self._without_friction(grams, at)
        beta = np.linalg.solve(A + own[0], (b + own[1])[..., None])
        friction = np.linalg.solve(
            _firm(grams[np.ix_(np.arange(len(grams)), at, at)]),
            grams[:, at, -1:] - grams[:, at, : self.r] @ beta,
        )
        return np.asarray(beta), np.asarray(friction)


def _firm(grams: Array) -> Array:
    """Return X' W X made regular for equal or empty columns, shape (folds, f, f)."""
    diagonal = np.einsum("fii->fi", grams)
    least = 1e-12 + 1e-9 * diagonal.max(axis=1, keepdims=True)
    return np.asarray(grams + np.eye(grams.shape[1]) * np.maximum(1e-9 * diagonal, least)[:, None])
