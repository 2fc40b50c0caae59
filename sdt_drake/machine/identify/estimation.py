"""Weighted, robust least squares of all joints at once, and how sure it is.

Each joint is weighted by its own residual, and what is far off counts less (Huber, "Robust
estimation of a location parameter", Annals of Mathematical Statistics 35(1), 1964). Filtered
residuals are coloured: neighbours tell the same. So the covariance is not that of independent
samples, but

    (X' W X)^-1 X' W Gamma W X (X' W X)^-1

with the covariance Gamma of residuals that have, at every frequency, the power that they are seen
to have (as in Janot, Vandanjon, Gautier, "A generic instrumental variable approach for industrial
robot identification", IEEE Trans. Control Systems Technology 22(1), 2014, who whiten instead).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sdt_drake.io.arrays import Array, Index
from sdt_drake.machine.identify.equations import Equations
from sdt_drake.machine.identify.friction import USUAL, FrictionLaw

_HUBER = 2.5  # residuals up to so many standard deviations count fully
_ROUNDS = 8
_ROUND_OFF = 1e-14  # of the largest eigenvalue
_FOLDS = 5
_PASSES = 2
_WORTH = 0.98
"""A law with more parameters must leave less than this of what a simpler one leaves."""


@dataclass(frozen=True, eq=False)
class Prior:
    """What is believed of the base parameters before anything is measured: not much.

    It decides alone where a recording says nothing, and has no weight where it says something.

    Attributes:
        mean: of the base parameters, shape (r,).
        precision: inverse of their covariance, shape (r, r).
    """

    mean: Array
    precision: Array


@dataclass(frozen=True, eq=False)
class Estimate:
    """What the equations say: parameters, and how sure they are.

    Attributes:
        beta: base parameters, shape (r,).
        laws: of friction, one for each joint.
        friction: parameters of their terms, joint by joint, shape (f,).
        covariance: of beta and friction together, shape (r + f, r + f).
        misfit: the same as least squares alone has it, in noise that is not coloured: its inverse
            is what other parameters leave more of the weighted torques.
        days: what each recording alone would add to beta and friction, to first order, shape
            (recordings, r + f); their spread widens `covariance`.
        condition: of the equations, scaled to columns of one.
        rivals: for each joint other laws that the data do not tell from its own, with the
            parameters of their terms; none where the laws were given.
    """

    beta: Array
    laws: tuple[FrictionLaw, ...]
    friction: Array
    covariance: Array
    misfit: Array
    days: Array
    condition: float
    rivals: tuple[list[tuple[FrictionLaw, Array]], ...]

    def friction_of(self, k: int) -> slice:
        """Where in `friction` the parameters of joint k are, from 0."""
        return _joint_part(self.laws, k)

    def friction_torque(self, eq: Equations, friction: Array) -> Array:
        """Friction torque in every row of equations, of these parameters, joint side [N m], shape
        (M, n)."""
        r = len(self.beta)
        return np.stack([X[:, r:] @ friction for X in _columns(eq, self.laws)], axis=1)

    def torque(self, eq: Equations) -> Array:
        """Predicted torque in every row of equations, joint side [N m], shape (M, n)."""
        x = np.concatenate([self.beta, self.friction])
        return eq.known + np.stack([X @ x for X in _columns(eq, self.laws)], axis=1)


def estimate(eq: Equations, prior: Prior, chosen: Sequence[FrictionLaw] | None = None) -> Estimate:
    """Estimate base parameters and friction from equations.

    Args:
        eq: its rows `fit` are used.
        prior: of the base parameters.
        chosen: a law of friction for each joint; by default what is left in data that were not
            fitted decides.
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
    # The mean of recordings is no surer than their spread tells.
    mean = np.sum(days**2, axis=0) / max(1, len(days) * (len(days) - 1))
    wider = np.sqrt(np.maximum(1.0, mean / np.diagonal(covariance)))
    return Estimate(
        x[:r],
        tuple(chosen),
        x[r:],
        covariance * np.outer(wider, wider),
        misfit,
        days,
        condition,
        tuple(rivals),
    )


# --- least squares ---------------------------------------------------------------------------


def _joint_part(chosen: Sequence[FrictionLaw], k: int) -> slice:
    """Where the friction of joint k is, behind the base parameters."""
    start = sum(len(law.terms) for law in chosen[:k])
    return slice(start, start + len(chosen[k].terms))


