"""Runs of any robot, on robots and motions that hypothesis draws."""

from dataclasses import replace

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from strategies import motions, robots

from sdt_drake.run.design import make_design
from sdt_drake.run.scenario import ControllerChoice, PlantChoice, Scenario
from sdt_drake.run.simulate import simulate


def design_of(kind, robot, motion):
    controller = ControllerChoice(kind=kind, omega_r=60.0)
    scenario = Scenario(plant=PlantChoice("coupled"), controller=controller, period=motion.period)
    return make_design(scenario, robot=robot, motion=motion)


@settings(max_examples=8)
@given(
    st.data(),
    robots(st.integers(1, 4)),
    st.sampled_from(["pi_id", "pi_ctc", "p_pi", "pi_scheduled"]),
    st.sampled_from([1 / 300, 0.005, 0.007]),
)
def test_samples_torque_and_saturation_of_any_robot_agree(data, robot, kind, period):
    motion = data.draw(motions(robot.n, period=period, samples=40))
    need = np.abs(design_of("pi_id", robot, motion).tau_ff).max(axis=0) * robot.gear_ratio
    weak = replace(robot, effort_limit=0.7 * need + 1e-3)
    design = design_of(kind, weak, motion)
    run, limit = simulate(design), weak.motor_torque_limit
    np.testing.assert_array_equal(run.time, np.arange(len(motion.q)) * period)
    np.testing.assert_array_equal(run.load_torque[1:], design.loads.load_torque[:-1])
    assert run.v.shape == run.saturated.shape == motion.v.shape
    share, peak = run.saturated[1:], run.tau_peak[1:] / limit
    assert share.min() >= 0 and share.max() <= 1 and peak.max() <= 1 + 1e-9
    mean, rms = np.abs(run.tau_mean[1:]) / limit, run.tau_rms[1:] / limit
    assert np.all(mean <= rms + 1e-6) and np.all(rms <= peak + 3e-3)
    np.testing.assert_array_equal(run.tau_limited, np.clip(run.tau_cmd, -limit, limit))
    np.testing.assert_allclose(mean[share >= 1], 1, atol=2e-3)
