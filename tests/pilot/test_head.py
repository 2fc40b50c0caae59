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


RADIUS, ABOVE, BEHIND = 2.6, 0.33, 0.13  # m: of the arm, and of the head from the three axes
S, C = GRAVITY * np.sin(0.4), GRAVITY * np.cos(0.4)


def at(robot, q, v=(0, 0, 0, 0)):
    return head_motion(robot, *np.array([[q], [v], [(0, 0, 0, 0)]], dtype=float))


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
    np.testing.assert_allclose(at(robot, q).specific_force[0], force, atol=1e-12)


def test_the_head_looks_along_the_tangent_with_its_left_to_the_hub(robot):
    motion = at(robot, (0, 0, 0, 0))
    np.testing.assert_allclose(motion.rotation[0], [[0, -1, 0], [1, 0, 0], [0, 0, 1]], atol=1e-12)
    np.testing.assert_allclose(motion.position[0], [RADIUS, -BEHIND, ABOVE], atol=1e-12)


def test_constant_planetary_speed_is_felt_as_g_of_the_radius_of_the_head(robot, omega=-2.4):
    """sqrt(1 + (omega² R / g)²) where the roll angle phi leaves no push sideways.

    The head is then closer to the hub, at R = a - h sin(phi). The 0.13 m behind lie along the
    tangent and push forward.
    """
    radius = RADIUS
    for _ in range(50):
        phi = np.arctan(omega**2 * radius / GRAVITY)
        radius = RADIUS - ABOVE * np.sin(phi)
    motion = at(robot, (0.8, -phi, 0, 0), (omega, 0, 0, 0))
    g = np.sqrt(1 + (omega**2 * radius / GRAVITY) ** 2)
    force = [omega**2 * BEHIND, 0, g * GRAVITY]
    np.testing.assert_allclose(motion.specific_force[0], force, atol=1e-9)
    assert motion.resultant_g[0] == pytest.approx(np.linalg.norm(force) / GRAVITY, rel=1e-12)
