"""Exciting motions: motions that determine the parameters of a robot as exactly as possible.

They are periodic Fourier series that start and end at rest (Swevers et al., "Optimal robot
excitation and identification", IEEE Trans. Robotics and Automation 13(5), 1997). They maximise the
information about the base parameters (D-optimality): log det of the inverse covariance of weighted
least squares. It does not depend on the scale of the parameters.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import count
from pathlib import Path

import numpy as np

from sdt_drake.io.arguments import positives
from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError
from sdt_drake.io.files import write_text
from sdt_drake.io.names import given
from sdt_drake.io.progress import work
from sdt_drake.io.yaml_files import yaml_text
from sdt_drake.machine.identify.filtering import HELD_OUT
from sdt_drake.machine.identify.limits import Limits
from sdt_drake.machine.identify.targets import Target
from sdt_drake.motion.profile import MotionProfile, Track
from sdt_drake.motion.smooth import Fourier

MARGIN, GENTLY = 0.8, 0.3
"""Share of all limits that a motion uses, and further factor on speeds and accelerations for a
payload [-]."""

RATE = 200.0  # assumed sample rate of the recording [Hz]

_BASE_PERIODS = (10.0, 5.0)  # approximate periods of the first harmonic [s]; heavy robots are slow
_HARMONICS = 5
_GRID, _FINER = 48, 2  # samples in a period of the optimisation; factor for its last part
_FINE = 400  # samples in a period of the result
_STARTS = 40  # random motions to choose starts from
_STEP = 1e-6  # difference of a coefficient for the gradient
_STRICTNESS, _STRICTER = 100.0, 10.0  # weight of the penalty; factor for the last part
_SOFT = 0.95  # share of the limits at which the penalty begins
_FIRST_ROUNDS, _SHRINKINGS = 12, 50
_OTHERS, _HALVINGS, _SAFE = 8, 10, 0.98  # held-out motion: candidates, bisections, share of limits
_SEARCH = {True: (6, 100, _FINER), False: (2, 50, 1)}
"""Effort of a thorough search, and of a quick one.

