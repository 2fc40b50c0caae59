"""Characteristics of acceptance tests, against formulas: sines, noise, play, lags, poses."""

import numpy as np
import pytest
from scipy import stats

from sdt_drake.machine.accept import characteristics as ch
from sdt_drake.machine.accept.shapes import joined, sine, steps, triangle, turns

M, N = 200, 6
PHASE = 2 * np.pi * np.arange(N * M).reshape(N, M) / M


def test_interval_of_a_mean_is_that_of_students_t():
    x = np.array([1.0, 2.0, 4.0, 4.5])
    low, high = stats.ttest_1samp(x, 0.0).confidence_interval(0.95)
    assert ch.estimate(np.mean, x) == pytest.approx((x.mean(), low, high))


def test_intervals_contain_the_truth_nineteen_times_in_twenty():
    rng = np.random.default_rng(1)
    found = [ch.estimate(lambda x: x.std() ** 2, rng.normal(0, 1, (12, 50))) for _ in range(400)]
    assert 0.91 < np.mean([x.low <= 1 <= x.high for x in found]) < 0.98


def test_gain_and_phase_are_those_of_the_fundamental_whatever_drifts():
    y = 0.8 * np.sin(PHASE - 0.3) + 0.1 * np.sin(3 * PHASE) + 0.02 * PHASE + 5
    found = ch.describing(np.sin(PHASE), y)
    assert found["gain"].value == pytest.approx(20 * np.log10(0.8), abs=1e-9)
    assert found["phase"].value == pytest.approx(-0.3, abs=1e-9)
    assert found["phase"].high - found["phase"].low < 1e-9