def _columns(eq: Equations, chosen: Sequence[FrictionLaw]) -> list[Array]:
    """For each joint the columns of all that is to be found, shape (M, p)."""
    r, f = eq.rigid.shape[2], sum(len(law.terms) for law in chosen)
    columns = []
    for k, law in enumerate(chosen):
        X = np.zeros((len(eq.tau), r + f))
        X[:, :r] = eq.rigid[:, k]
        X[:, r:][:, _joint_part(chosen, k)] = eq.friction[
            :, k, [eq.terms[k].index(t) for t in law.terms]
        ]
        columns.append(X)
    return columns


def _robust(
    eq: Equations, prior: Prior, chosen: Sequence[FrictionLaw]
) -> tuple[Array, Array, list[Array]]:
    """Solution, weights of all rows, shape (M, n), and columns."""
    X = _columns(eq, chosen)
    y = eq.tau - eq.known
    used = eq.moves & eq.fit[:, None]
    weights = used / np.maximum(
        np.sum(used * y**2, axis=0) / np.maximum(used.sum(axis=0), 1), 1e-300
    )
    r = len(prior.mean)
    places = [np.flatnonzero(np.any(Xk, axis=0)) for Xk in X]  # friction of others has no part
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
    """Normal equations, scaled; what no equation has is 0."""
    size = np.sqrt(np.maximum(np.diagonal(H), 1e-300))
    scaled = H / np.outer(size, size) + 1e-13 * np.eye(len(H))
    return np.asarray(np.linalg.solve(scaled, h / size) / size)


def _spread(left: Array) -> float:
    """Standard deviation of what most of the residuals are of, which some outliers are not."""
    return max(float(np.median(left)) / 0.6745, 1e-9) if len(left) else 1.0


def _covariance(
    eq: Equations, prior: Prior, x: Array, weights: Array, X: list[Array]
) -> tuple[Array, Array, float]:
    """Covariance of x, that in white noise, and the condition number of the scaled equations."""
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
    """What each recording alone would add to the parameters, shape (recordings, p): a step of
    Newton's method from those of all, with as much information as all have on average."""
    sources = np.unique(eq.source[eq.fit])
    left = weights * (eq.tau - eq.known - np.stack([Xk @ x for Xk in X], axis=1))
    slopes = [
        sum(Xk[rows].T @ left[rows, k] for k, Xk in enumerate(X))
        for rows in (eq.fit & (eq.source == source) for source in sources)
    ]
    away = np.array(slopes) - np.mean(slopes, axis=0)  # of a prior, which is of no recording
    return np.asarray(len(sources) * away @ misfit)


def _coloured(X: Array, w: Array, left: Array, inverse: Array) -> Array:
    """X' W Gamma W X for what is left of a joint in a stretch: frequency by frequency.

    W left counts, as the fit has it: nothing where the joint rests, less where it is far off. Its
    power is that of the time in which the joint moves, when alone it meets X.
    """
    used = w > 0
    count, moving = len(left), max(used.sum(), 1)
    X = X * used[:, None]
    F, spectrum = np.fft.rfft(X, axis=0), np.abs(np.fft.rfft(w * left)) ** 2 / moving
    # A fit takes its share of what there was at the frequencies of its columns.
    weighted = np.fft.rfft(w[:, None] * X, axis=0)
    taken = np.einsum("fi,ij,fj->f", weighted.conj(), inverse, F).real / moving
    window = np.ones(min(max(3, int(np.sqrt(len(spectrum)))), len(spectrum)))
    smooth = np.convolve(spectrum, window, "same")
    power = smooth / np.maximum(np.convolve(1 - taken, window, "same"), 0.2 * len(window))
    twice = np.full(len(power), 2.0)
    twice[0] = 1.0
    if count % 2 == 0:
        twice[-1] = 1.0
    return np.asarray((F.conj().T @ ((power * twice)[:, None] * F)).real / count)


# --- which law of friction -------------------------------------------------------------------


