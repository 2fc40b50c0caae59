"""Sequential quadratic programs for a motion near a flight in force and felt rotation.

Variables are q, v and a of each joint at knots. Between knots a is linear, so v and q are exact:

    minimise    sum over knots of  h w [ |W H (f - f_air) / s_f|² + |(e - LP e) / s_w|² ]
                                   + h RHO |jerk|²
    subject to  |v| and |a| and q within the limits of the joints, |torque| within those of the
                motors, rest at both ends

f is the specific force, f_air that of the flight, e the error of the head's rate and LP the canals'
low pass. s_f and s_w are thresholds of perception. The weight w is small before and after the
flight. W is the weight of forces over rotation, H that of forces across the pilot's z over those
along it. Each program is the problem linearised at the motion before, within a trust region.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import scipy.sparse as sp
from pydrake.solvers import ClarabelSolver, MathematicalProgram, SolverOptions

from sdt_drake.io.arrays import Array
from sdt_drake.motion.trajectory import Motion
from sdt_drake.pilot.canals import CUPULA, low_pass
from sdt_drake.pilot.head import head_motion
from sdt_drake.pilot.thresholds import AXES, LINEAR
from sdt_drake.robot.dynamics import inverse_dynamics
from sdt_drake.robot.robot import Robot

RATE = np.radians(1.58 * np.array(AXES))
"""Threshold of perception of the rotation about x, y, z [rad/s]; see `AXES`."""

HORIZONTAL = 2.0
"""Weight of forces across the pilot's z over those along it [-], with little effect on rotation."""

RHO = 0.1
"""Weight of the jerk [s⁶/rad²/s], small beside felt errors."""

SPEED_SHARE = 0.98
"""Share of the joints' speed limit that a motion uses [-]."""

MAX_STEPS = 60
"""Largest number of programs in a search [-]."""

_REGION, _MAX_REGION, _MIN_REGION = 0.3, 1.0, 1e-3  # trust region [rad, and rad/s of an arm]
_MIN_GAIN = 3e-3  # of a step, over the cost; a smaller expected gain ends the search
_OPTIONS = SolverOptions()
for _name in ("tol_gap_abs", "tol_gap_rel", "tol_feas"):
    _OPTIONS.SetOption(ClarabelSolver.id(), _name, 1e-6)
_FIT = 1e-4  # weight of the jerk beside that of angles [s⁶]


