"""Frequency responses by hand; margins and steps of random loops against python-control."""

import dataclasses

import control
import numpy as np
import pytest
from helpers.modes import moving, same
from helpers.strategies import GENERATORS
from helpers.variants import kind, overruled, weaker
from hypothesis import Phase, given, settings
from hypothesis import strategies as st
from oracles.by_hand import GEAR, ROTORS
from oracles.python_control import crossings_of, pi_loop, process

from sdt_drake.analysis.frequency_response import (
    _critical_gains,
    frequency_response,
    unwrapped_degrees,
)
from sdt_drake.analysis.linear import linearise
from sdt_drake.motion import Motion
from sdt_drake.robot.device import Drive, Elasticity, Friction
from sdt_drake.robot.dynamics import Loads
from sdt_drake.run.simulate import simulate

STEP = Motion.from_speeds(0.005, np.zeros(4), np.repeat([[0.0] * 4, [1.0] * 4], [1, 40], axis=0))


@settings(max_examples=8, phases=[Phase.generate])  # shrinking would take minutes
@given(
    rng=GENERATORS,
    weight=st.sampled_from([0, 0.3, 1]),
    period=st.sampled_from([None, 0.001, 0.005]),
    lag=st.sampled_from([None, 30.0, 200.0]),
    springs=st.sampled_from([None, (120.0, 0.2), (300.0, 0.5)]),
    encoder=st.sampled_from(["motor", "link"]),
    by_differences=st.booleans(),
)
def test_frequency_responses_equal_python_control(
    designed, rng, weight, period, lag, springs, encoder, by_differences
):
    by_differences = by_differences and period is not None  # with encoders, of positions
    inertia, (zeta, share) = ROTORS * rng.uniform(3, 20, 4), rng.uniform(0.3, 1.2, (2, 4))
    omega_n = 4 * 60 ** rng.uniform(0, 1, 4)
    omega_n[0] = 1000 if period == 0.005 else omega_n[0]  # unstable
    kp, ki = 2 * zeta * omega_n * inertia, omega_n**2 * inertia
    viscous, error = share * kp, 0.2 * (share - 0.7)
    gains = {"kp": kp.tolist(), "ki": ki.tolist(), "omega_r": None, "zeta": None}
    elasticity = springs and Elasticity([springs[0]] * 4, springs[1], encoder)
    encoders = {"encoder_resolution": [1e9] * 4} if by_differences else {}
    drive = Drive(period=period, torque_bandwidth=lag, torque_error=error.tolist(), **encoders)
    fields = kind("pi", setpoint_weight=weight, **gains) | {
        "plant.i_eff": inertia.tolist(),
        "plant.friction": Friction(viscous=(viscous * GEAR**2).tolist()),
        "plant.elasticity": elasticity or Elasticity(),
        "drive": drive,
    }
    design = designed("axis_pi", fields, motion=STEP)
    response = frequency_response(design, points=800)
    omega, simulated = response.omega, None
    if response.stable.all():
        unloaded = overruled(weaker(design, 1e3), loads=Loads(*np.zeros((2, *STEP.v.shape))))
        simulated = simulate(unloaded).v

    for k in range(4):
        P = process(inertia[k], ROTORS[k], viscous[k], lag, error[k], springs, encoder)
        loop, closed = pi_loop(P, kp[k], ki[k], weight, period, by_differences)
        gain, tracking = (x.frequency_response(omega).complex for x in (loop, closed))
        np.testing.assert_allclose(response.loop_gain[:, k], gain, rtol=1e-3)
        same(response.tracking[:, k], tracking, 1e-4)
        size = np.abs(tracking)
        assert response.peak_db[k] == pytest.approx(20 * np.log10(size.max()), abs=1e-5)
        at, level = (response.bandwidth[k], response.peak_omega[k]), 0.5**0.5
        expected = level if size[-1] < level else np.nan, size.max()
        np.testing.assert_allclose(np.interp(at, omega, size), expected, rtol=0.03)
        assert np.all(size[omega > at[0]] < level)

        poles = control.feedback(loop, 1).poles().astype(complex)
        modes = moving(np.log(poles + 1e-300) / period if period else poles, 0.01)
        damping = np.min(-modes.real / np.abs(modes))
        assert response.damping[k] == pytest.approx(damping, abs=1e-6)
        assert response.stable[k] == (damping > 0)

        gains, angles, crossings = crossings_of(gain, omega, period)
        found = (response.gain_margin, response.gain_reduction, response.crossover)
        expected = min(gains[gains > 1], default=np.inf), max(gains[gains < 1], default=0)
        np.testing.assert_allclose(
            [x[k] for x in found], [*expected, max(crossings, default=np.nan)], rtol=0.01
        )
        smallest = min(np.abs(angles), default=np.nan)
        assert response.phase_margin[k] == pytest.approx(smallest, abs=1, nan_ok=True)
        assert response.modulus_margin[k] == pytest.approx(np.abs(1 + gain).min(), rel=1e-4)

        if simulated is not None:
            held = closed if period else control.sample_system(closed, STEP.period, "zoh")
            each = round(STEP.period / held.dt)
            speeds = control.forced_response(held, U=np.repeat(STEP.v[:, k], each)).outputs
            same(simulated[:, k], speeds[::each], 1e-5)


