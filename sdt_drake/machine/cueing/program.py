"""A motion whose percept and force are near those of a flight, by the method of Gauss and Newton.

States are q, v and a of the joints and those of the pilot's observer at knots, inputs are the jerks
between knots, so v and q are exact:

    minimise    sum over knots of  h / 2 (w [W_g |(f - f_air) / s_g|² + W_v |(g^ - g^_air) / s_v|²
                + W_r |(w^ - w^_air) / s_w|² + W_a |(a^ - a^_air) / s_f|²] + RHO |jerk|²)
    subject to  |v|, |a|, q and |torque| within limits, rest at both ends

f is the specific force, a hat is felt, _air in flight, s are thresholds of perception. The weight w
is small before and after the flight.
A barrier, -ln of the distance to a limit, keeps within the limits. It gets lower step by step.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from sdt_drake.io.arrays import Array
from sdt_drake.machine.cueing.felt import STATES, advanced, followed, unfelt
from sdt_drake.machine.cueing.problem import Problem, Trajectory
from sdt_drake.machine.cueing.riccati import Quadratic, smallest

RHO = 0.1
"""Weight of the jerk [s⁶/rad²/s], small beside felt errors."""

MAX_STEPS = 80
"""Largest number of steps in a search [-]."""

_BARRIERS = (300.0, 0.3), (30.0, 0.05), (5.0, 0.003), (5.0, 2e-4)
"""Heights of the barrier [1/s], and the distances below which it is a parabola [-], in turn."""
_NEAR = 0.3  # distance from a limit at which the barrier begins [-]
_FIT, _FIT_STEPS = 1e-4, 20  # weight of the jerk beside that of angles [s⁶]; steps of a fit
_MIN_GAIN = 1e-3  # of a step, over the cost; a smaller gain ends the search
_DAMPING, _MAX_DAMPING = 10.0, 1e9  # weight of changes of angle and speed, first and largest
_HELD = 100.0  # damping that makes a step, and so its gain, small
_END = 1e6  # cost of a squared speed or acceleration of the last knot
_SETTLED, _SETTLINGS = 1e-5, 12  # error of the observer's states, and steps to it
_STEP, _TORQUE_STEP = 1e-6, 1e-5  # of differences


Watch = Callable[[Trajectory, float], None]
"""Function of the best trajectory so far and the completed share of the work; it may raise."""


def solve(
    problem: Problem, start: Trajectory, watch: Watch, max_steps: int = MAX_STEPS
) -> Trajectory:
    """Find the best trajectory near `start`, by steps that are damped as much as they must be.

    A small gain ends the search only if the step was hardly damped. With fewer than all steps, the
    last barrier alone counts.
    """
    barriers = list(_BARRIERS if max_steps == MAX_STEPS else _BARRIERS[-1:])
    best = point = _first(problem, start)
    damping = _DAMPING
    for step in range(max_steps):
        watch(best.trajectory, step / max_steps)
        proposed, damping = _step(point, barriers[0], damping)
        gain = 1 - proposed.cost(barriers[0]) / point.cost(barriers[0]) if proposed else 0.0
        is_held, point = proposed and damping > _HELD, proposed or point
        best = min(best, point, key=lambda one: one.cost(_BARRIERS[-1]))
        if gain < _MIN_GAIN * (1 if len(barriers) == 1 else 10) and not is_held:
            if len(barriers) == 1:
                break
            del barriers[0]
            damping = min(max(damping, 1.0), _DAMPING)
    watch(best.trajectory, 1.0)
    return best.trajectory


def fitted(problem: Problem, q: Array) -> Trajectory:
    """Return the trajectory within the joints' limits that is closest to angles, shape (N, n)."""
    still = Trajectory(problem.knot, np.broadcast_to(q[:1], q.shape), 0 * q, 0 * q)
    near = replace(problem, angles=q, torque_share=math.inf)
    return solve(near, still, lambda *_: None, _FIT_STEPS)


def rated(problem: Problem, trajectory: Trajectory) -> Trajectory:
    """Return the trajectory with its merit."""
    return _first(problem, trajectory).trajectory


