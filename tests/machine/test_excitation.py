"""Exciting motions of two links in a plane: within limits, and as good as they say."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.command_line import ARM

from sdt_drake.io.errors import InputError
from sdt_drake.machine.identify.excitation import RATE, excite
from sdt_drake.machine.identify.limits import Limits, assumed
from sdt_drake.machine.identify.targets import Target
from sdt_drake.motion import Motion, plan_motion
from sdt_drake.motion.command import command_of
from sdt_drake.robot.robot import load_robot


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    path = tmp_path_factory.mktemp("arm") / "arm.sdf"
    limit = "</velocity><drake:acceleration>50</drake:acceleration>"
    path.write_text(ARM.replace("</velocity>", limit, 1))  # of the first joint alone
    return load_robot(path)


@pytest.fixture(scope="module")
def excitation(arm):
    return excite(Target.everything(arm), 20.0, thorough=False)


def planned(excitation) -> Motion:
    robot = excitation.target.robot
    plan = plan_motion(robot, command_of(excitation.profile, robot))
    assert not plan.limited.any()
    return plan.motion


def test_exciting_motion_is_planned_unchanged_and_uses_its_limits(arm, excitation):
    motion = planned(excitation)
    assert motion.duration == 20 and np.abs(motion.v[[0, -1]]).max() < 1e-9
    again = round(1 / excitation.base_frequency / motion.period)
    fitted, judged = np.split(motion.v, [round(excitation.fitted / motion.period)])
    assert fitted[again:] == pytest.approx(fitted[:-again], abs=1e-6)
    # What comes then is another motion from the same place, within the same limits.
    assert len(judged) == again + 1 and np.abs(judged - motion.v[: again + 1]).max() > 0.5
    assert motion.q[-1] == pytest.approx(motion.q[0], abs=1e-6)
    assert np.abs(judged).max() > 0.5 * np.abs(fitted).max()
    assert np.abs(motion.v).max(axis=0) == pytest.approx(5 * excitation.used["speed"], rel=1e-3)
    first, second = excitation.used["acceleration"]
    assert 0 < first <= 0.8 + 1e-6 and 0 < second <= 0.8 + 1e-6
    assert 0.7 < max(share.max() for share in excitation.used.values()) <= 0.8 + 1e-6


def test_expected_deviations_equal_those_of_fits_to_noise(arm, excitation):
    """Of 300 recordings with torques of noise alone, solved by numpy."""
    motion, target = planned(excitation), excitation.target
    every = round(1 / RATE / motion.period)
    samples = slice(0, round(excitation.fitted / motion.period), every)
    # `rows` are checked against Drake where the regressor is; the noise is put back.
    columns, _ = target.rows(motion.q[samples], motion.v[samples], motion.vd[samples])
    X = columns.reshape(-1, columns.shape[2])
    noise = np.random.default_rng(3).normal(size=(len(X), 300))
    found = np.linalg.lstsq(X, noise, rcond=None)[0]
    assert found.std(axis=1) == pytest.approx(excitation.sigma, rel=0.15)
    assert target.noise == pytest.approx([1, 1])
    condition = np.linalg.cond(X / np.linalg.norm(X, axis=0))
    assert condition == pytest.approx(excitation.condition, rel=0.02)


def test_weak_motors_shrink_the_motion_and_too_weak_ones_are_refused(arm):
    """Gravity takes 39.2 N m of the shoulder while the arm is level."""
    level = {"position_lower": np.full(2, -0.2), "position_upper": np.full(2, 0.2)}

    def found(efforts):
        robot = replace(arm, effort_limit=np.array(efforts), **level)
        return excite(Target.everything(robot), 5.0, thorough=False)

    used = found([55.0, 14.0]).used
    assert max(x.max() for x in used.values()) <= 0.8 + 1e-6 and used["torque"].min() > 0.7
    with pytest.raises(InputError, match="joint 1 exceeds its torque limit even at rest"):
        found([20.0, 14.0])


def test_a_payload_is_excited_gently(arm):
    found = excite(Target.payload(arm, "lower"), 1.0, gently=0.1, thorough=False)
    assert "hx of lower [kg m]" in found.target.names and not found.target.friction
    assert 0 < np.abs(planned(found).v).max() <= 0.8 * 0.1 * 5 + 1e-6


def test_excitation_assumes_missing_limits(arm):
    """Of the second joint: what its motor gives the least inertia about it, and the assumed rotor
    of a motor without any, which would be without limit for a light link."""
    accelerations, *_ = assumed(arm)
    highest = Limits.of(arm, 1.0).acceleration
    M = arm.plant.CalcMassMatrix(arm.plant.CreateDefaultContext())
    assert highest == pytest.approx([50, arm.effort_limit[1] / M[1, 1]])
    bare, rotor = replace(arm, rotor_inertia=np.zeros(2)), arm.effort_limit[1] / 100
    assumed_ = arm.effort_limit[1] / (M[1, 1] + rotor)
    assert Limits.of(bare, 1.0).acceleration[1] == pytest.approx(assumed_)
    assert "over the least inertia with assumed rotors" in assumed(bare)[0]
    assert f"50, {highest[1]:.3g} rad/s²" in accelerations
    assert not any("accelerations" in line for line in assumed(arm, [8, 4]))
    assert Limits.of(arm, 0.5, acceleration=[8, 4]).acceleration == pytest.approx([4, 2])