class _Selection:
    """Grams of folds and joints: friction can be left out of them, and errors be told by them.

    Each joint's own friction is eliminated, so that all laws are tried with all base parameters.
    """

    def __init__(self, eq: Equations, prior: Prior, weights: Array):
        self.eq, self.prior = eq, prior
        self.r = eq.rigid.shape[2]
        rows = np.flatnonzero(eq.fit)
        folds = np.array_split(rows, _FOLDS)  # of neighbours: what is near tells the same
        self.grams = np.array(
            [
                [X[fold].T @ (weights[fold, k, None] * X[fold]) for fold in folds]
                for k, X in enumerate(eq.augmented)
            ]
        )
        self.whole = self.grams.sum(axis=1, keepdims=True)
        self.rest = self.whole - self.grams  # shape (n, folds, ., .)
        self.left: list[dict[FrictionLaw, Array]] = [
            {} for _ in range(eq.n)
        ]  # by each law, of each fold

    def best(self, k: int, chosen: Sequence[FrictionLaw]) -> FrictionLaw:
        """The law of joint k that leaves least of what it was not fitted to; the simplest of those
        that leave as little."""
        others = self._others(k, chosen, self.rest)
        found, least, limit = USUAL, np.inf, np.inf
        candidates = self.eq.laws[k]
        size = candidates[0].size
        for law in candidates:
            if law.size > size:
                size, limit = law.size, _WORTH * least
            self.left[k][law] = self._left(k, self._places(k, law), *others)
            left = float(self.left[k][law].sum())
            if left < min(least, limit):
                found, least = law, left
        return found

    def rivals(self, k: int, chosen: Sequence[FrictionLaw]) -> list[tuple[FrictionLaw, Array]]:
        """Laws of joint k, with parameters, that leave more than the chosen one by less than the
        standard error of the difference, as the folds tell it."""
        others, found = self._others(k, chosen, self.whole), []
        for law, left in self.left[k].items():
            more = left - self.left[k][chosen[k]]
            if law != chosen[k] and more.sum() < np.sqrt(_FOLDS) * more.std(ddof=1):
                _, friction = self._solved(self.whole[k], self._places(k, law), *others)
                found.append((law, friction[0, :, 0]))
        return found

    def _others(self, k: int, chosen: Sequence[FrictionLaw], grams: Array) -> tuple[Array, Array]:
        """Normal equations of beta alone, by the belief and all joints but k."""
        A, b = self.prior.precision, self.prior.precision @ self.prior.mean
        for j, law in enumerate(chosen):
            if j != k:
                own = self._without_friction(grams[j], self._places(j, law))
                A, b = A + own[0], b + own[1]
        return A, b

    def _places(self, k: int, law: FrictionLaw) -> Index:
        """Columns of a law."""
        return np.array([self.r + self.eq.terms[k].index(term) for term in law.terms])

    def _without_friction(self, grams: Array, at: Index) -> tuple[Array, Array]:
        """Normal equations of beta alone, when friction always takes what suits it best."""
        r = self.r
        cross = grams[:, at, :r], grams[:, at, -1:]
        own = _firm(grams[np.ix_(np.arange(len(grams)), at, at)])
        A, b = (np.linalg.solve(own, part) for part in cross)
        left = np.swapaxes(cross[0], 1, 2)
        return grams[:, :r, :r] - left @ A, grams[:, :r, -1] - (left @ b)[..., 0]

    def _left(self, k: int, at: Index, A: Array, b: Array) -> Array:
        """Sums of squares of joint k that fits leave in the folds that they have not seen."""
        beta, friction = self._solved(self.rest[k], at, A, b)
        z = np.concatenate([beta, friction, -np.ones((_FOLDS, 1, 1))], axis=1)
        cut = np.array([*range(self.r), *at, self.grams.shape[-1] - 1])
        seen = self.grams[k][np.ix_(np.arange(_FOLDS), cut, cut)]
        return np.asarray((np.swapaxes(z, 1, 2) @ seen @ z)[:, 0, 0])

    def _solved(self, grams: Array, at: Index, A: Array, b: Array) -> tuple[Array, Array]:
        """Base parameters and friction of a joint, columns in each fold."""
        own = self._without_friction(grams, at)
        beta = np.linalg.solve(A + own[0], (b + own[1])[..., None])
        friction = np.linalg.solve(
            _firm(grams[np.ix_(np.arange(len(grams)), at, at)]),
            grams[:, at, -1:] - grams[:, at, : self.r] @ beta,
        )
        return np.asarray(beta), np.asarray(friction)


def _firm(grams: Array) -> Array:
    """Grams that can be solved, where columns are alike or empty, too; shape (folds, f, f)."""
    diagonal = np.einsum("fii->fi", grams)
    least = 1e-12 + 1e-9 * diagonal.max(axis=1, keepdims=True)
    return np.asarray(grams + np.eye(grams.shape[1]) * np.maximum(1e-9 * diagonal, least)[:, None])
