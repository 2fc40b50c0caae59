"""The regressor of identification against Drake, and the choice of its cut-off."""

import numpy as np
import pytest
from helpers.known_truth import changed, motion, recorded_of, true_robot
from helpers.strategies import moving
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import butter, sosfiltfilt

from sdt_drake.machine.identify.base_parameters import (
    Unknown,
    rigid_columns,
    rigid_names,
    rigid_parameters,
)
from sdt_drake.machine.identify.cutoff import chosen
from sdt_drake.machine.identify.equations import equations
from sdt_drake.machine.identify.filtering import Stretch, spread, stretches
from sdt_drake.machine.identify.procedure import belief, identify
from sdt_drake.robot.dynamics import inverse_dynamics


@settings(max_examples=20)
@given(st.booleans().flatmap(lambda coupled: moving(20, coupled=coupled)))
def test_regressor_times_parameters_equals_drakes_torque(drawn):
    """At the gears, where each motor adds the inertia of its own rotor alone."""
    robot, q, v, vd = drawn
    expected = inverse_dynamics(robot, q, v, vd) - robot.damping * v
    expected = robot.motor_torque(expected) * robot.gear_ratio
    torque = rigid_columns(robot, q, v, vd) @ rigid_parameters(robot)
    assert np.all(np.abs(torque - expected) <= 1e-9 * np.abs(expected).max())


@settings(max_examples=6)
@given(moving(60, joints=st.integers(1, 4)))
def test_base_parameters_from_exact_torques_equal_the_truth(drawn):
    robot, q, v, vd = drawn
    base, phi = Unknown.everything(robot).base, rigid_parameters(robot)
    W = rigid_columns(robot, q, v, vd).reshape(-1, 11 * robot.n)
    size = np.linalg.norm(W, axis=0)
    scaled = W / np.maximum(size, 1e-3 * size.max())
    # The rank by singular values, an independent count; then a fit to Drake's torques.
    assert len(base.independent) == np.linalg.matrix_rank(scaled, tol=1e-9) == len(base.words)
    tau = (inverse_dynamics(robot, q, v, vd) - robot.damping * v).ravel()
    own = size[base.independent]
    beta = np.linalg.lstsq(W[:, base.independent] / own, tau, rcond=1e-12)[0]
    off = np.abs(beta - own * (base.combination @ phi))
    assert np.all(off <= 1e-4 * np.abs(beta).max())  # smaller columns count as none


def test_identifiability_words_of_the_shipped_device(robot):
    base = Unknown.everything(robot).base
    ways = dict(zip(rigid_names(robot), base.identifiable, strict=True))
    assert ways["mass of arm"] == "not at all"  # its axis is upright, and does not move
    assert ways["hz of roll_frame"] == "alone" and ways["hx of roll_frame"] == "in combination"
    first = next(words for words in base.words if words.startswith("Izz of arm"))
    # Parallel axes: what is 2.6 m out adds 2.6² m of every mass there.
    assert "+ 6.76 mass of roll_frame" in first and "+ motor inertia of planetary" in first


def test_equations_in_blocks_equal_those_at_once(robot):
    (stretch,), _ = stretches(recorded_of(true_robot(robot)))
    arguments = robot, Unknown.everything(robot), [(0, 12.0, stretch)], 4.0
    whole = equations(*arguments)
    parts = equations(*arguments, block=900)
    assert len(parts.time) == len(whole.time) and np.all(parts.part == 0)
    for name in ("time", "q", "tau", "known", "nominal", "rigid", "friction"):
        one, other = getattr(parts, name), getattr(whole, name)
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-7 * np.abs(other).max())


# --- the chosen cut-off and speeds -----------------------------------------------------------

RATE = 100.0  # Hz, of the recordings; the highest cut-off that is tried is a tenth


def choice(robot, recorded, cutoff=None):
    unknown = Unknown.everything(robot)
    return chosen(robot, unknown, belief(robot, unknown), stretches(recorded)[0], cutoff)


def shaken(recorded, lowest, share):
    """The recording with noise of torques above a frequency [Hz], over their RMS."""
    tau = recorded.signals["tau"]
    sos = butter(4, lowest / RATE * 2, "high", output="sos")
    noise = sosfiltfilt(sos, np.random.default_rng(1).normal(size=tau.shape), axis=0)
    size = share * np.sqrt(np.mean(tau**2, axis=0)) / noise.std(axis=0)
    return changed(recorded, tau=tau + size * noise)


def test_clean_recording_keeps_the_highest_cutoff(robot, clean):
    """Friction at reversals reaches as far as anything is tried, and nothing disturbs it."""
    assert choice(robot, clean) == (10.0, False)


@pytest.fixture(scope="module")
def clean(true):
    return recorded_of(true, noise=0.002)


def test_cutoff_is_between_motion_and_noise(robot, clean):
    assert 2.0 < choice(robot, shaken(clean, 5.0, 1.0))[0] < 6.0


def test_recorded_speeds_are_used_where_less_noisy(robot, clean):
    rng, v = np.random.default_rng(3), motion(robot)[2]
    noisy = changed(clean, q=clean.signals["q"] + 2e-4 * rng.normal(size=v.shape))
    good, bad = (changed(noisy, v=v + x * rng.normal(size=v.shape)) for x in (1e-4, 1e-1))
    assert choice(robot, good, 4.0) == (4.0, True)
    assert not choice(robot, bad)[1]
    found = identify(robot, [good], only="friction", cutoff=4.0)
    assert found.speeds and "recorded speeds are used" in " / ".join(found.notes)


def test_windows_spread_over_the_whole_recording():
    """Two stretches of 60 s and 40 s, of which 10 s are enough, below 100 Hz."""
    found = [
        Stretch(start, 0.01, *2 * [np.arange(start, start + lasts, 0.01)[:, None]])
        for start, lasts in ((0.0, 60.01), (80.0, 40.01))
    ]
    assert spread(found, 101.0, 100.0) == found
    windows = spread(found, 10.0, 100.0)
    assert len(windows) == 20 and windows[0].start == 0
    np.testing.assert_allclose(windows[-1].end, 120)
    for window in windows:  # their values are their times
        lasts = window.end - window.start
        assert abs(lasts - 0.5) < 0.011
        np.testing.assert_allclose(window.q[[0, -1], 0], [window.start, window.end])
    assert sum(window.start < 70 for window in windows) == 12
    assert len(spread(found, 1.0, 100.0)) == 2  # of enough periods, rather than short ones
