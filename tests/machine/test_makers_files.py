"""What is identified where the robot's file leaves much out, and the recording has too much."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from oracles.dh import DhTable

from sdt_drake.machine.identify.base_parameters import rigid_parameters
from sdt_drake.machine.identify.filtering import stretches, zero_phase_low_pass
from sdt_drake.machine.identify.procedure import identify
from sdt_drake.machine.recordings.recorded import Recorded
from sdt_drake.robot.dynamics import inverse_dynamics
from sdt_drake.robot.robot import load_robot

FILE = DhTable(
    name="file",
    d=[0.0, 0.0],
    a=[0.4, 0.0],
    alpha=[1.5, 0.0],
    theta=[0.0, 0.0],
    mass=[5.0, 0.2],
    com=[(-0.2, 0.0, 0.0), (0.05, 0.0, 0.0)],
    radius=0.05,
    speed=[9.0, 9.0],
    effort=[120.0, 20.0],
    rotor_inertia=[0.0, 0.0],
    gear_ratio=[1.0, 1.0],
    base=(1.5, 0.0, 0.0),
)


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    """An arm as its maker publishes it, without rotors and tool, and as it is."""
    true = replace(FILE, name="true", mass=[5.0, 0.6], rotor_inertia=[0.5, 0.1])
    folder = tmp_path_factory.mktemp("arm")
    return [load_robot(table.write(folder)) for table in (FILE, true)]


def arm_recorded(true, encoder):
    """A recording of the arm with noise, by encoders that tell so many radians apart."""
    time = np.arange(0, 30, 0.01)
    omega = 2 * np.pi * np.array([[0.1, 0.3, 0.5], [0.2, 0.4, 0.7]]).T
    angle = omega * time[:, None, None] + [0.0, 1.0]
    waves = (np.sin(angle), omega * np.cos(angle), -(omega**2) * np.sin(angle))
    q, v, vd = (np.sum(0.5 * wave, axis=1) for wave in waves)
    tau = inverse_dynamics(true, q, v, vd) + [1.0, 0.5] * np.sign(v) + [0.5, 0.1] * v
    tau = tau + np.random.default_rng(3).normal(scale=[0.5, 0.1], size=tau.shape)
    return Recorded(Path("arm.csv"), time, {"q": encoder * np.round(q / encoder), "tau": tau})


@pytest.mark.parametrize("encoder", [1e-5, 2 * np.pi / 2000], ids=["fine", "coarse"])
def test_identification_adds_rotors_and_tool_missing_in_the_file(arm, encoder):
    """The wrist's rotor is thirty times the inertia of its hand, and accelerations are noisy."""
    nominal, true = arm
    found = identify(nominal, [arm_recorded(true, encoder)])
    truth = found.unknown.base.combination @ rigid_parameters(true)
    told = np.abs(truth) > 0.02
    assert told.sum() == 4
    assert found.estimate.beta[told] == pytest.approx(truth[told], rel=0.05)
    assert found.consistent.motors[1] == pytest.approx(0.1, rel=0.1)


def test_standstill_at_both_ends_is_cut_off(arm):
    nominal, true = arm
    recorded = arm_recorded(true, 1e-5)
    stood = 3000
    fade = np.clip(np.minimum(recorded.time, 29.99 - recorded.time), 0, 1)
    q = recorded.signals["q"] * fade[:, None]
    q = zero_phase_low_pass(np.pad(q, ((stood, stood), (0, 0)), "edge"), 3.0, 0.01)
    v = np.gradient(q, 0.01, axis=0)
    tau = inverse_dynamics(true, q, v, np.gradient(v, 0.01, axis=0)) + 0.5 * np.tanh(v / 0.01)
    noise = np.random.default_rng(0).normal(size=(2, *q.shape))
    time = np.arange(len(q)) / 100
    signals = {"q": q + 1e-5 * noise[0], "tau": tau + 0.01 * noise[1]}
    found = identify(nominal, [Recorded(Path("stood.csv"), time, signals)])
    assert "no joint moves before 28" in " / ".join(found.notes)
    held_out = found.equations.time[~found.equations.fit]
    assert 48 < held_out[0] < 51  # two thirds of the motion are fitted, not of the file
    assert np.all(found.left(found.predicted, held_out=True) < 0.05)
    assert not any("no joint moves" in line for line in stretches(recorded)[1])
