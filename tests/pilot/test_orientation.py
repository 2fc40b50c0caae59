"""The observer of orientation against closed forms, its symmetries, and published numbers."""

import dataclasses
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from helpers.alone import FEELING
from scipy.signal import lsim

import sdt_drake as sdt
from sdt_drake.io.errors import InputError
from sdt_drake.pilot import load_perception
from sdt_drake.pilot.observer import PerceptionModel
from sdt_drake.pilot.orientation import perceive

G = 9.81
TAU, TAU_A, LAG = 5.7, 80.0, 4 * np.pi
GAINS = {  # of perception models: k_w, k_fw, k_fg, k_a
    "clark2019": (8, 8, 4, -4),
    "slow_yaw": (2.28, 8, 4, -4),
    "rader2009": (3, 2, 2, -2),
    "irmak2023": (2.28, 0, 15.4, -3.2),
}


def head(duration, period=0.01):
    """At rest, upright: time, specific force, angular rate."""
    time = np.arange(round(duration / period) + 1) * period
    return time, np.tile([0, 0, G], (len(time), 1)), np.zeros((len(time), 3))


def flight(period=0.01, duration=5.0):
    """Forces and rotations about all axes at once."""
    time, force, rate = head(duration, period)
    waves = np.sin(np.outer(time, [1.0, 2.2, 0.7]) + np.arange(3))
    force += np.minimum(time, 1)[:, None] * waves * [3.0, 2.0, 4.0]
    rate += np.sin(np.outer(time, [1.3, 0.9, 0.4])) * [0.8, 0.5, 1.2]
    return time, force, rate


def felt_of(felt):
    return np.hstack([felt.gravity, felt.rate, felt.acceleration])


# --- by hand ------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", GAINS)
def test_yaw_decays_by_the_transfer_function(name):
    """(k_w + 1) C / (1 + k_w H), with C / (1 + k_w H) =
    tau tau_a s² / ((tau_a s + 1) ((s / omega_c + 1)(tau s + 1) + k_w tau s))."""
    model, k_w = load_perception(name), GAINS[name][0]
    assert (model.k_w, model.k_fw, model.k_fg, model.k_a) == tuple((x,) * 3 for x in GAINS[name])
    assert (model.tau, model.tau_a, model.cutoff) == ((5.7,) * 3, (80.0,) * 3, 2.0)
    time, force, rate = head(40, 0.02)
    rate[(time > 1) & (time <= 31), 2] = 1.0
    felt = perceive(time, force, rate, name).rate
    below = np.polymul([TAU / LAG, TAU * (1 + k_w) + 1 / LAG, 1], [TAU_A, 1])
    _, expected, _ = lsim(([(k_w + 1) * TAU * TAU_A, 0, 0], below), rate[:, 2], time)
    np.testing.assert_allclose(felt[:, 2], expected, atol=4e-3)
    assert expected.min() < -0.3  # a false rotation
    np.testing.assert_allclose(felt[:, :2], 0, atol=1e-9)


@pytest.mark.parametrize("name", ["clark2019", "irmak2023"])
@pytest.mark.parametrize(
    ("force", "pitch", "roll"), [((3.0, 0, G), 17.005, 0), ((0, 3.0, G), 0, 17.005)]
)
def test_lasting_force_is_felt_as_gravity(name, force, pitch, roll):
    """Forward it tilts the pilot nose up, to the left it tilts to the right."""
    time, forces, rate = head(60, 0.05)
    forces[1:] = force
    felt = perceive(time, forces, rate, name)
    assert np.degrees(felt.pitch[[0, -1]]) == pytest.approx([0, pitch], abs=0.05)
    assert np.degrees(felt.roll[[0, -1]]) == pytest.approx([0, roll], abs=0.05)
    down = -np.array(force) / np.linalg.norm(force)
    np.testing.assert_allclose(felt.gravity[-1], down, atol=1e-3)
    # At its onset it is an acceleration that way, of at most k_a / (k_a - 1) of it.
    axis, k_a = np.argmax(force[:2]), GAINS[name][3]
    assert 1 < felt.acceleration[:, axis].max() < 3.0 * k_a / (k_a - 1)


def test_start_with_tilt_and_turn_is_steady():
    time, force, rate = head(5)
    force[:], rate[:] = (G / 2, 0, G), (0, 0, 0.7)
    felt = perceive(time, force, rate)
    np.testing.assert_allclose(felt.gravity, np.tile([-(0.2**0.5), 0, -(0.8**0.5)], (501, 1)))
    np.testing.assert_allclose(felt.rate, 0, atol=1e-9)


def test_observer_takes_uneven_samples_from_any_time():
    time, force, rate = flight()
    usual = felt_of(perceive(time, force, rate))
    keep = np.flatnonzero(np.arange(len(time)) % 5 != 2)
    felt = perceive(time[keep] + 1000, force[keep], rate[keep])
    np.testing.assert_array_equal(felt.time, time[keep] + 1000)
    np.testing.assert_allclose(felt_of(felt), usual[keep], atol=2e-2)