@dataclass(frozen=True, eq=False)
class _Point:
    """A trajectory with all that its cost needs."""

    problem: Problem
    s: Array  # q, v and a, shape (N, 3 n)
    u: Array  # jerks, shape (N - 1, n)
    head: Array  # shape (N, 6)
    states: Array  # of the observer, shape (N, 12)

    @cached_property
    def error(self) -> Array:
        if self.problem.angles is not None:
            off = self.s[:, : self.problem.robot.n] - self.problem.angles
            return math.sqrt(self.problem.knot * RHO / _FIT) * off
        return self.problem.error(self.states, self.head)

    @cached_property
    def over(self) -> tuple[Array, Array]:
        over, side = self.problem.excess(self.s)
        return over + self.problem.shift, side

    def cost(self, barrier: tuple[float, float]) -> float:
        effort = self.problem.knot * RHO * np.sum(self.u**2)
        limits = self.problem.knot * float(_barrier(self.over[0], *barrier)[0].sum())
        return float(np.sum(self.error**2) + effort) / 2 + limits

    @property
    def trajectory(self) -> Trajectory:
        q, v, a = np.split(self.s, 3, axis=1)
        states = self.states if self.problem.angles is None else None
        return Trajectory(self.problem.knot, q, v, a, self.cost(_BARRIERS[-1]), states)

    @cached_property
    def tangents(self) -> tuple[Array, Array, Array]:
        """Jacobians of the head by s, of the next states by states and both heads, of the error."""
        problem = self.problem
        by_s = _tangent(problem.head_at, self.s, _STEP)

        def next_states(x: Array) -> Array:
            states, before, after = np.split(x, [STATES, STATES + 6], axis=-1)
            return advanced(problem.model, states, before, after, problem.knot)

        def error(x: Array) -> Array:
            return problem.error(x[..., :STATES], x[..., STATES:])

        ends = np.hstack([self.states[:-1], self.head[:-1], self.head[1:]])
        by_error = _tangent(error, np.hstack([self.states, self.head]), _STEP)
        return by_s, _tangent(next_states, ends, _STEP), by_error

    def moved(self, ds: Array, du: Array) -> _Point | None:
        """Return the point after a change; None if the observer does not settle there."""
        problem, s = self.problem, self.s + ds
        head, states = problem.head_at(s), self.states.copy()
        by_states = self.tangents[1][:, :, :STATES] if problem.angles is None else ()
        for _ in range(_SETTLINGS if problem.angles is None else 0):
            found = advanced(problem.model, states[:-1], head[:-1], head[1:], problem.knot)
            settled = unfelt(head[0]) if problem.first is None else problem.first
            change = [settled - states[0]]
            for J, off in zip(by_states, found - states[1:], strict=True):
                change.append(J @ change[-1] + off)
            states = states + np.array(change)
            size = np.abs(change).max()
            if size < _SETTLED:
                break
            if not size < 1 / _SETTLED:
                return None
        else:
            if problem.angles is None:
                return None
        return _Point(problem, s, self.u + du, head, states)


def _first(problem: Problem, trajectory: Trajectory) -> _Point:
    s = np.hstack(trajectory.parts)
    head = problem.head_at(s)
    states = np.zeros((problem.count, STATES))
    if trajectory.states is not None:
        states = trajectory.states
    elif problem.angles is None:
        states = followed(problem.model, head, problem.knot, problem.first)
    return _Point(problem, s, trajectory.jerk, head, states)


def _tangent(of: Callable[[Array], Array], at: Array, step: float) -> Array:
    """Return the Jacobian of a function at each of N points, shape (N, rows, columns)."""
    columns = at.shape[1]
    moved = np.concatenate([at[None], at + step * np.eye(columns)[:, None]])
    values = of(moved)
    return np.asarray(((values[1:] - values[0]) / step).transpose(1, 2, 0))


def _step(
    point: _Point, barrier: tuple[float, float], damping: float
) -> tuple[_Point | None, float]:
    """Return a better point, None if there is none, and the damping for the next step."""
    cost, n = _quadratic(point, barrier), point.problem.robot.n
    weights = np.zeros(3 * n + STATES)
    weights[: 2 * n] = point.problem.knot
    weights[0] *= not point.problem.arm
    first = damping
    while damping < _MAX_DAMPING:
        dx, du = smallest(cost, damping * weights)
        proposed = point.moved(dx[:, : 3 * n], du)
        if proposed and proposed.cost(barrier) < point.cost(barrier):
            return proposed, damping / 4 if damping == first else damping
        damping = max(6 * damping, 1e-3)
    return None, first


