"""Detectors against the laws they come from."""

import numpy as np
import pytest

from sdt_drake.analysis.perception import DETECTORS

H = 0.005
LONG, SHORT = DETECTORS
AXES = np.array([2.04, 2.07, 1.58]) / 1.58  # Benson, Hutt & Brown 1989


def yaw(rate_deg_s):
    """About z alone [rad/s], (N, 3)."""
    omega = np.zeros((len(rate_deg_s), 3))
    omega[:, 2] = np.radians(rate_deg_s)
    return omega


def times(duration):
    return np.arange(0, duration + H / 2, H)


@pytest.mark.parametrize("t", [0.5, 1, 2, 3, 5, 10, 20])
def test_constant_acceleration_is_felt_from_rodenburgs_threshold_on(t):
    """a_thr(t) = C / (1 - e^{-t/tau1}), C = 0.22 deg/s², tau1 = 14.5 s."""
    threshold = 0.22 / (1 - np.exp(-t / 14.5))
    multiples = LONG.multiples(yaw(threshold * times(t)), H)[:, 2]
    assert multiples[-1] == pytest.approx(1, rel=1e-9)
    assert multiples.argmax() == len(multiples) - 1


@pytest.mark.parametrize(("acceleration", "duration"), [(8, 0.25), (0.25, 8)])
def test_mulders_worked_cases_are_not_perceived(acceleration, duration):
    """Army Aviation AV0593; by the long detector, which is of that law."""
    t = times(duration + 20)
    rate = acceleration * np.minimum(t, duration)
    assert LONG.multiples(yaw(rate), H).max() < 1
    assert LONG.multiples(yaw(2 * rate), H).max() == pytest.approx(
        2 * LONG.multiples(yaw(rate), H).max()
    )


# Grabherr et al. 2008: yaw, direction recognised [Hz, deg/s].
GRABHERR = {0.05: 2.8, 0.1: 2.5, 0.2: 1.7, 0.5: 0.7, 1: 0.6, 2: 0.4, 5: 0.6}


def bell(hertz):
    """One period of a sine of acceleration, to 1 deg/s."""
    t = np.arange(0, 1 / hertz + 5, 1e-3)
    return yaw(np.where(t < 1 / hertz, (1 - np.cos(2 * np.pi * hertz * t)) / 2, 0))


@pytest.mark.parametrize("hertz", GRABHERR)
def test_no_bell_that_was_felt_is_missed(hertz):
    multiple = GRABHERR[hertz] * SHORT.multiples(bell(hertz), 1e-3).max()
    assert 1 <= multiple < 2


def test_the_level_is_the_largest_that_misses_none():
    multiples = [v * SHORT.multiples(bell(f), 1e-3).max() for f, v in GRABHERR.items()]
    assert min(multiples) == pytest.approx(1, abs=0.01)


@pytest.mark.parametrize("hertz", GRABHERR)
def test_a_steady_sine_goes_through_the_high_pass_of_the_fit(hertz):
    t = np.arange(0, 20 + 2 / hertz, 1e-3)
    multiples = SHORT.multiples(yaw(np.sin(2 * np.pi * hertz * t)), 1e-3)[:, 2]
    w = 2 * np.pi * hertz
    threshold = 0.30 * np.sqrt(1 + 1 / (0.70 * w) ** 2)
    assert 1 / multiples[t > 20].max() == pytest.approx(threshold, rel=2e-3)


@pytest.mark.parametrize("detector", DETECTORS, ids=lambda d: d.name)
def test_roll_and_pitch_take_more_by_bensons_ratios(detector):
    rate = np.repeat(yaw(10 * np.sin(times(10)))[:, 2:], 3, axis=1)
    multiples = detector.multiples(rate, H)
    np.testing.assert_allclose(multiples * AXES, np.repeat(multiples[:, 2:], 3, axis=1), rtol=1e-12)