def test_coarse_samples_are_felt_as_the_lines_between_them_in_any_thread():
    """They have an integrator of their own, which only one thread at a time may use."""
    time, *coarse = flight(0.1)
    fine = np.linspace(0, 5, 501)
    lines = [np.array([np.interp(fine, time, column) for column in x.T]).T for x in coarse]
    expected = felt_of(perceive(fine, *lines))[::10]
    with ThreadPoolExecutor(4) as pool:
        for felt in pool.map(lambda _: perceive(time, *coarse), range(8)):
            np.testing.assert_allclose(felt_of(felt), expected, atol=2e-3)


@pytest.mark.parametrize("period", [0.04, 0.05, 0.07, 0.1])
def test_steps_between_stills_are_felt_whatever_the_round_off_of_their_times(period):
    time = 3.7 + np.arange(0, 8, period)
    rate = np.outer((time > 4.7) & (time < 8), [0.2, -0.1, 1.0]) + np.outer(time > 9, [0, 0.3, 0])
    force = np.tile([0.0, 0.0, G], (len(time), 1))
    fine = np.linspace(time[0], time[-1], 8 * len(time) - 7)
    lines = [np.array([np.interp(fine, time, x) for x in y.T]).T for y in (force, rate)]
    expected = felt_of(perceive(fine, *lines))[::8]
    np.testing.assert_allclose(felt_of(perceive(time, force, rate)), expected, atol=2e-3)


def swing(radial):
    """Of Rader et al. 2009: roll by 10 deg at 0.45 Hz, 1.22 m below the axis, with 0.25 m/s² along
    the radius at twice that; it takes from the force along z (-1), adds to it (1), or is not (0).
    """
    time, force, rate = head(30)
    w, r = 2 * np.pi * 0.45, np.full(len(time), 1.22)
    begins = np.clip(time / 5, 0, 1) ** 2
    angle = np.radians(10) * np.sin(w * time) * begins
    r += radial * 0.25 / (2 * w) ** 2 * np.cos(2 * w * time) * begins
    speed, radial_speed = np.gradient(angle, time), np.gradient(r, time)
    force[:, 1] = r * np.gradient(speed, time) + 2 * radial_speed * speed + G * np.sin(angle)
    force[:, 2] = r * speed**2 - np.gradient(radial_speed, time) + G * np.cos(angle)
    rate[:, 0] = speed
    return time, force, rate, w


@pytest.mark.parametrize("radial", [0, -1, 1])
def test_swing_equals_printed_table_of_rader(radial):
    """Largest rate 27 deg/s and speed along y 38 cm/s of all three swings; tilt and translation
    are not compared, how they were read off is not said where the paper could be read."""
    time, force, rate, w = swing(radial)
    assert np.ptp(force[time > 10, 1]) / 2 < 0.045  # "about 0.035 m/s²"
    felt = perceive(time, force, rate, "rader2009")
    late = time > 20
    sideways = felt.acceleration[:, 1] * np.cos(felt.roll) - felt.acceleration[:, 2] * np.sin(
        felt.roll
    )
    assert 100 * np.ptp(sideways[late]) / 2 / w == pytest.approx(38, abs=1.1)
    assert np.degrees(np.ptp(felt.rate[late, 0])) / 2 == pytest.approx(27, abs=0.6)


# --- the result, and bad input ------------------------------------------------------------------


@pytest.mark.parametrize(
    ("change", "line"),
    [
        (lambda t, f, w: (t[:-1], f, w), r"specific_force: .*\(501, 3\), expected \(500, 3"),
        (lambda t, f, w: (t, f, "a"), "angular_rate: a, expected"),
        (lambda t, f, w: (t[:1], f[:1], w[:1]), "time: expected at least 2 samples"),
        (lambda t, f, w: (100 * t, f, w), "time: 1 s .* at 0 s, expected at most 0.1"),
        (lambda t, f, w: (t, f * (t != 3)[:, None], w), "specific_force: 0 m/s² at 3 s"),
    ],
)
def test_bad_samples_of_the_observer_are_refused(change, line):
    with pytest.raises(sdt.InputError, match=f"^{line}[^\n]*$"):
        perceive(*change(*flight()))


@pytest.mark.parametrize("name", ["k_w", "k_fw", "k_fg", "k_a", "tau", "tau_a"])
@pytest.mark.parametrize("axes", [2, 4])
def test_gains_of_a_pilot_are_for_three_axes(name, axes):
    values = dataclasses.asdict(FEELING) | {name: [0.0 if name == "k_a" else 1.0] * axes}
    with pytest.raises(InputError, match=rf"{name}: .*3"):
        PerceptionModel(**values)


@pytest.mark.parametrize("share", [0.009, 0.011])
def test_weightless_head_has_no_vertical(share):
    time, forces, rate = head(1, 0.05)
    forces[5] = 0, share * G, 0
    if share > 0.01:
        assert np.isfinite(perceive(time, forces, rate).roll).all()
    else:
        with pytest.raises(InputError, match=r"0\.0883 m/s² at 0\.25 s, expected at least 0\.098"):
            perceive(time, forces, rate)


def test_longest_sample_period_is_a_tenth_of_a_second():
    assert len(perceive(*head(1, 0.1)).time) == 11
    with pytest.raises(InputError, match=r"0\.1 s"):
        perceive(*head(1.01, 0.101))
