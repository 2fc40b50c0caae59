"""Specific force and rates of the pilot's head, beside Drake's multibody kinematics."""

import numpy as np
import pytest
from helpers.strategies import moving
from hypothesis import Phase, given, settings
from pydrake.multibody.tree import JacobianWrtVariable

from sdt_drake.pilot.head import GRAVITY, head_motion


@settings(max_examples=10, phases=(Phase.explicit, Phase.generate))  # a seed has no simpler one
@given(moving(head=True))
def test_head_motion_equals_drakes(case):
    robot, *states = case
    plant, context = robot.plant, robot.plant.CreateDefaultContext()
    head, world = plant.GetFrameByName("head"), plant.world_frame()
    at_head = (context, JacobianWrtVariable.kV, head, np.zeros(3), world, world)
    motion = head_motion(robot, *states)
    for i, (q, v, vd) in enumerate(zip(*states, strict=True)):
        plant.SetPositionsAndVelocities(context, np.concatenate([q, v]))
        pose = head.CalcPoseInWorld(context)
        R = pose.rotation().matrix()
        bias = plant.CalcBiasSpatialAcceleration(*at_head).get_coeffs()
        acceleration = plant.CalcJacobianSpatialVelocity(*at_head) @ vd + bias
        gravity = plant.gravity_field().gravity_vector()
        expected = {
            "specific_force": R.T @ (acceleration[3:] - gravity),
            "angular_velocity": head.CalcSpatialVelocity(context, world, head).rotational(),
            "angular_acceleration": R.T @ acceleration[:3],
            "position": pose.translation(),
            "rotation": R,
        }
        for name, value in expected.items():
            own = getattr(motion, name)[i]
            np.testing.assert_allclose(own, value, rtol=1e-9, atol=1e-8, err_msg=name)


S, C = GRAVITY * np.sin(0.4), GRAVITY * np.cos(0.4)


@pytest.mark.parametrize(
    "q, force",
    [
        ((0, 0, 0, 0), (0, 0, GRAVITY)),
        ((0, 0.4, 0, 0), (0, S, C)),  # right ear down: pushed left
        ((0, 0, 0.4, 0), (S, 0, C)),  # nose up: pushed forward
        ((1.0, 0, 0, 2.0), (0, 0, GRAVITY)),  # upright, whatever the heading
    ],
)
def test_attitudes_have_the_signs_of_flying(robot, q, force):
    force_at = head_motion(robot, np.array([q], dtype=float), *np.zeros((2, 1, 4))).specific_force
    np.testing.assert_allclose(force_at[0], force, atol=1e-12)