def test_phase_interval_does_not_break_at_half_a_turn():
    y = np.sin(PHASE + np.pi + np.array([0.01, -0.01] * (N // 2))[:, None])
    found = ch.describing(np.sin(PHASE), y)["phase"]
    assert found.high - found.low < 0.1


def test_parts_of_noise_are_harmonics_and_the_rest():
    rng = np.random.default_rng(0)
    y = 2 * np.sin(PHASE) + 0.1 * np.cos(2 * PHASE) + 0.06 * np.sin(3 * PHASE)
    y = y + 0.08 * np.sin(7 * PHASE)
    found = {name: x.value for name, x in ch.noises(2 * np.sin(PHASE), y).items()}
    assert found["low_nonlinearity"] == pytest.approx(np.hypot(0.1, 0.06) / 2)
    assert found["high_nonlinearity"] == pytest.approx(0.04)
    assert found["noise"] == pytest.approx(np.sqrt(0.1**2 + 0.06**2 + 0.08**2) / 2)
    rough = ch.noises(2 * np.sin(PHASE), y + rng.normal(0, 0.2, y.shape))
    expected = np.sqrt(2 * 0.2**2 + 0.1**2 + 0.06**2 + 0.08**2) / 2
    assert rough["noise"].low <= expected <= rough["noise"].high


def test_harmonics_of_the_command_itself_are_no_noise():
    u = np.sin(PHASE) + 0.3 * np.sin(2 * PHASE) + 1
    assert ch.noises(u, u)["noise"].value == pytest.approx(0, abs=1e-12)


def test_peak_noise_is_the_spike():
    y = np.sin(PHASE)
    y[:, 50] += 0.5
    off = np.zeros(M)
    off[50] = 0.5
    off -= 0.5 / M * (1 + 2 * np.cos(2 * np.pi * (np.arange(M) - 50) / M))  # mean and fundamental
    expected = np.abs(off).max() / (1 + 2 * 0.5 / M)
    assert ch.noises(np.sin(PHASE), y)["peak_noise"].value == pytest.approx(expected)


def off_of_a_triangle(cycle, play, lag, drift):
    """Return q - q_ref in the cycles of a triangle of a speed of 4 / cycle, with a gear's play."""
    shape, period = triangle(cycle, 4, 0.005), 0.005
    u = shape.p
    v = np.gradient(u, period)
    y, at = np.empty_like(u), 0.0
    for i, x in enumerate(u):  # the motor pushes the link from one end of the play or the other
        at = min(max(at, x - play / 2), x + play / 2)
        y[i] = at
    off = y - lag * v + drift * np.arange(len(u)) * period - u
    first, m = round(shape.start / period), round(shape.cycle / period)
    return off[first : first + 4 * m].reshape(4, m)


def test_hysteresis_is_the_play_whatever_lags_and_drifts():
    fast, slow = (off_of_a_triangle(cycle, 0.03, 0.02, 0.005) for cycle in (4.0, 8.0))
    assert ch.loop_widths(fast) == pytest.approx(0.03 + 2 * 0.02 * 1.0, rel=1e-3)
    found = ch.hysteresis(fast, slow)["hysteresis"]
    assert found.value == pytest.approx(0.03, rel=1e-3)


@pytest.mark.parametrize("delay", [0.0, 0.02])
def test_threshold_of_a_lag_is_its_time_and_its_delay(delay):
    period, tau = 0.001, 0.05
    shape = steps(0.5, 3, period)
    a = np.diff(np.pad(shape.p, 1, mode="edge"), 2) / period**2
    assert set(a.round(6)) == {-1, 0, 1}
    y, share = np.zeros_like(a), 1 - np.exp(-period / tau)
    late = np.concatenate([np.zeros(round(delay / period)), a])[: len(a)]
    for i in range(1, len(a)):
        y[i] = y[i - 1] + share * (late[i] - y[i - 1])
    first, m = round(shape.start / period), round(shape.cycle / period)
    u, y = (2.5 * x[first : first + 3 * m].reshape(3, m) for x in (a, y))
    found = ch.threshold(u, y, 2.5, period)["threshold"]
    assert found.value == pytest.approx(delay - tau * np.log(0.37), abs=2 * period)
    assert np.isinf(ch.threshold(u, 0.5 * y, 2.5, period)["threshold"].value)


def test_poses_count_the_distance_of_the_mean_and_the_spread():
    off = np.zeros((3, 2, 3))
    off[:, 1, 0] = [0.01, 0.02, 0.03]
    found = {name: x.value for name, x in ch.poses(off).items()}
    away = np.array([0.01, 0.0, 0.01])
    assert found["pose_accuracy"] == pytest.approx(0.02)
    assert found["pose_repeatability"] == pytest.approx(away.mean() + 3 * away.std(ddof=1))


def test_a_path_counts_what_is_across_it_alone():
    along = np.tile([2.0, 0.0, 0.0], (50, 1))
    off = np.zeros((4, 50, 3))
    off[..., 0] = -0.5  # late
    off[:, 20, 1] = 0.003
    assert ch.path(off, along)["path_accuracy"].value == pytest.approx(0.003)


def test_derivatives_are_those_of_a_sine_below_the_band():
    period, f = 0.005, 2.0
    t = np.arange(2000) * period
    x = np.sin(2 * np.pi * f * t)[:, None] + 0.1 * t[:, None]
    gain = 2 ** (-((f / 40) ** 2) / 2)  # -3 dB at 40 Hz
    a = ch.band_limited(x, period, 40, 2)
    expected = -gain * (2 * np.pi * f) ** 2 * np.sin(2 * np.pi * f * t)
    assert a[100:-100, 0] == pytest.approx(expected[100:-100], abs=0.05)
    v = ch.band_limited(x, period, 40, 1)[100:-100, 0]
    assert v.mean() == pytest.approx(0.1, abs=0.01)


@pytest.mark.parametrize(
    "shape",
    [
        sine(0.5, 3, 0.005), sine(4.0, 3, 0.005), triangle(4.0, 3, 0.005), steps(0.5, 3, 0.005),
        turns(np.array([1.0, -1.0]), 2.0, 0.5, 3, 0.005),
        turns(np.array([[0.0, 0.0], [1.0, -1.0]]), 2.0, 0.5, 3, 0.005, lead=False),
    ],
)  # fmt: skip
def test_shapes_repeat_their_cycles_from_rest_to_rest(shape):
    p, period = shape.p, 0.005
    assert np.abs(p[[0, -1]]).max() < 1e-9
    assert np.abs(np.diff(p, axis=0)[[0, -1]]).max() < 1e-3 * np.abs(p).max()
    first, m = round(shape.start / period), round(shape.cycle / period)
    whole = p[first : first + shape.cycles * m]
    cycles = whole.reshape(shape.cycles, m, -1)
    assert cycles[1:] == pytest.approx(cycles[:-1], abs=1e-6 * np.abs(p).max())


def test_joined_shapes_start_where_they_are_said_to():
    parts = [np.ones((4, 2)), 2 * np.ones((3, 2))]
    p, first = joined(parts, 5)
    for part, i in zip(parts, first, strict=True):
        assert np.array_equal(p[i : i + len(part)], part)
    assert not p[: first[0]].any() and not p[first[1] + 3 :].any()
