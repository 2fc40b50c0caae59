"""Laws that runs of any robot obey, on robots and motions that hypothesis draws."""

from dataclasses import replace

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from robots import chain_sdf, loaded
from strategies import GENERATORS, motions, robots

from sdt_drake.run.design import make_design
from sdt_drake.run.scenario import ControllerChoice, PlantChoice, Scenario
from sdt_drake.run.simulate import simulate


def design_of(kind, robot, motion):
    controller = ControllerChoice(kind=kind, omega_r=60.0)
    scenario = Scenario(plant=PlantChoice("coupled"), controller=controller, period=motion.period)
    return make_design(scenario, robot=robot, motion=motion)


@given(st.integers(1, 4), GENERATORS, st.data())
def test_a_gear_scales_gains_and_feedforward_to_the_motor_side(n, rng, data):
    ratio, rotor, seed = rng.uniform(0.5, 100, n), rng.uniform(1e-4, 0.1, n), int(rng.integers(99))
    motion = data.draw(motions(n, samples=8))
    geared, direct = (
        design_of(
            "pi_id",
            loaded(chain_sdf(n, seed=seed, motors={"gear_ratio": r, "rotor_inertia": i})),
            motion,
        )
        for r, i in ((ratio, rotor), (np.ones(n), rotor * ratio**2))
    )
    np.testing.assert_allclose(geared.gains.kp * ratio**2, direct.gains.kp, rtol=1e-9)
    np.testing.assert_allclose(geared.gains.ki * ratio**2, direct.gains.ki, rtol=1e-9)
    np.testing.assert_allclose(geared.tau_ff * ratio, direct.tau_ff, rtol=1e-9, atol=1e-9)


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
