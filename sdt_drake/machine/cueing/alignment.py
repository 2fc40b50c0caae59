"""Starts and baselines of the search: rest, alignment with the flight's force, classical washout.

At rest, gravity has the mean direction of the flight at the head. An alignment turns the device so
that the head has the direction and size of the flight's force.
"""

from collections.abc import Sequence

import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.optimize import least_squares

from sdt_drake.io.arrays import Array
from sdt_drake.machine.cueing.problem import SPEED_SHARE, Problem
from sdt_drake.pilot.canals import low_pass
from sdt_drake.pilot.head import GRAVITY, head_motion

_STEPS, _FIRST_STEPS = 3, 30  # Newton steps at each knot, and at the first one
_HELD, _FIRST_HELD = 0.05, 1e-3  # weight of the distance from the knot before
_MAX_STEP = 0.3  # of Newton's method [rad, or rad/s of an arm]
_MIN_ARM_SPEED = 0.05  # rad/s; keeps the sense of rotation of the arm

WASHOUT = 1.0
"""Time constant of the return from a rotation, in a classical washout [s]."""

TILT = 1.0
"""Time constant of the low pass of its tilt [s]."""

_POSTURES = 8  # starts of the search for a posture
_OVERLOAD = 10.0  # weight of torque beyond its limit, as a share, beside the tilt [rad]
_UNTURNED = 1e-3  # weight of the angles of a posture beside the tilt

Start = tuple[int, float]
"""Sense of rotation of the arm, 1 or -1, and first angle of the last joint [rad]."""


def standing(problem: Problem, up: Array) -> Array:
    """Return the angles at which the head of the resting device has a direction up, shape (n,).

    The tilt is the closest one to it that the stops and the torques allow.

    Args:
        problem: The problem.
        up: Direction up in axes of the head [-], unit length.
    """
    n = problem.robot.n
    lower, upper = np.maximum(problem.lower, -np.pi), np.minimum(problem.upper, np.pi)
    lower, upper = np.minimum(lower, problem.upper - 1e-6), np.maximum(upper, problem.lower + 1e-6)
    first = np.clip(np.zeros(n), lower, upper)
    draws = np.random.default_rng(0).uniform(lower, upper, (_POSTURES - 1, n))

    def off(q: Array) -> Array:
        """Return the residuals of postures, shape (N, 3 + 2 n)."""
        still = np.hstack([q, np.zeros((len(q), 2 * n))])
        load = np.maximum(np.abs(problem.torque_use(still)) - 1, 0)
        tilt = problem.head_at(still)[:, :3] / GRAVITY - up
        return np.hstack([tilt, _OVERLOAD * load, _UNTURNED * (q - first)])

    def slope(q: Array) -> Array:
        before, after = np.split(off(q + 1e-6 * np.vstack([-np.eye(n), np.eye(n)])), 2)
        return (after - before).T / 2e-6

    found = [
        least_squares(lambda q: off(q[None])[0], q, slope, bounds=(lower, upper))
        for q in (first, *draws)
    ]
    return np.asarray(min(found, key=lambda one: one.cost).x)


def aligned(problem: Problem, starts: Sequence[Start]) -> Array:
    """Return angles at which the head has the flight's force at each knot.

    All joints are at rest, except for an arm at constant speed. Its speed [rad/s] takes the place
    of its angle. Each knot follows from the one before by Newton's method, and stays close to it
    where the force does not decide.

    Args:
        problem: The problem.
        starts: Senses of rotation and first angles.

    Returns:
        Angles [rad], shape (starts, N, n).
    """
    spin = np.array([float(sense) for sense, _ in starts])
    x = np.zeros((len(starts), problem.robot.n))
    x[:, -1] = [seat for _, seat in starts]
    if problem.arm:
        x[:, 0] = spin
    goals = problem.head[:, :3] / GRAVITY
    x = nearer(problem, x, goals[0], spin, first=True)
    found = []
    for goal in goals:
        x = nearer(problem, x, goal, spin)
        found.append(x)
    return np.stack(found, axis=1)


