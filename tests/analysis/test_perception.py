"""Filters, canals and otoliths against closed forms."""

import numpy as np
import pytest

from sdt_drake.analysis.perception import canals, false_sensation_after_stop, low_pass

H = 0.005
TAU, TAU_A = 5.7, 80.0  # Rader, Oman & Merfeld 2009, Table T4


# --- filters ------------------------------------------------------------------------------------


@pytest.mark.parametrize("T", [0.003, 14.5])
def test_ramp_is_exact(T):
    """T y' + y = t from rest: y = t - T + T e^{-t/T}."""
    t = H * np.arange(4001)
    np.testing.assert_allclose(
        low_pass(t, T, H), t + T * np.expm1(-t / T), rtol=1e-9, atol=1e-12 * max(T, 1)
    )


def test_straight_pieces_as_a_step_by_step_solution():
    rng = np.random.default_rng(0)
    u = rng.normal(size=(60, 2, 3))
    T, h, fine = 0.02, 0.01, 200
    y = np.empty_like(u)
    y[0] = state = u[0]
    step = h / fine
    for i in range(len(u) - 1):
        for j in range(fine):  # trapezoidal rule
            a, b = (u[i] + (u[i + 1] - u[i]) * (j + s) / fine for s in (0, 1))
            state = (state * (1 - step / 2 / T) + step / T * (a + b) / 2) / (1 + step / 2 / T)
        y[i + 1] = state
    np.testing.assert_allclose(low_pass(u, T, h), y, atol=3e-6)


# --- canals -------------------------------------------------------------------------------------


def ramp_response(t):
    """Of tau tau_a s² / ((tau s + 1)(tau_a s + 1)) to t: difference of two decays."""
    return TAU * TAU_A / (TAU_A - TAU) * (np.exp(-t / TAU_A) - np.exp(-t / TAU))


def test_step_of_spin_decays():
    """(tau_a e^{-t/tau} - tau e^{-t/tau_a}) / (tau_a - tau), as the ramp to it gets shorter."""
    t = H * np.arange(12001)
    spin = np.where(t > 0, 1.0, 0.0)  # up within a sample
    sensed = canals(spin, H)
    exact_of_ramp = (ramp_response(t[1:]) - ramp_response(t[:-1])) / H
    np.testing.assert_allclose(sensed[1:], exact_of_ramp, atol=1e-9)
    step = (TAU_A * np.exp(-t / TAU) - TAU * np.exp(-t / TAU_A)) / (TAU_A - TAU)
    np.testing.assert_allclose(sensed[1:], step[1:], atol=H / TAU)
    assert sensed[-1] < 0  # adapted: it now seems to turn the other way, weakly


@pytest.mark.parametrize("hertz", [0.1, 5.0])
def test_sine_has_the_gain_and_phase_of_the_transfer_function(hertz):
    w = 2 * np.pi * hertz
    # Long after the start, over whole periods.
    t = np.arange(0, 900 + 4 / hertz, H)
    sensed = canals(np.sin(w * t), H)
    late = t >= t[-1] - 2 / hertz
    basis = np.column_stack([np.sin(w * t[late]), np.cos(w * t[late])])
    (a, b), *_ = np.linalg.lstsq(basis, sensed[late], rcond=None)
    s = 1j * w
    expected = TAU * TAU_A * s**2 / ((TAU * s + 1) * (TAU_A * s + 1))
    # Straight pieces instead of a sine: (w h)² / 12 smaller.
    assert a + 1j * b == pytest.approx(expected, abs=(w * H) ** 2 / 10 + 1e-4)


# --- after a stop -------------------------------------------------------------------------------


def spin_and_stop(rate_deg_s, hold):
    """About z: up within a sample, held, stopped within a sample; the others at rest."""
    t = np.arange(0, hold + 0.5, H)
    omega = np.zeros((len(t), 3))
    omega[(t > 0) & (t <= hold), 2] = np.radians(rate_deg_s)
    return omega


@pytest.mark.parametrize(("rate", "hold"), [(90, 60.0), (30, 300.0), (90, 2.0)])
def test_false_sensation_lasts_as_the_two_decays_say(rate, hold):
    def step(t):
        return (TAU_A * np.exp(-t / TAU) - TAU * np.exp(-t / TAU_A)) / (TAU_A - TAU)

    t = np.arange(0, 120, H)
    told = np.abs(rate * (step(t + hold) - step(t)))
    expected = t[np.argmax(told < 2.5)]
    after = false_sensation_after_stop(spin_and_stop(rate, hold), H)
    np.testing.assert_allclose(after, [0, 0, expected], atol=3 * H)
    if hold >= 60:
        assert 10 < after[2] < 25  # a graveyard spin


def test_without_a_stop_there_is_no_time_after_it():
    turning = np.ones((100, 3))
    for omega in (turning, 0 * turning, turning * np.radians(2.4) / np.sqrt(3)):
        assert np.isnan(false_sensation_after_stop(omega, H)).all()
