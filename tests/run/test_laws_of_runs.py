"""Laws that runs of any robot obey, on robots and motions that hypothesis draws."""

from dataclasses import replace

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from robots import chain_sdf, loaded
from strategies import GENERATORS, motions, robots

from sdt_drake.motion import Motion
from sdt_drake.run.design import make_design
from sdt_drake.run.kinds import CONTROLLERS
from sdt_drake.run.loop import make_loop
from sdt_drake.run.scenario import ControllerChoice, PlantChoice, Scenario
from sdt_drake.run.simulate import simulate

FEW = settings(max_examples=6)
ROBOTS = robots(st.integers(1, 4))


def design_of(kind, robot, motion, **choices):
    controller = ControllerChoice(kind=kind, omega_r=60.0, **choices)
    scenario = Scenario(plant=PlantChoice(kind="coupled"), controller=controller)
    return make_design(scenario, robot=robot, motion=motion)


@FEW
@given(st.data(), ROBOTS)
def test_feedforward_of_an_exact_model_leaves_hardly_any_error(data, robot):
    motion = data.draw(motions(robot.n, samples=60))
    errors = []
    for kind in ("pi", "pi_id"):
        design = design_of(kind, robot, motion)
        run = simulate(design, make_loop(design, limited=False))
        errors.append(np.abs(run.speed_error).max())
    assert errors[1] < 0.2 * errors[0]


@FEW
@given(ROBOTS, st.sampled_from([*CONTROLLERS]), GENERATORS)
def test_rest_stays_rest(robot, kind, rng):
    still = Motion.from_speeds(0.005, rng.uniform(-2, 2, robot.n), np.zeros((11, robot.n)))
    design = design_of(kind, robot, still)
    run = simulate(design, make_loop(design, limited=False))
    assert np.abs(run.position_error).max() < 1e-6
    np.testing.assert_allclose(run.tau_peak, np.abs(run.tau[:1]) + 0 * run.tau, atol=1e-3)


@given(st.integers(1, 4), GENERATORS, st.data())
def test_a_gear_scales_gains_and_feedforward_to_the_motor_side(n, rng, data):
    ratio, rotor, seed = rng.uniform(0.5, 100, n), rng.uniform(1e-4, 0.1, n), int(rng.integers(99))
    motion = data.draw(motions(n, samples=8))
    geared, direct = (
        design_of(
            "pi_id",
            loaded(
                chain_sdf(n, seed=seed, motors={"gear_ratio": r, "rotor_inertia": i}),
            ),
            motion,
        )
        for r, i in ((ratio, rotor), (np.ones(n), rotor * ratio**2))
    )
    np.testing.assert_allclose(geared.gains.kp * ratio**2, direct.gains.kp, rtol=1e-9)
    np.testing.assert_allclose(geared.gains.ki * ratio**2, direct.gains.ki, rtol=1e-9)
    np.testing.assert_allclose(geared.tau_ff * ratio, direct.tau_ff, rtol=1e-9, atol=1e-9)


@FEW
@given(st.data(), ROBOTS, st.sampled_from(["pi_id", "pi_ctc", "p_pi", "pi_scheduled"]))
def test_torque_and_saturation_of_periods_agree_with_the_log(data, robot, kind):
    motion = data.draw(motions(robot.n, samples=40))
    need = np.abs(design_of("pi_id", robot, motion).tau_ff).max(axis=0) * robot.gear_ratio
    weak = replace(robot, effort_limit=0.7 * need + 1e-3)
    run = simulate(design_of(kind, weak, motion))
    limit = weak.motor_torque_limit
    share, peak = run.saturated[1:], run.tau_peak[1:] / limit
    assert share.min() >= 0 and share.max() <= 1
    assert peak.max() <= 1 + 1e-9
    mean, rms = np.abs(run.tau_mean[1:]) / limit, run.tau_rms[1:] / limit
    assert np.all(mean <= rms + 1e-6) and np.all(rms <= peak + 3e-3)
    np.testing.assert_array_equal(run.tau_limited, np.clip(run.tau_cmd, -limit, limit))
    whole = share >= 1
    np.testing.assert_allclose(mean[whole], 1, atol=2e-3)
    free = share <= 0
    np.testing.assert_allclose(run.tau_limited[1:][free], run.tau_cmd[1:][free], rtol=1e-9)