@dataclass(frozen=True, eq=False)
class Problem:
    """The desired head motion at knots, and the limits of the device."""

    robot: Robot
    """The device with a frame `head`."""
    knot: float
    """Time between knots [s]."""
    force: Array
    """Specific force [m/s²], shape (N, 3)."""
    rate: Array
    """Angular rate [rad/s], shape (N, 3)."""
    weight: Array
    """Weights of the errors of force and rate at each knot [-], shape (N, 6)."""
    g_weight: float
    """Weight W² of force errors [-]."""
    torque_share: float
    """Share of the motors' torque to use [-]; inf for unlimited torque."""
    lower: Array
    """Lower limits of the angles [rad], shape (n,)."""
    upper: Array
    """Upper limits of the angles [rad], shape (n,)."""
    torque_less: Array
    """Reduction of the torque limits [N m], shape (n,)."""
    arm: bool
    """True if joint 1 turns about the vertical, so that its angle is not felt."""
    penalty: float = 5e3
    """Cost per second of a torque that exceeds its limit by the limit."""

    @property
    def count(self) -> int:
        """Number of knots."""
        return len(self.force)

    def stops(self, arm: float) -> tuple[Array, Array]:
        """Return lower and upper limits of the angles [rad], those of an arm from -arm to arm."""
        ends = self.lower.copy(), self.upper.copy()
        if self.arm:
            ends[0][0], ends[1][0] = -arm, arm
        return ends

    @property
    def head(self) -> Array:
        """Specific force [m/s²] and angular rate [rad/s], shape (N, 6)."""
        return np.hstack([self.force, self.rate])


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Angles, speeds and accelerations of the joints at knots, shape (N, n) each; see `Problem`."""

    knot: float
    """Time between knots [s]."""
    q: Array
    v: Array
    a: Array
    merit: float = math.inf
    """The minimised cost of felt errors, jerk and excess torque."""

    @property
    def parts(self) -> tuple[Array, Array, Array]:
        """The arrays q, v and a."""
        return self.q, self.v, self.a

    def motion(self, period: float) -> Motion:
        """Return the motion at a period [s] that divides the time between knots."""
        steps = round(self.knot / period)
        i, within = np.divmod(np.arange((len(self.q) - 1) * steps + 1), steps)
        i, t = np.minimum(i, len(self.q) - 2), (within * period)[:, None]
        t[-1] = self.knot
        jerk = np.diff(self.a, axis=0)[i] / self.knot
        v = self.v[i] + self.a[i] * t + jerk * t**2 / 2
        v[[0, -1]] = 0.0
        return Motion.from_speeds(period, self.q[0], v)

    def refined(self) -> Trajectory:
        """Return the same trajectory with an additional knot in the middle between any two."""
        t = self.knot / 2
        q, v, a = (x[:-1] for x in (self.q, self.v, self.a))
        jerk = np.diff(self.a, axis=0) / self.knot
        middles = (
            q + v * t + a * t**2 / 2 + jerk * t**3 / 6,
            v + a * t + jerk * t**2 / 2,
            a + jerk * t,
        )
        places = np.arange(1, len(self.q))
        both = zip(self.parts, middles, strict=True)
        q, v, a = (np.insert(x, places, middle, axis=0) for x, middle in both)
        return Trajectory(t, q, v, a)


Watch = Callable[[Trajectory, float], None]
"""Function of the best trajectory so far and the completed share of the work; it may raise."""


def solve(
    problem: Problem, start: Trajectory, watch: Watch, max_steps: int = MAX_STEPS
) -> Trajectory:
    """Find the best trajectory near `start`."""
    best, region = rated(problem, start), _REGION
    for step in range(max_steps):
        watch(best, step / max_steps)
        proposed, promised = _step(problem, best, region)
        gain = best.merit - proposed.merit
        if gain <= 0:
            region *= 0.4
            if region < _MIN_REGION:
                break
            continue
        if gain > 0.75 * promised:
            region = min(1.5 * region, _MAX_REGION)
        elif gain < 0.25 * promised:
            region /= 2
        best = proposed
        if promised < _MIN_GAIN * best.merit:
            break
    watch(best, 1.0)
    return best


def fitted(problem: Problem, q: Array) -> Trajectory:
    """Return the trajectory within the joints' limits that is closest to angles, shape (N, n)."""
    program = _Quadratic(problem)
    one = np.eye(problem.robot.n)
    program.squares(program.q, np.broadcast_to(one, (problem.count, *one.shape)), -q)
    program.jerk(_FIT)
    program.bounds(problem.lower, problem.upper)
    return program.solved()


def rated(problem: Problem, trajectory: Trajectory) -> Trajectory:
    """Return the trajectory with its merit."""
    error = _head(problem.robot, *trajectory.parts) - problem.head
    error[:, 3:] -= low_pass(error[:, 3:], CUPULA, problem.knot)
    error *= _scale(problem) * problem.weight
    excess = 0.0
    if math.isfinite(problem.torque_share):
        used = np.abs(_torque_use(problem, *trajectory.parts)).max(axis=1)
        excess = float(np.maximum(used - 1, 0).sum())
    return replace(trajectory, merit=_cost(problem, trajectory, error, excess))


def _cost(problem: Problem, trajectory: Trajectory, error: Array, excess: float) -> float:
    """Return the cost of weighted errors, of the jerk and of excess torque."""
    jerk = np.diff(trajectory.a, axis=0) / problem.knot
    cost = float(np.sum(error**2) + RHO * np.sum(jerk**2))
    return problem.knot * (cost + problem.penalty * excess)


def _scale(problem: Problem) -> Array:
    """Return the factors from errors of force and rate to the cost, shape (6,)."""
    force = np.array([HORIZONTAL, HORIZONTAL, 1.0]) / LINEAR
    return np.concatenate([math.sqrt(problem.g_weight) * force, 1 / RATE])


def _head(robot: Robot, q: Array, v: Array, a: Array) -> Array:
    """Return specific force and rate of the head, shape (N, 6)."""
    head = head_motion(robot, q, v, a)
    return np.hstack([head.specific_force, head.angular_velocity])


def _torque_use(problem: Problem, q: Array, v: Array, a: Array) -> Array:
    """Return the torque over its usable range, from -1 to 1, shape (N, n)."""
    torque = problem.robot.gear_torque(inverse_dynamics(problem.robot, q, v, a))
    low, high = problem.robot.torque_range(v, problem.torque_share)
    low, high = low + problem.torque_less, high - problem.torque_less
    return (2 * torque - high - low) / np.maximum(high - low, 1e-9)