# --- margins of coupled loops ----------------------------------------------------------------


def fastest_growth(loop, k, factor):
    """Of all modes of a loop, the gain of joint k changed: the largest |z| - 1, or real part."""
    opened, n = loop.opened, loop.n
    back = opened.C[:n] if loop.at_positions else opened.C[4 * n :]
    gain = np.where(np.arange(n) == k, factor, 1)
    modes = np.linalg.eigvals(opened.A + opened.B[:, :n] * gain @ back)
    return np.abs(modes).max() - 1 if opened.period else modes.real.max()


@pytest.mark.parametrize(
    ("fields", "sample", "at_rest", "limited"),
    [
        ({"drive": Drive(period=0.001, encoder_resolution=[2.0**22] * 4)}, None, False, 4),
        (kind("inverse_dynamics"), None, False, 4),
        (kind("p_pi") | {"drive": Drive(period=0.001)}, None, False, 4),
        # Less gain does not hold what gravity overturns, and centrifugal force; no oscillation.
        (kind("pi", omega_r=10.0), 4000, True, 2),
        (kind("pi", omega_r=10.0), 4000, False, 3),
    ],
)
def test_gain_margins_bring_a_mode_to_its_stability_limit(
    designed, fields, sample, at_rest, limited
):
    design = designed("coupled_pi", fields)
    response = frequency_response(design, sample=sample, points=700, at_rest=at_rest)
    factors = response.gain_margin if sample is None else response.gain_reduction
    found = np.flatnonzero(np.isfinite(factors) & (factors > 0))
    assert len(found) == limited
    for k in found:
        loop = linearise(design, int(response.sample[k]), at_rest=at_rest)
        outwards = np.sign(factors[k] - 1)
        assert fastest_growth(loop, k, factors[k] * (1 - 0.01 * outwards)) < 1e-9
        assert fastest_growth(loop, k, factors[k] * (1 + 0.01 * outwards)) > 6e-5


# --- phases ----------------------------------------------------------------------------------


def test_a_gain_that_is_real_at_the_first_frequency_counts_as_that_of_frequency_0():
    gain = -2 * np.exp(1j * np.array([1e-9, 0.5]))
    assert _critical_gains(np.array([1.0, 2.0]), gain) == pytest.approx([0.5])


@settings(max_examples=10, phases=[Phase.generate])
@given(GENERATORS)
def test_unwrapped_phase_has_no_jumps_and_is_that_of_the_response(rng):
    """At the last crossover, or the end if there is none, it lies between -270 and 90 deg."""
    omega = np.geomspace(0.01, 100, 2000)
    s = 1j * omega[:, None]
    zeros, poles = rng.uniform(0.05, 20, (2, 3, 6))
    factors = (s + zeros[:, None]) / (s + poles[:, None]) / s ** rng.integers(0, 2, (3, 1, 1))
    response = np.prod(factors, axis=0) * rng.choice([-1, 1], 6) * 10 ** rng.uniform(-9, 1, 6)
    for at_crossover in (False, True):
        phase = unwrapped_degrees(response, at_crossover=at_crossover)
        assert np.abs(np.diff(phase, axis=0)).max() < 5
        np.testing.assert_allclose(np.exp(1j * np.radians(phase)), response / np.abs(response))
    above = [np.flatnonzero(np.abs(x) >= 1) for x in response.T]
    last = [i[-1] if len(i) else -1 for i in above]
    assert np.all(np.abs(phase[last, range(6)] + 90) <= 180 + 1e-9)
    assert np.all(np.abs(unwrapped_degrees(response)[0]) <= 180 + 1e-9)


def test_file_has_sizes_and_phases_of_both_responses(design):
    """The loop gain's phase is told at its crossover, that of tracking from its start."""
    response = frequency_response(design, points=50)
    lag = response.omega[:, None] / response.omega[10]
    falling = 100 / (1 + 1j * lag) ** 5 * np.ones(4)  # -333 deg at its crossover
    response = dataclasses.replace(response, loop_gain=falling)
    columns = response.results("a title").columns
    for name, at_crossover in ("tracking", False), ("loop_gain", True):
        values = getattr(response, name)
        phase = unwrapped_degrees(values, at_crossover=at_crossover)
        np.testing.assert_array_equal(columns[f"{name}_phase"], phase)
        np.testing.assert_array_equal(columns[f"{name}_magnitude"], np.abs(values))
    assert not np.allclose(phase, unwrapped_degrees(falling))
