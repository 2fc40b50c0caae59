"""A run starts in equilibrium: what stands or goes on steadily before goes on like that."""

import numpy as np
import pytest
from variants import kind

from sdt_drake.motion import Motion
from sdt_drake.robot.device import Drive, Elasticity, Friction
from sdt_drake.run.simulate import simulate

LOADED = np.array([0.2, 0.8, 0.3, 0.4])

# The controller does not know of 40 kg and the friction.
HEAVIER = {
    "plant.deviation.payload_mass": 40.0,
    "plant.friction": Friction(coulomb=[50.0, 20.0, 20.0, 10.0]),
}
AXIS = HEAVIER | {"plant.kind": "axis"}
ANTI_WINDUP = {"controller.anti_windup": True}
DRIVEN = {"drive": Drive(period=0.001, torque_bandwidth=400.0, torque_error=[0.1, -0.1, 0, 0.05])}
LATE = {"drive": Drive(reference_delay=0.012)}


@pytest.fixture
def steady(designed):
    """A run of 0.1 s at a constant speed of joint 1, all other joints standing."""

    def run(label, fields, speed=0.0):
        motion = Motion.from_speeds(0.005, LOADED, np.tile([speed, 0, 0, 0], (21, 1)))
        return simulate(designed("coupled_pi_ctc", kind(label) | fields, motion=motion))

    return run


@pytest.mark.parametrize("label", ["pi", "pi_id", "p_pi+ctc", "pi_scheduled"])
@pytest.mark.parametrize("fields", [HEAVIER, AXIS, ANTI_WINDUP, DRIVEN, LATE])
def test_a_loaded_robot_stands_still_and_a_joint_that_turns_goes_on(steady, label, fields):
    """Around the vertical axis of joint 1 nothing changes with its angle."""
    recording = steady(label, fields)
    assert np.abs(recording.position_error).max() < 1e-6
    assert np.abs(recording.tau_peak[0, 1]) > 30  # joint 2 carries a load
    if fields in (HEAVIER, AXIS):
        assert np.abs(steady(label, fields, speed=1.5).speed_error).max() < 1e-5


@pytest.mark.parametrize("encoder", ["motor", "link"])
@pytest.mark.parametrize("label", ["pi", "p_pi"])
def test_springs_are_wound_and_encoders_on_the_reference(steady, label, encoder):
    springs = Elasticity([40.0] * 4, damping_ratio=0.02, encoder=encoder)
    error = steady(label, {"plant.elasticity": springs}).position_error
    np.testing.assert_allclose(error, error[:1] + np.zeros_like(error), atol=1e-6)
    assert (np.abs(error[0, 1]) > 1e-4) == (encoder == "motor")  # the link sags behind its motor
