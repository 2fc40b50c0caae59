"""The cut-off frequency and the speeds that are chosen, where it is known which are good."""

from __future__ import annotations

import numpy as np
import pytest
from known_truth import changed, motion, recorded_of, true_robot
from scipy.signal import butter, sosfiltfilt

from sdt_drake.machine.identify.base_parameters import Unknown
from sdt_drake.machine.identify.cutoff import Choice, chosen
from sdt_drake.machine.identify.filtering import stretches
from sdt_drake.machine.identify.procedure import belief, identify

RATE = 100.0  # Hz, of the recordings; the highest cut-off that is tried is a tenth


def choice(robot, recorded, cutoff=None):
    unknown = Unknown.everything(robot)
    return chosen(robot, unknown, belief(robot, unknown), stretches(recorded)[0], cutoff)


@pytest.fixture(scope="module")
def clean(robot):
    return recorded_of(true_robot(robot), noise=0.002)


def shaken(recorded, lowest, share):
    """The recording with noise of torques above a frequency [Hz], over their RMS."""
    tau = recorded.signals["tau"]
    sos = butter(4, lowest / RATE * 2, "high", output="sos")
    noise = sosfiltfilt(sos, np.random.default_rng(1).normal(size=tau.shape), axis=0)
    size = share * np.sqrt(np.mean(tau**2, axis=0)) / noise.std(axis=0)
    return changed(recorded, tau=tau + size * noise)


def test_a_lower_cutoff_gains_nothing_by_comparing_less(robot, clean):
    """Friction at reversals reaches as far as anything is tried, and nothing disturbs it."""
    assert choice(robot, clean) == Choice(10.0, speeds=False)


def test_no_joint_is_blamed_for_what_its_torque_has_above_the_motion(robot, clean):
    noisy = shaken(clean, 5.0, 1.0)
    found = identify(robot, [noisy])
    assert 2.0 < found.cutoff < 6.0
    assert np.all(found.left(found.predicted, held_out=True) < 0.15)
    at_most = identify(robot, [noisy], cutoff=10.0)
    assert np.all(at_most.left(at_most.predicted, held_out=True) > 0.25)


def test_noise_of_encoders_is_below_no_prediction(robot, clean):
    """Accelerations at 10 Hz would be noise."""
    noise = 5e-4 * np.random.default_rng(2).normal(size=clean.signals["q"].shape)
    assert choice(robot, changed(clean, q=clean.signals["q"] + noise)).cutoff < 7.0


def test_recorded_speeds_are_used_where_they_are_better(robot, clean):
    rng, v = np.random.default_rng(3), motion(robot)[2]
    noisy = changed(clean, q=clean.signals["q"] + 2e-4 * rng.normal(size=v.shape))
    good, bad = (v + size * rng.normal(size=v.shape) for size in (1e-4, 1e-1))
    assert choice(robot, changed(noisy, v=good)).speeds
    assert choice(robot, changed(noisy, v=good), 4.0) == Choice(4.0, speeds=True)
    assert not choice(robot, changed(noisy, v=bad)).speeds
    for recorded, said in ((good, "recorded"), (bad, "differentiated")):
        found = identify(robot, [changed(noisy, v=recorded)])
        assert f"{said} speeds are used" in " / ".join(found.notes)
        assert found.speeds == (said == "recorded")


def test_what_is_held_out_has_no_say(robot, clean):
    tau = clean.signals["tau"].copy()
    tau[1400:] += 1e3 * np.random.default_rng(4).normal(size=tau[1400:].shape)
    assert identify(robot, [changed(clean, tau=tau)]).cutoff == identify(robot, [clean]).cutoff