def _linear(
    of: Callable[..., Array], trajectory: Trajectory, step: float, wanted: Array | float = 0.0
) -> tuple[Array, Array]:
    """Return J and c of the tangent c + J (q, v, a) at each knot to a function less `wanted`.

    Shapes (N, rows, 3 n) and (N, rows).
    """
    count, n = trajectory.q.shape
    steps = step * np.eye(3 * n).reshape(3 * n, 1, 3, 1, n) * np.array([1, -1])[:, None, None, None]
    moved = (np.stack(trajectory.parts) + steps).reshape(6 * n, 3, count, n).swapaxes(0, 1)
    values = of(*moved.reshape(3, -1, n)).reshape(3 * n, 2, count, -1)
    J = ((values[:, 0] - values[:, 1]) / (2 * step)).transpose(1, 2, 0)
    at = np.hstack(trajectory.parts)
    return np.asarray(J), of(*trajectory.parts) - wanted - np.einsum("nij,nj->ni", J, at)


def _step(problem: Problem, trajectory: Trajectory, region: float) -> tuple[Trajectory, float]:
    """Return the best trajectory of the linearised problem in the region, and its expected gain."""
    program, n = _Quadratic(problem, max(trajectory.merit, 1.0)), problem.robot.n
    J, off = _linear(partial(_head, problem.robot), trajectory, 1e-5, problem.head)
    sensed = program.lagged(J[:, 3:, : 2 * n], off[:, 3:])
    # Errors at each knot: J x + off - (0, LP e), with their weights.
    lag = np.zeros((problem.count, 6, 3))
    lag[:, 3:] = -np.eye(3)
    weight = math.sqrt(problem.knot) * problem.weight * _scale(problem)
    A, b = np.concatenate([J, lag], axis=2) * weight[:, :, None], off * weight
    variables = np.hstack([program.q, program.v, program.a, sensed])
    program.squares(variables, A, b)
    program.jerk(RHO * problem.knot)
    lower = np.minimum(np.maximum(problem.lower, trajectory.q - region), trajectory.q + region)
    upper = np.maximum(np.minimum(problem.upper, trajectory.q + region), trajectory.q - region)
    if problem.arm:
        lower[:, 0], upper[:, 0] = problem.lower[0], problem.upper[0]
        v = trajectory.v[:, 0]
        program.between(v - region, v + region, program.v[:, 0])
    program.bounds(lower, upper)
    if math.isfinite(problem.torque_share):
        program.torques(*_linear(partial(_torque_use, problem), trajectory, 1e-4))
    found = program.solved()
    if not program.result.is_success():
        return trajectory, 0.0
    x = np.hstack([*found.parts, program.value(sensed)])
    error = (np.einsum("nij,nj->ni", A, x) + b) / math.sqrt(problem.knot)
    promised = _cost(problem, found, error, program.excess())
    return rated(problem, found), trajectory.merit - promised