def nearer(problem: Problem, x: Array, goal: Array, spin: Array, *, first: bool = False) -> Array:
    """Return angles in the form of `aligned` after steps of Newton's method to a force.

    Args:
        problem: The problem.
        x: Angles to begin with, shape (starts, n).
        goal: Force at the head [G], shape (3,).
        spin: Senses of rotation of the arm, shape (starts,).
        first: True for more steps, which may lead far.
    """
    n = problem.robot.n
    steps, held = (_FIRST_STEPS, _FIRST_HELD) if first else (_STEPS, _HELD)
    lower, upper = problem.stops(SPEED_SHARE * problem.robot.top_speed[0])
    moves = 1e-5 * np.vstack([np.zeros(n), np.eye(n), -np.eye(n)])
    before = x = np.clip(x, lower, upper)
    for _ in range(steps):
        shown = _static_force(problem, (x[:, None] + moves).reshape(-1, n))
        shown = shown.reshape(len(x), -1, 3)
        J = ((shown[:, 1 : n + 1] - shown[:, n + 1 :]) / 2e-5).transpose(0, 2, 1)
        A = J.transpose(0, 2, 1) @ J + held * np.eye(n)
        b = np.einsum("sij,si->sj", J, goal - shown[:, 0]) - held * (x - before)
        step = np.linalg.solve(A, b[..., None])[..., 0]
        x = np.clip(x + np.clip(step, -_MAX_STEP, _MAX_STEP), lower, upper)
        if problem.arm:
            x[:, 0] = spin * np.maximum(spin * x[:, 0], _MIN_ARM_SPEED)
    return x


def _static_force(problem: Problem, x: Array) -> Array:
    """Return the head's force with an arm at constant speed and all else at rest [G]."""
    q, v = x.copy(), np.zeros_like(x)
    if problem.arm:
        q[:, 0], v[:, 0] = 0.0, x[:, 0]
    return head_motion(problem.robot, q, v, np.zeros_like(x)).specific_force / GRAVITY


def angles(problem: Problem, x: Array, smooth: float, approach: float, departure: float) -> Array:
    """Return smoothed angles of an alignment, with an arm that starts and ends at rest.

    Args:
        problem: The problem.
        x: Result of `aligned` for one start, shape (N, n).
        smooth: Standard deviation of the Gaussian filter [s].
        approach: Time from rest to the flight [s].
        departure: Time from the flight to rest [s].

    Returns:
        Angles [rad], shape (N, n).
    """
    q = gaussian_filter1d(x, smooth / problem.knot, axis=0, mode="nearest")
    if problem.arm:
        time = problem.knot * np.arange(problem.count)
        rise, fall = time / (0.7 * approach), (time[-1] - time) / (0.7 * departure)
        share = np.prod([np.clip(s, 0, 1) ** 2 * (3 - 2 * np.clip(s, 0, 1)) for s in (rise, fall)],
                        axis=0)  # fmt: skip
        speed = q[:, 0] * share
        steps = problem.knot * (speed[1:] + speed[:-1]) / 2
        q[:, 0] = np.concatenate([[0.0], np.cumsum(steps)])
    return q


def washed_out(problem: Problem, x: Array) -> Array:
    """Return the angles of a classical washout, in the form of `aligned`, shape (N, n).

    The arm and a tilt give the low-frequency part of the force. The gimbals follow the
    high-frequency part of the rate and return. A high pass and an integrator of the rate are
    together tau LP(rate), with the same time constant tau.
    """
    tilt = low_pass(x, TILT, problem.knot)
    rate = low_pass(problem.head[:, 3:] - problem.head[0, 3:], WASHOUT, problem.knot)
    return turned(problem, tilt, WASHOUT * rate)


def turned(problem: Problem, tilt: Array, rotation: Array) -> Array:
    """Return tilts whose gimbals turn the head further by rotations [rad], shape (N, n)."""
    rest, first = np.zeros_like(tilt), int(problem.arm)
    J = np.stack(
        [
            head_motion(problem.robot, tilt * (np.arange(tilt.shape[1]) >= first), rest + one, rest)
            .angular_velocity
            for one in np.eye(tilt.shape[1])[first:]
        ],
        axis=2,
    )  # fmt: skip
    square = J.transpose(0, 2, 1) @ J + _HELD * np.eye(J.shape[2])
    gimbals = np.linalg.solve(square, J.transpose(0, 2, 1) @ rotation[..., None])[..., 0]
    moved = np.hstack([tilt[:, :first], tilt[:, first:] + gimbals])
    return np.asarray(np.clip(moved, *problem.stops(np.inf)))
