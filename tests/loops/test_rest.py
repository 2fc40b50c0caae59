"""A run starts in equilibrium: what stands or goes on steadily before goes on like that."""

import copy

import numpy as np
import pytest

from sdt_drake.analysis.comparison import with_controller
from sdt_drake.design import make_design
from sdt_drake.device import Drive, Elasticity, Friction
from sdt_drake.motion import Motion
from sdt_drake.simulate import simulate

LOADED = np.array([0.2, 0.8, 0.3, 0.4])


def steady(base, label, speed=0.0, change=lambda scenario: None):
    """0.1 s at a constant speed of joint 1, all other joints standing: the design."""
    v = np.zeros((21, 4))
    v[:, 0] = speed
    scenario = with_controller(copy.deepcopy(base.scenario), label)
    change(scenario)
    motion = Motion.from_speeds(0.005, LOADED, v)
    return make_design(scenario, robot=base.robot, motion=motion)


def heavier(scenario):
    """The controller does not know of 40 kg and the friction."""
    scenario.plant.deviation.payload_mass = 40.0
    scenario.plant.friction = Friction(coulomb=[50.0, 20.0, 20.0, 10.0])


def axis(scenario):
    heavier(scenario)
    scenario.plant.kind = "axis"


def anti_windup(scenario):
    scenario.controller.anti_windup = True


def driven(scenario):
    scenario.drive = Drive(period=0.001, torque_bandwidth=400.0, torque_error=[0.1, -0.1, 0, 0.05])


def late(scenario):
    scenario.drive = Drive(reference_delay=0.012)


@pytest.mark.parametrize("label", ["pi", "pi_ctc", "pi_id", "p_pi", "p_pi+ctc", "pi_scheduled"])
@pytest.mark.parametrize("change", [lambda s: None, heavier, axis, anti_windup, driven, late])
def test_a_loaded_robot_stands_still(design, label, change):
    recording = simulate(steady(design, label, change=change))
    assert np.abs(recording.position_error).max() < 1e-6
    assert np.abs(recording.tau_peak[0, 1]) > 30  # joint 2 carries a load


def test_inverse_dynamics_stands_still_where_its_model_is_right(design):
    recording = simulate(steady(design, "inverse_dynamics"))
    assert np.abs(recording.position_error).max() < 1e-6


@pytest.mark.parametrize("change", [heavier, axis])
@pytest.mark.parametrize("label", ["pi", "pi_id", "p_pi", "pi_scheduled"])
def test_a_joint_that_turns_goes_on(design, label, change):
    """Around the vertical axis nothing changes with its angle."""
    recording = simulate(steady(design, label, 1.5, change))
    assert np.abs(recording.speed_error).max() < 1e-5


@pytest.mark.parametrize("speed", [0.0, 1.5])
def test_motors_carry_the_offset_of_friction(design, speed):
    offset = np.array([900.0, -1300.0, 40.0, -5.0])  # N m, joint side

    def offset_too(scenario):
        scenario.plant.friction = Friction(offset=offset.tolist())

    with_it, without = (
        simulate(steady(design, "pi", speed, change)).tau for change in (offset_too, lambda _: None)
    )
    carried = (with_it - without) * design.robot.gear_ratio
    np.testing.assert_allclose(carried, offset + np.zeros_like(carried), atol=0.01)


@pytest.mark.parametrize("encoder", ["motor", "link"])
@pytest.mark.parametrize("label", ["pi", "p_pi"])
def test_springs_are_wound_and_encoders_on_the_reference(design, label, encoder):
    def elastic(scenario):
        scenario.plant.elasticity = Elasticity([40.0] * 4, damping_ratio=0.02, encoder=encoder)

    error = simulate(steady(design, label, change=elastic)).position_error
    np.testing.assert_allclose(error, error[:1] + np.zeros_like(error), atol=1e-6)
    assert (np.abs(error[0, 1]) > 1e-4) == (encoder == "motor")  # the link sags behind its motor