class _Quadratic:
    """A quadratic program in q, v and a of all knots, with exact integration between them.

    The cost is divided by `unit`, because the solver requires numbers of about 1.
    """

    def __init__(self, problem: Problem, unit: float = 1.0) -> None:
        self._problem, self._unit, h, n = problem, unit, problem.knot, problem.robot.n
        self._program = MathematicalProgram()
        self.q, self.v, self.a = (
            self._program.NewContinuousVariables(problem.count, n, name) for name in "qva"
        )
        self._slack: Array = np.zeros(0)  # variables
        first, then = (sp.eye(problem.count - 1, problem.count, k=k) for k in (0, 1))
        one, joints = then - first, sp.eye(n)
        kron = sp.kron
        self._equal([kron(one, joints), kron(-h / 2 * (first + then), joints)], [self.v, self.a], 0)
        self._equal(
            [kron(one, joints), kron(-h * first, joints),
             kron(-h * h * (first / 3 + then / 6), joints)],
            [self.q, self.v, self.a], 0,
        )  # fmt: skip
        for rest in (self.v[[0, -1]], self.a[[0, -1]]):
            self._program.AddBoundingBoxConstraint(0, 0, rest.ravel())
        robot = problem.robot
        for limit, variables in (
            (SPEED_SHARE * robot.top_speed, self.v),
            (SPEED_SHARE * robot.acceleration_limit, self.a),
        ):
            self.between(np.broadcast_to(-limit, variables.shape), limit, variables)

    def between(self, lower: Array, upper: Array, variables: Array) -> None:
        """Keep variables between limits."""
        lower, upper = (np.broadcast_to(x, variables.shape).ravel() for x in (lower, upper))
        self._program.AddBoundingBoxConstraint(lower, upper, variables.ravel())

    def _equal(self, blocks: list[Array], variables: list[Array], value: Array | float) -> None:
        """Keep the sum of blocks times variables equal to a value."""
        matrix = sp.csc_matrix(sp.hstack(blocks))
        right = np.broadcast_to(value, matrix.shape[:1]).astype(float)
        unknown = np.concatenate([one.ravel() for one in variables])
        self._program.AddLinearEqualityConstraint(matrix, right, unknown)

    def squares(self, variables: Array, A: Array, b: Array) -> None:
        """Add the cost |A x + b|² of each knot, shapes (N, m), (N, r, m) and (N, r)."""
        turned = A.transpose(0, 2, 1)
        Q = 2 / self._unit * turned @ A + 1e-9 * np.eye(A.shape[2])
        c = 2 / self._unit * np.einsum("nij,nj->ni", turned, b)
        for one in zip(Q, c, variables, strict=True):
            self._program.AddQuadraticCost(*one, is_convex=True)

    def jerk(self, weight: float) -> None:
        """Add the cost of the squared jerk with a weight."""
        n = self._problem.robot.n
        size = 2 / self._unit * weight / self._problem.knot**2
        Q = size * np.kron([[1, -1], [-1, 1]], np.eye(n))
        for pair in np.hstack([self.a[:-1], self.a[1:]]):
            self._program.AddQuadraticCost(Q, np.zeros(2 * n), pair, is_convex=True)

    def bounds(self, lower: Array, upper: Array) -> None:
        """Keep the angles within limits [rad]."""
        self.between(lower, upper, self.q)
        if self._problem.arm:  # its angle is not felt, so it begins at 0
            self._program.AddBoundingBoxConstraint(0, 0, self.q[:1, 0])

    def lagged(self, J: Array, off: Array) -> Array:
        """Return the canals' low pass of e = J (q, v) + off, as variables, shape (N, 3)."""
        count, n = self.q.shape
        ratio = self._problem.knot / CUPULA
        phi, b = math.exp(-ratio), -math.expm1(-ratio) / ratio
        z = self._program.NewContinuousVariables(count, 3, "z")
        first, then = sp.eye(count - 1, count), sp.eye(count - 1, count, k=1)
        three = sp.eye(3)
        mean = sp.kron((b - phi) * first + (1 - b) * then, three)
        self._equal(
            [sp.kron(then - phi * first, three), -mean @ _blocks(J[:, :, :n]),
             -mean @ _blocks(J[:, :, n:])],
            [z, self.q, self.v], mean @ off.ravel(),
        )  # fmt: skip
        # The device has been at rest before the first knot, so the low pass is in steady state.
        start = -self._problem.rate[0]
        self._program.AddBoundingBoxConstraint(start, start, z[0])
        return z

    def torques(self, J: Array, off: Array) -> None:
        """Limit the torques |J (q, v, a) + off| <= 1 by a cost of their excess."""
        problem, (count, n) = self._problem, self.q.shape
        self._slack = self._program.NewContinuousVariables(count, "s")
        self._program.AddBoundingBoxConstraint(0, math.inf, self._slack)
        self._program.AddLinearCost(
            np.full(count, problem.penalty * problem.knot / self._unit), 0, self._slack
        )
        beyond = sp.kron(sp.eye(count), np.ones((n, 1)))
        parts = [_blocks(J[:, :, k * n : (k + 1) * n]) for k in range(3)]
        unknown = np.concatenate([x.ravel() for x in (self.q, self.v, self.a, self._slack)])
        for sign in (1, -1):
            matrix = sp.csc_matrix(sp.hstack([*(sign * part for part in parts), -beyond]))
            self._program.AddLinearConstraint(
                matrix, np.full(off.size, -math.inf), 1 - sign * off.ravel(), unknown
            )

    def excess(self) -> float:
        """Return the excess of torque over the limits, summed over knots [-]."""
        return float(self.value(self._slack).sum()) if len(self._slack) else 0.0

    def value(self, variables: Array) -> Array:
        """Return the values of variables in the solution."""
        return np.asarray(self.result.GetSolution(variables), dtype=float)

    def solved(self) -> Trajectory:
        """Solve the program and return the trajectory."""
        self.result = ClarabelSolver().Solve(self._program, None, _OPTIONS)
        q, v, a = map(self.value, (self.q, self.v, self.a))
        return Trajectory(self._problem.knot, q, v, a)


def _blocks(blocks: Array) -> sp.bsr_matrix:
    """Return the block-diagonal matrix of blocks, shape (N, r, m)."""
    count, rows, columns = blocks.shape
    shape = (count * rows, count * columns)
    return sp.bsr_matrix((blocks, np.arange(count), np.arange(count + 1)), shape=shape)
