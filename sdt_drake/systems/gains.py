"""Tuning of the PI speed controllers, torque feedforward, and metrics of step responses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError
from sdt_drake.robot.dynamics import decouple
from sdt_drake.robot.robot import Robot

STRUCTURES = ("pi", "p_in_feedback")
"""PI on the speed error, or with the proportional gain in the feedback path (Figure 5)."""


@dataclass(frozen=True, eq=False)
class SpeedGains:
    """Gains of n speed controllers, **motor side**: on motor speed, giving motor torque.

    Attributes:
        kp: K_PS [N m s/rad], shape (n,).
        ki: K_IS [N m/rad], shape (n,).
    """

    kp: Array
    ki: Array


def tune(
    i_eff_max: ArrayLike, omega_r: float, zeta: ArrayLike, omega_ratio: float = 0.5
) -> SpeedGains:
    """K_IS = (ratio omega_r)² I_eff,max and K_PS = 2 zeta sqrt(I_eff,max K_IS).

    So omega_n = ratio omega_r at the largest inertia; with the paper's 0.5, K_IS = 0.25 omega_r² I
    and the loop stays an octave below the structure.

    Args:
        i_eff_max: largest effective inertia, motor side [kg m²], shape (n,).
        omega_r: lowest natural frequency of the structure [rad/s].
        zeta: damping ratio wanted at the largest inertia [-], shape (n,) or one for all.
        omega_ratio: omega_n / omega_r [-].

    Raises:
        InputError: if the gains are too large or too small for numbers.
    """
    i_eff_max, zeta = np.asarray(i_eff_max, dtype=float), np.asarray(zeta, dtype=float)
    with np.errstate(over="ignore"):
        ki = np.square(omega_ratio * omega_r) * i_eff_max
        kp = 2 * zeta * np.sqrt(i_eff_max * ki)
    if not np.all(np.isfinite(kp)):
        raise InputError(
            f"gains too large for a number: inertia {i_eff_max.tolist()} kg m², "
            f"omega_r {omega_r:g} rad/s, zeta {zeta.tolist()}"
        )
    if np.any(kp <= 0) or np.any(ki <= 0):
        raise InputError(
            f"omega_r: {omega_r:g} rad/s gives gains too small for a number, expected more"
        )
    return SpeedGains(kp=kp, ki=ki)


def natural_frequency(gains: SpeedGains, i_eff: ArrayLike) -> Array:
    """omega_n = sqrt(K_IS / I_eff) [rad/s], from Eq. 5; I_eff motor side [kg m²], shape (n,)."""
    return np.sqrt(gains.ki / np.asarray(i_eff))


def damping_ratio(gains: SpeedGains, i_eff: ArrayLike) -> Array:
    """zeta = K_PS / (2 sqrt(I_eff K_IS)) [-] (Eq. 6); I_eff motor side [kg m²], shape (n,)."""
    return gains.kp / (2 * np.sqrt(np.asarray(i_eff) * gains.ki))


def oscillation_frequency(gains: SpeedGains, i_eff: ArrayLike) -> Array:
    """omega_0 = omega_n sqrt(1 - zeta²) [rad/s]; 0 where zeta >= 1. I_eff motor side [kg m²]."""
    zeta = np.minimum(damping_ratio(gains, i_eff), 1.0)
    return natural_frequency(gains, i_eff) * np.sqrt(1 - zeta**2)


# --- torque feedforward ---------------------------------------------------------------------

FEEDFORWARDS = ("none", "ctc", "id")
"""None, the load torque of Algorithm 1, or the whole inverse dynamics."""


def feedforward_torque(
    feedforward: str, model: Robot, groups: Sequence[ArrayLike], vd: Array, sign: str
) -> Array:
    """What the model says that the motors need, **motor side** [N m], shape (n,) or (N, n).

        "ctc":  tau_LD of Algorithm 1
        "id":   (inertial + reaction + velocity + gravity + r² I_m vd) / r

    Args:
        feedforward: "none", "ctc" or "id".
        model: what the controller takes the robot for.
        groups: its torque groups (Eq. 2), joint side: inertial, reaction, velocity, gravity.
        vd: reference acceleration, joint side [rad/s²].
        sign: of Algorithm 1's third branch.
    """
    inertial, reaction, velocity, gravity = (np.asarray(group) for group in groups)
    coupled = reaction + velocity + gravity
    if feedforward == "none":
        return np.zeros_like(inertial)
    if feedforward == "ctc":
        return decouple(inertial, coupled, model.gear_ratio, sign).load_torque
    return (inertial + coupled + model.reflected_inertia * vd) / model.gear_ratio


# --- step responses -------------------------------------------------------------------------


@dataclass(frozen=True)
class StepMetrics:
    """What a step response is judged by; NaN where the response never gets there.

    Attributes:
        rise_time: from the first crossing of 10 % to the first of 90 % [s].
        settling_time: from the step to the **last** entry into the band [s].
        overshoot_percent: how far the peak is beyond the final value, of the step [%].
        peak: value farthest from the start in the direction of the step [unit of y].
        peak_time: when [s].
        steady_state_error: last sample less `y_final` [unit of y].
    """

    rise_time: float
    settling_time: float
    overshoot_percent: float
    peak: float
    peak_time: float
    steady_state_error: float


def step_metrics(
    t: ArrayLike, y: ArrayLike, *, y0: float, y_final: float, band: float = 0.02
) -> StepMetrics:
    """Metrics of a response `y` from `y0` towards `y_final`.

    Crossings are interpolated between samples. The step may go up or down, and from or to zero.

    Args:
        t: time [s], growing, t[0] the time of the step; shape (N,).
        y: response, shape (N,).
        y0: value before the step.
        y_final: value that the response should reach, not y0.
        band: half width of the settling band, as a share of the step [-].
    """
    t, y = np.asarray(t, dtype=float), np.asarray(y, dtype=float)
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
    reached = np.flatnonzero(response >= level)
    return _crossing(t, response - level, reached[0] if len(reached) else len(t))


def _settled(t: Array, deviation: Array, band: float) -> float:
    """When |deviation| exceeds the band for the last time; NaN if it still does at the end."""
    outside = np.flatnonzero(np.abs(deviation) > band)
    last = outside[-1] if len(outside) else -1
    return _crossing(t, deviation - np.copysign(band, deviation[last]), last + 1)


def _crossing(t: Array, f: Array, i: int) -> float:
    """Where f crosses zero between samples i - 1 and i: at the first sample for 0, NaN after the
    last one."""
    if not 0 < i < len(t):
        return float(t[0]) if i == 0 else float("nan")
    share = f[i - 1] / (f[i - 1] - f[i])
    return float(t[i - 1] + share * (t[i] - t[i - 1]))
