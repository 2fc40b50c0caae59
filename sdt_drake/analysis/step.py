"""Step responses and their metrics."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from sdt_drake.io.arrays import Array


@dataclass(frozen=True)
class StepMetrics:
    """Metrics of a step response; NaN if the response does not reach a level.

    A response that returns, as after a step of the load, has no rise time and no overshoot.
    """

    rise_time: float
    """Time from the first crossing of 10 % to the first crossing of 90 % [s]."""
    settling_time: float
    """Time from the step to the **last** entry into the settling band [s]."""
    overshoot_percent: float
    """Distance of the peak beyond the final value, in percent of the step [%]."""
    peak: float
    """Value farthest from the start, in the direction of the step if there is one [unit of y]."""
    peak_time: float
    """Time from the step to the peak [s]."""
    steady_state_error: float
    """Last sample less `y_final` [unit of y]."""


@dataclass(frozen=True, eq=False)
class StepResponse:
    """A simulated step of motor speed from 0 to 1 rad/s."""

    setpoint_weight: float
    """Weight of the reference in the proportional part [-]: 1 for PI on the error, 0 for I-P."""
    zeta: float
    """Damping ratio [-]."""
    time: Array
    """Time since the step [s], shape (N,)."""
    speed: Array
    """Speed of the motor [rad/s], shape (N,)."""
    metrics: StepMetrics
    """Metrics of `speed`."""


def step_metrics(
    t: ArrayLike, y: ArrayLike, *, y0: float, y_final: float, band: float = 0.02
) -> StepMetrics:
    """Return the metrics of a response `y` from `y0` to `y_final`.

    Crossings are interpolated between samples. The step may go up or down, and from or to zero.

        >>> metrics = step_metrics([0, 1, 2, 3, 4], [0, 1, 2.2, 2, 2], y0=0, y_final=2)
        >>> round(metrics.overshoot_percent, 6), metrics.peak_time, metrics.steady_state_error
        (10.0, 2.0, 0.0)

    Args:
        t: time [s], growing, t[0] the time of the step; shape (N,).
        y: response, shape (N,).
        y0: value before the step.
        y_final: final value of an ideal response; y0 if it returns to its start.
        band: half width of the settling band, as a share of the step [-], or of the peak if the
            response returns.
    """
    t, y = np.asarray(t, dtype=float), np.asarray(y, dtype=float)
    if y_final == y0:
        i_peak = int(np.argmax(np.abs(y - y0)))
        share = (y - y0) / (y[i_peak] - y0 or 1.0)
        nan, settled = float("nan"), _settled(t, share, band) - t[0]
        peak, peak_time = float(y[i_peak]), float(t[i_peak] - t[0])
        return StepMetrics(nan, settled, nan, peak, peak_time, float(y[-1] - y_final))
    response = (y - y0) / (y_final - y0)  # 0 before the step, 1 when done
    i_peak = int(np.argmax(response))
    return StepMetrics(
        rise_time=_first_reach(t, response, 0.9) - _first_reach(t, response, 0.1),
        settling_time=_settled(t, response - 1, band) - t[0],
        overshoot_percent=100 * max(float(response[i_peak]) - 1, 0.0),
        peak=float(y[i_peak]),
        peak_time=float(t[i_peak] - t[0]),
        steady_state_error=float(y[-1] - y_final),
    )


def _first_reach(t: Array, response: Array, level: float) -> float:
    """Return the time at which the response first reaches the level; NaN if it does not."""
    reached = np.flatnonzero(response >= level)
    return _crossing(t, response - level, reached[0] if len(reached) else len(t))


def _settled(t: Array, deviation: Array, band: float) -> float:
    """Return the last time with |deviation| above the band; NaN if that is the end."""
    outside = np.flatnonzero(np.abs(deviation) > band)
    last = outside[-1] if len(outside) else -1
    return _crossing(t, deviation - np.copysign(band, deviation[last]), last + 1)


def _crossing(t: Array, f: Array, i: int) -> float:
    """Return the time of the zero of f between samples i - 1 and i.

    That is the first sample for i = 0, and NaN after the last one.
    """
    if not 0 < i < len(t):
        return float(t[0]) if i == 0 else float("nan")
    share = f[i - 1] / (f[i - 1] - f[i])
    return float(t[i - 1] + share * (t[i] - t[i - 1]))