def _quadratic(point: _Point, barrier: tuple[float, float]) -> Quadratic:
    """Return the cost of a change of the states, linearised."""
    problem, n, count = point.problem, point.problem.robot.n, point.problem.count
    h, one, m = problem.knot, np.eye(n), 3 * n + STATES
    joints = np.block([
        [one, h * one, h**2 / 2 * one, h**3 / 6 * one],
        [0 * one, one, h * one, h**2 / 2 * one],
        [0 * one, 0 * one, one, h * one],
    ])  # fmt: skip
    AB = np.zeros((count - 1, m, m + n))
    own = np.r_[: 3 * n, m : m + n]  # columns of q, v, a and jerk
    AB[:, : 3 * n, own] = joints
    J, S = np.zeros((count, n, m)), np.zeros((m, n))
    J[:, :, :n], S[:n] = math.sqrt(h * RHO / _FIT) * one, one
    if problem.angles is None:
        by_s, by_ends, by_error = point.tangents
        before, after = by_ends[:, :, STATES : STATES + 6], by_ends[:, :, STATES + 6 :]
        AB[:, 3 * n :, own] = after @ by_s[1:] @ joints
        AB[:, 3 * n :, : 3 * n] += before @ by_s[:-1]
        AB[:, 3 * n :, 3 * n : m] = by_ends[:, :, :STATES]
        J = np.concatenate([by_error[:, :, STATES:] @ by_s, by_error[:, :, :STATES]], axis=2)
        S[3 * n :] = _tangent(unfelt, point.head[:1], _STEP)[0] @ by_s[0, :, :n]
    if problem.first is not None:
        S = S[:, :0]
    elif problem.arm:
        S[:, 0] = 0.0
    turned = J.transpose(0, 2, 1)
    H, g = turned @ J, (turned @ point.error[:, :, None])[:, :, 0]
    _add_limits(point, barrier, H, g)
    rest = np.arange(n + (problem.arm and problem.first is not None), 3 * n)
    H[-1, rest, rest] += _END
    g[-1, rest] += _END * point.s[-1, rest]
    return Quadratic(H, g, AB, S, point.u, RHO * h)


def _barrier(over: Array, height: float, parabola: float) -> tuple[Array, Array, Array]:
    """Return the barrier, its slope and its curvature at an excess over limits."""
    d, curved = np.minimum(-over, _NEAR), np.maximum(np.minimum(-over, _NEAR), parabola)
    change = d - curved
    slope = 1 / _NEAR - 1 / curved
    value = (
        curved / _NEAR - np.log(curved / _NEAR) - 1 + slope * change + (change / curved) ** 2 / 2
    )
    return (
        height * value,
        height * (change / curved**2 + slope) * -1,
        height * (d < _NEAR) / curved**2,
    )


def _add_limits(point: _Point, barrier: tuple[float, float], H: Array, g: Array) -> None:
    """Add the barriers at the limits."""
    problem, n = point.problem, point.problem.robot.n
    over, side = point.over
    _, slope, curvature = _barrier(over, *barrier)
    slope, curvature = problem.knot * slope * side, problem.knot * curvature
    speed, acceleration = problem.speeds
    slopes = np.concatenate([1 / speed, 1 / acceleration, np.ones(n)])
    columns = np.r_[n : 3 * n, :n]
    H[:, columns, columns] += curvature[:, n:] * slopes**2
    g[:, columns] += slope[:, n:] * slopes
    active = np.flatnonzero(curvature[:, :n].any(axis=1))
    if len(active):
        J = _tangent(problem.torque_use, point.s[active], _TORQUE_STEP)
        turned = J.transpose(0, 2, 1)
        H[active, : 3 * n, : 3 * n] += turned @ (curvature[active, :n, None] * J)
        g[active, : 3 * n] += (turned @ slope[active, :n, None])[:, :, 0]
