"""The observer of `sdt_drake.pilot.observer` at knots, for many motions of the head at once.

It leaves out the senses' cut-off of 2 Hz, which delays flight and device alike. A state has felt
gravity, low pass of the expected rate, and what cupula and nerve subtract from the rate. Arrays
`head` have specific force [m/s²] and angular rate [rad/s] of the head, shape (..., 6).
"""

import math
from dataclasses import dataclass, fields
from itertools import pairwise

import numpy as np

from sdt_drake.io.arrays import Array
from sdt_drake.pilot.head import GRAVITY
from sdt_drake.pilot.observer import PerceptionModel

STATES = 12
"""Number of states."""


@dataclass(frozen=True, eq=False)
class _Gains:
    """Gains and times of a model as arrays, and the steps per second of an accurate integration."""

    k_w: Array
    k_fw: Array
    k_fg: Array
    k_a: Array
    tau: Array
    tau_a: Array

    @property
    def steps(self) -> float:
        turning = (self.k_fg + self.k_fw / self.k_w) / (1 - self.k_a)
        return max(2.0, *turning, *(2 / self.tau))


def _gains(model: PerceptionModel) -> _Gains:
    return _Gains(*(np.array(getattr(model, one.name)) for one in fields(_Gains)))


def unfelt(head: Array) -> Array:
    """Return the steady state in which the force is felt as gravity, shape (..., 12)."""
    force, rate = head[..., :3], head[..., 3:]
    down = -force / np.maximum(np.linalg.norm(force, axis=-1, keepdims=True), 1e-9)
    return np.concatenate([down, 0 * rate, rate, 0 * rate], axis=-1)


def felt(model: PerceptionModel, state: Array, head: Array) -> Array:
    """Return felt gravity [G], rate [rad/s] and acceleration [m/s²], shape (..., 9)."""
    gravity, rate, acceleration, _ = _signals(_gains(model), state, head)
    return np.concatenate([gravity, rate, GRAVITY * acceleration], axis=-1)


def advanced(model: PerceptionModel, state: Array, before: Array, after: Array, h: float) -> Array:
    """Return the state after a time h [s] in which the head's motion changes linearly."""
    return _advanced(_gains(model), state, before, after, h)


def _advanced(model: _Gains, state: Array, before: Array, after: Array, h: float) -> Array:
    steps = math.ceil(h * model.steps)
    dt, change = h / steps, (after - before) / steps
    for i in range(steps):  # Runge-Kutta of order 4
        first = before + i * change
        k1 = _rates(model, state, first)
        k2 = _rates(model, state + dt / 2 * k1, first + change / 2)
        k3 = _rates(model, state + dt / 2 * k2, first + change / 2)
        k4 = _rates(model, state + dt * k3, first + change)
        state = state + dt / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return state


def followed(model: PerceptionModel, head: Array, h: float, first: Array | None = None) -> Array:
    """Return the states at knots, shape (N, 12), from a first one, shape (12,).

    By default the head has long moved as at the first knot.
    """
    states, gains = [unfelt(head[0]) if first is None else first], _gains(model)
    for before, after in pairwise(head):
        states.append(_advanced(gains, states[-1], before, after, h))
    return np.array(states)


def _signals(model: _Gains, state: Array, head: Array) -> tuple[Array, ...]:
    """Return felt gravity, rate and acceleration [G], and the tilt error."""
    gravity, otoliths = state[..., :3], head[..., :3] / -GRAVITY
    expected = (gravity - model.k_a * otoliths) / (1 - model.k_a)
    normal = _cross(otoliths, expected)
    sine = np.sqrt((normal * normal).sum(axis=-1, keepdims=True) + 1e-30)
    cosine = (otoliths * expected).sum(axis=-1, keepdims=True)
    error = normal * (np.arctan2(sine, cosine) / sine)
    sensed = head[..., 3:] - state[..., 6:9] - state[..., 9:]
    rate = model.k_fw / model.k_w * error + sensed + state[..., 3:6]
    return gravity, rate, model.k_a * (otoliths - expected), error


def _rates(model: _Gains, state: Array, head: Array) -> Array:
    gravity, rate, _, error = _signals(model, state, head)
    rates, cupula = np.empty_like(state), state[..., 6:9]
    rest = head[..., 3:] - cupula
    off = 1 - (gravity * gravity).sum(axis=-1, keepdims=True)
    rates[..., :3] = _cross(gravity, model.k_fg * error + rate) + off * gravity
    rates[..., 3:6] = (model.k_w / (model.k_w + 1) * rate - state[..., 3:6]) / model.tau
    rates[..., 6:9] = rest / model.tau
    rates[..., 9:] = (rest - state[..., 9:]) / model.tau_a
    return rates


def _cross(a: Array, b: Array) -> Array:
    """Return the vector product; `np.cross` is slower."""
    product = np.empty_like(a)
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        product[..., i] = a[..., j] * b[..., k] - a[..., k] * b[..., j]
    return product