Starts for each base period, iterations from the best start, and factor on its samples.
"""


@dataclass(frozen=True, eq=False)
class Series:
    """The Fourier series of all joints that start and end at rest, linear in their coefficients.

    The coefficients of a joint are its middle [rad] and weights of the columns of `rest`.
    """

    n: int
    """Number of joints."""
    period: float
    """Period of the first harmonic [s]."""

    @cached_property
    def rest(self) -> Array:
        """Orthonormal columns [sine, cosine] with zero speed and acceleration at the start."""
        order = np.arange(1.0, _HARMONICS + 1)
        nothing = np.zeros(_HARMONICS)
        laws = np.array([[*order, *nothing], [*nothing, *order**2]])
        return np.linalg.svd(laws)[2][2:].T

    @property
    def size(self) -> int:
        """Number of coefficients of a joint."""
        return 1 + self.rest.shape[1]

    def bases(self, count: int) -> tuple[Array, Array, Array]:
        """Return the matrices from coefficients to position, speed and acceleration.

        They are for `count` even times in a period, shape (count, size) each.
        """
        omega = 2 * np.pi / self.period * np.arange(1, _HARMONICS + 1)
        phase = np.outer(np.arange(count) * self.period / count, omega)
        sine, cosine = np.sin(phase), np.cos(phase)
        q = np.hstack([sine, cosine])
        v = np.hstack([omega * cosine, -omega * sine])
        vd = np.hstack([-(omega**2) * sine, -(omega**2) * cosine])
        one, none = np.ones((count, 1)), np.zeros((count, 1))
        parts = ((one, q), (none, v), (none, vd))
        return tuple(np.hstack([middle, x @ self.rest]) for middle, x in parts)  # type: ignore

    def segment(self, coefficients: Array, lasts: float) -> Fourier:
        """Return a joint's motion over `lasts` [s], a multiple of the period.

        Args:
            coefficients: Coefficients of the joint, shape (size,).
            lasts: Duration [s].
        """
        sine, cosine = np.split(coefficients[1:] @ self.rest.T, 2)
        return Fourier(period=self.period, sine=sine.tolist(), cosine=cosine.tolist(), end=lasts)

    def start(self, coefficients: Array) -> Array:
        """Return the start [rad], shape (n,), of a motion of coefficients, shape (n, size)."""
        cosine = coefficients[:, 1:] @ self.rest.T[:, _HARMONICS:]
        return np.asarray(coefficients[:, 0] + cosine.sum(axis=1))


@dataclass(frozen=True, eq=False)
class Excitation:
    """An exciting motion, and the accuracy to expect from it.

    The last third of the periods is a different motion, which `identify` holds out. A repetition of
    the first motion would only show the noise.
    """

    profile: MotionProfile
    """The motion profile."""
    fitted: float
    """Duration of the first motion [s]."""
    target: Target
    """The parameters to identify."""
    condition: float
    """Condition number of the equations, with columns of length 1 [-]."""
    sigma: Array
    """Expected standard deviation of each parameter, in its unit, shape (p,)."""
    used: dict[str, Array]
    """Largest share of the robot's limits by quantity [-], shape (n,). Where the file has no limit,
    see `assumed`."""

    @property
    def base_frequency(self) -> float:
        """Frequency of the first harmonic [Hz]."""
        return 1 / self.segments[0][0].period

    @property
    def segments(self) -> list[list[Fourier]]:
        """The segments of each joint in the order of time."""
        every = [track.segments for track in self.profile.tracks]
        return [[one for one in each if isinstance(one, Fourier)] for each in every]

    def save(self, path: str | Path) -> None:
        """Write the motion file.

        Raises:
            InputError: The file cannot be written.
        """
        comments = {
            "": "Periodic motion that excites a robot for identification, by `sdt-drake excite`",
            "duration": "s",
            "q0": "rad",
        }
        write_text(Path(path), yaml_text(dict(given(self.profile)), comments=comments))


def excite(
    target: Target,
    duration: float,
    *,
    margin: float = MARGIN,
    gently: float = 1.0,
    acceleration: Sequence[float] | None = None,
    thorough: bool | None = None,
) -> Excitation:
    """Find the motion that determines the parameters of a target best.

    Args:
        target: The parameters to identify.
        duration: Duration of the motion [s].
        margin: Share of the robot's limits that the motion may use, in (0, 1].
        gently: Further factor on the limits of speed and acceleration, in (0, 1].
        acceleration: Limits in place of those of the file [rad/s²], length n.
        thorough: True for a long search; by default that of up to four joints.

    Raises:
        InputError: No motion is within the limits.
    """
    from scipy.optimize import minimize

    robot = target.robot
    if acceleration is not None:
        acceleration = positives(acceleration, "acceleration", robot.n).tolist()
    limits = Limits.of(robot, margin, gently, acceleration)

    def better(problem: _Problem, x: Array, rounds: int) -> tuple[float, _Problem, Array]:
        value, options = problem.value_and_slope, {"maxiter": rounds}
        found = minimize(
            value, x, jac=True, method="L-BFGS-B", options=options,
            callback=lambda _: report(next(round_) / all_rounds),
        )  # fmt: skip
        return found.fun, problem, found.x

    tried, round_ = [], count(1)
    starts, last_rounds, finer = _SEARCH[robot.n <= 4 if thorough is None else thorough]
    all_rounds = len(_BASE_PERIODS) * starts * _FIRST_ROUNDS + last_rounds
    with work() as report:
        for about in _BASE_PERIODS:
            series = Series(robot.n, duration / max(1, round(duration / about)))
            problem = _Problem(target, series, limits)
            begin = problem.starts()[:starts]
            tried += [better(problem, x, _FIRST_ROUNDS) for x in begin]
        _, problem, x = min(tried, key=lambda found: found[0])
        # A motion beyond a limit is shrunk at the end, so the last part has a stricter penalty.
        stricter = _Problem(target, problem.series, limits, finer * _GRID, _STRICTER * _STRICTNESS)
        _, problem, x = better(stricter, x, last_rounds)
    series, coefficients = problem.series, problem.shrunk(problem.coefficients(x[None])[0])
    q, v, vd = (x[0] for x in _motion(coefficients[None], series.bases(_FINE)))
    columns, torque = target.rows(q, v, vd)
    periods = round(duration / series.period)
    held_out = round(periods * HELD_OUT) if periods > 1 else 0
    parts = [(coefficients, (periods - held_out) * series.period)]
    if held_out:
        parts.append((problem.another(coefficients), held_out * series.period))
    samples = parts[0][1] * RATE / _FINE  # recorded samples for each row
    sigma, condition = _expected(columns.reshape(len(q) * robot.n, -1), samples)
    limits = Limits.of(robot, 1.0, acceleration=acceleration)
    use = limits.use(q, v, vd, torque).max(axis=1)
    used = dict(zip(("range", "speed", "acceleration", "torque"), use, strict=True))
    tracks = [
        Track(joint=name, segments=[series.segment(x[k], lasts) for x, lasts in parts])
        for k, name in enumerate(robot.joint_names)
    ]
    start = series.start(coefficients).tolist()
    profile = MotionProfile(name="excite", duration=duration, q0=start, tracks=tracks)
    return Excitation(profile, parts[0][1], target, condition, sigma, used)


class _Problem:
    """The problem to minimise: a penalty of exceeded limits minus the information.

    Variables are shares of the coefficients that use a joint's limits, so all have a similar size.
    """

    def __init__(
        self,
        target: Target,
        series: Series,
        limits: Limits,
        grid: int = _GRID,
        strictness: float = _STRICTNESS,
    ):
        self.target, self.series, self.limits = target, series, limits
        self.bases, self.strictness = series.bases(grid), strictness
        q, v, vd = (np.linalg.norm(x, axis=0).max() / np.sqrt(grid) for x in self.bases)
        sizes = [limits.range / q, limits.speed / v, limits.acceleration / vd]
        self.size = np.min(sizes, axis=0)  # typical coefficients, shape (n,)

    def coefficients(self, x: Array) -> Array:
        """Return the coefficients, shape (B, n, size), of shares x, shape (B, n size)."""
        shares = x.reshape(len(x), self.series.n, -1)
        middle = self.limits.middle + self.limits.range * shares[:, :, 0]
        return np.concatenate([middle[:, :, None], self.size[:, None] * shares[:, :, 1:]], axis=2)

    def values(self, x: Array) -> Array:
        """Return the value of each of B motions, shape (B,)."""
        target, count = self.target, len(x)
        q, v, vd = _motion(self.coefficients(x), self.bases)
        flat = [y.reshape(-1, target.robot.n) for y in (q, v, vd)]
        columns, torque = target.rows(*flat)
        columns = columns.reshape(count, -1, columns.shape[2])
        use = self.limits.use(q, v, vd, torque.reshape(q.shape))
        beyond = np.maximum(use - _SOFT, 0) ** 2
        penalty = self.strictness * beyond.sum(axis=(0, 2, 3))
        return penalty - _information(columns)

    def value_and_slope(self, x: Array) -> tuple[float, Array]:
        """Return value and gradient at one motion, by differences, in one call of `values`."""
        values = self.values(np.vstack([x, x + _STEP * np.eye(len(x))]))
        return float(values[0]), (values[1:] - values[0]) / _STEP

    def starts(self) -> Array:
        """Return random motions, large and small, the best first, shape (_STARTS, n size)."""
        x = np.random.default_rng(0).normal(0, 1, (_STARTS, self.series.n * self.series.size))
        x *= np.geomspace(0.02, 0.4, _STARTS)[:, None]
        return np.asarray(x[np.argsort(self.values(x))])

    def another(self, coefficients: Array) -> Array:
        """Return another motion from the same start within the limits, shape (n, size).

        It is the one with the most information of _OTHERS random motions of the largest size.
        """
        rng, start = np.random.default_rng(1), self.series.start(coefficients)
        bases, found = self.series.bases(2 * self.bases[0].shape[0]), []
        for _ in range(_OTHERS):
            x = self.size[:, None] * rng.normal(0, 0.3, coefficients.shape)
            x[:, 0] = 0.0
            lowest, highest = 0.0, 1.0
            for _ in range(_HALVINGS):
                size = (lowest + highest) / 2
                other = _from(start, self.series, size * x)
                q, v, vd = (y[0] for y in _motion(other[None], bases))
                use = self.limits.use(q, v, vd, self.target.rows(q, v, vd)[1])
                lowest, highest = (size, highest) if use.max() <= 1 else (lowest, size)
            other = _from(start, self.series, _SAFE * lowest * x)
            motion = [y[0] for y in _motion(other[None], bases)]
            columns = self.target.rows(*motion)[0]
            columns = columns.reshape(1, -1, columns.shape[2])
            found.append((float(_information(columns)[0]), other))
        return max(found, key=lambda one: one[0])[1]

    def shrunk(self, coefficients: Array) -> Array:
        """Shrink a motion until it is within the limits, shape (n, size).

        Raises:
            InputError: A motion of size 0 exceeds a limit.
        """
        fine = self.series.bases(_FINE)
        for _ in range(_SHRINKINGS):
            q, v, vd = (x[0] for x in _motion(coefficients[None], fine))
            use = self.limits.use(q, v, vd, self.target.rows(q, v, vd)[1]).max(axis=1)
            if use.max() <= 1:
                return coefficients
            # All joints shrink together if a torque is too large: any joint may be the cause.
            factor = np.minimum(1 / np.maximum(use[:3].max(axis=0), 1), min(1 / use[3].max(), 1))
            towards = np.where(factor < 1, 0.999 * factor, 1.0)[:, None]
            still = np.zeros_like(coefficients)
            still[:, 0] = self.limits.middle
            coefficients = still + towards * (coefficients - still)
        k = int(use.max(axis=0).argmax())
        raise InputError(
            f"{self.target.robot.path}: joint {k + 1} exceeds its torque limit even at rest, "
            "expected a stronger motor or a larger margin"
        )


def _from(start: Array, series: Series, x: Array) -> Array:
    """Return x with other middles, so that the motion begins at `start`, shape (n, size)."""
    moved = x.copy()
    moved[:, 0] += start - series.start(x)
    return moved


def _motion(coefficients: Array, bases: tuple[Array, Array, Array]) -> list[Array]:
    """Return q, v, vd, shape (B, N, n) each, of coefficients, shape (B, n, size)."""
    return [np.einsum("ts,bns->btn", basis, coefficients) for basis in bases]


def _information(columns: Array) -> Array:
    """Return log det of X' X for each X of `columns`, shape (B, rows, p): shape (B,)."""
    scale = np.sqrt(np.mean(columns**2, axis=(0, 1))) + 1e-12  # for exact numbers; added again
    X = columns / scale
    gram = np.einsum("bip,biq->bpq", X, X, optimize=True) + 1e-9 * np.eye(X.shape[2])
    return np.asarray(np.linalg.slogdet(gram)[1] + 2 * np.log(scale).sum())


def _expected(columns: Array, samples: float) -> tuple[Array, float]:
    """Return standard deviations of the parameters, and the condition number."""
    scale = np.linalg.norm(columns, axis=0)
    _, singular, Vt = np.linalg.svd(columns / scale, full_matrices=False)
    with np.errstate(divide="ignore"):
        sigma = np.sqrt(np.sum((Vt / singular[:, None]) ** 2, axis=0)) / scale / np.sqrt(samples)
        return sigma, float(singular[0] / singular[-1])
