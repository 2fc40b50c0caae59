"""What is identified where the robot's file leaves much out, and the recording has too much."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from sdt_drake.machine.identify.base_parameters import rigid_parameters
from sdt_drake.machine.identify.filtering import stretches, zero_phase_low_pass
from sdt_drake.machine.identify.procedure import identify
from sdt_drake.machine.recordings import Recorded
from sdt_drake.robot.dynamics import inverse_dynamics
from sdt_drake.robot.robot import load_robot


def arm_sdf(hand: float, rotors: tuple[float, float]) -> str:
    """An upright arm of two joints with a hand of some mass [kg], and rotors [kg m²]."""
    joints = [
        ("shoulder", "world", "arm", 5.0, 0.2, 120.0),
        ("wrist", "arm", "hand", hand, 0.05, 20),
    ]
    parts = [
        f'<link name="{link}"><pose relative_to="{name}"/><inertial><mass>{mass}</mass>'
        f"<pose>{size} 0 0 0 0 0</pose>"
        f"<inertia><ixx>{I}</ixx><iyy>{I}</iyy><izz>{I}</izz></inertia>"
        f'</inertial></link><joint name="{name}" type="revolute">'
        f'<pose relative_to="{"__model__" if parent == "world" else parent}">{x} 0 0 1.5 0 0</pose>'
        f"<parent>{parent}</parent><child>{link}</child><axis><xyz>0 0 1</xyz>"
        f"<limit><effort>{effort}</effort></limit></axis>"
        f"<drake:rotor_inertia>{rotor}</drake:rotor_inertia></joint>"
        for (name, parent, link, mass, size, effort), rotor, x in zip(
            joints, rotors, (0.0, 0.4), strict=True
        )
        for I in [mass * size**2 / 4]  # noqa: E741
    ]
    return (
        '<sdf version="1.9" xmlns:drake="http://drake.mit.edu"><model name="arm">'
        f"{''.join(parts)}</model></sdf>"
    )


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    """An arm as its maker publishes it, without rotors and tool, and as it is."""
    folder = tmp_path_factory.mktemp("arm")
    (folder / "file.sdf").write_text(arm_sdf(0.2, (0.0, 0.0)))
    (folder / "true.sdf").write_text(arm_sdf(0.6, (0.5, 0.1)))
    return load_robot(folder / "file.sdf"), load_robot(folder / "true.sdf")


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
def test_rotors_and_a_tool_that_the_file_does_not_have(arm, encoder):
    """The wrist's rotor is fifty times the inertia of its hand, and accelerations are noisy."""
    nominal, true = arm
    found = identify(nominal, [arm_recorded(true, encoder)])
    truth = found.unknown.base.combination @ rigid_parameters(true)
    told = np.abs(truth) > 0.02
    assert told.sum() == 4
    assert found.estimate.beta[told] == pytest.approx(truth[told], rel=0.05)
    assert found.consistent.motors[1] == pytest.approx(0.1, rel=0.1)


def test_standstill_at_both_ends_is_left_out(arm):
    nominal, true = arm
    recorded = arm_recorded(true, 1e-5)
    stood = 3000
    q = (
        recorded.signals["q"]
        * np.clip(np.minimum(recorded.time, 29.99 - recorded.time), 0, 1)[:, None]
    )
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
