"""Temperatures of windings when a motion is flown again and again, back to back."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sdt_drake.io.arrays import Array
from sdt_drake.robot.robot import Robot
from sdt_drake.robot.windings import Windings
from sdt_drake.run.recording import Recording


def warmed(heat: Array, time_constant: ArrayLike, period: float) -> tuple[Array, Array]:
    """Return the relative rise that a motion gives a cold winding, and what is left of a warm one.

    The rise x of each part follows T dx/dt + x = (tau / tau_rated)². Within a period the heat is
    constant, and the solution exact.

    Args:
        heat: mean of (tau / tau_rated)² over each period [-], shape (N, n).
        time_constant: T of m parts [s], shape (n,) or (m, n).
        period: period of `heat` [s].

    Returns:
        Added rise and remaining share at the samples [-], each of shape (N + 1, m, n).
    """
    T = np.atleast_2d(np.asarray(time_constant, dtype=float))
    kept = np.exp(-period / T)
    cold = np.zeros((len(heat) + 1, *T.shape))
    for i, added in enumerate(heat):
        cold[i + 1] = kept * cold[i] + (1 - kept) * added
    return cold, np.exp(-period / T * np.arange(len(cold))[:, None, None])


def winding_temperature(
    heat: Array,
    time_constant: ArrayLike,
    period: float,
    pause: float = 0.0,
    share: ArrayLike = 1.0,
) -> Array:
    """Return the highest winding temperature theta of an endlessly repeated cycle, shape (n,).

    theta is relative to constant rated torque, in the sum of all parts. In the steady state a cycle
    of length t_c + t_p ends at the temperature theta_0 at which it started. With the temperature f
    at the end of a motion that starts cold, each part has

        theta_0 = f exp(-t_p / T) / (1 - exp(-(t_c + t_p) / T))

    Args:
        heat: mean of (tau / tau_rated)² over each period [-], shape (N, n).
        time_constant: thermal time constants T of m parts [s], shape (n,) or (m, n).
        period: period of `heat` [s].
        pause: rest t_p at the end of the cycle, without torque [s].
        share: shares of the parts [-], shape (m, n); all by default.

    >>> winding_temperature(np.ones((100, 1)), [1000.0], 0.1)  # rated torque without a pause
    array([1.])
    """
    cold, left = warmed(heat, time_constant, period)
    rest = np.exp(-pause / np.atleast_2d(np.asarray(time_constant, dtype=float)))
    start = cold[-1] * rest / (1 - left[-1] * rest)
    return np.asarray(((cold + start * left) * share).sum(axis=1).max(axis=0))


@dataclass(frozen=True, eq=False)
class Heat:
    """Temperatures of the windings in a motion and in its repetition; each of shape (n,)."""

    highest: Array
    """Highest temperature in the run [°C]."""
    endless: Array
    """Highest temperature if the motion is flown back to back for ever [°C]."""
    limit: Array
    """Largest allowed temperature [°C]."""
    time_to_limit: Array
    """Time from the first start to the limit, flown back to back [s]; inf if it is not reached."""

    def sentence(self, robot: Robot, duration: float) -> str:
        """Return whether the motion, of `duration` [s], may be flown back to back."""
        k = int(self.time_to_limit.argmin())
        if np.isfinite(self.time_to_limit[k]):
            flown, time = int(self.time_to_limit[k] // duration), self.time_to_limit[k]
            return (
                f"may not be flown back to back: the winding of {robot.joint(k)} reaches "
                f"{self.limit[k]:g} °C after {time:.4g} s, in flight {flown + 1}"
            )
        k = int((self.limit - self.endless).argmin())
        return (
            f"may be flown back to back: the winding of {robot.joint(k)} reaches "
            f"{max(self.endless[k], self.highest[k]):.4g} of {self.limit[k]:g} °C"
        )


def heat_of(recording: Recording, windings: Windings) -> Heat:
    """Return temperatures of a run whose motion is flown back to back from its initial state."""
    period = float(recording.time[1] - recording.time[0])
    duration = period * (len(recording.time) - 1)
    heat = (recording.tau_rms[1:] / windings.rated_torque) ** 2
    cold, left = warmed(heat, windings.time_constant, period)
    steady = cold[-1] / (1 - left[-1])

    def flight(i: float) -> Array:
        """Return the temperatures of flight i, from 0 [°C], shape (N + 1, n)."""
        start = steady + (windings.start - steady) * left[-1] ** i
        return windings.temperature(cold + start * left)

    def beyond(i: float) -> NDArray[np.bool_]:
        return np.asarray(flight(i).max(axis=0) > windings.limit)

    time = np.full(len(windings.limit), np.inf)
    for k in np.flatnonzero(beyond(0) | beyond(np.inf)).tolist():
        first, last = 0, 0  # it rises from flight to flight, or is too high in the first
        while not beyond(last)[k]:
            first, last = last + 1, 2 * last + 1
        while first < last:
            middle = (first + last) // 2
            first, last = (first, middle) if beyond(middle)[k] else (middle + 1, last)
        time[k] = first * duration + period * (flight(first)[:, k] > windings.limit[k]).argmax()
    highest, endless = flight(0).max(axis=0), flight(np.inf).max(axis=0)
    return Heat(highest, endless, windings.limit, time)
