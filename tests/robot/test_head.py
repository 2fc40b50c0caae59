"""Motion of the head against closed forms."""

import numpy as np
import pytest
from robots import ARM, loaded

from sdt_drake.io.errors import InputError
from sdt_drake.robot.head import GRAVITY, check_head, has_head, head_motion, head_motion_of_samples

ABOVE, BEHIND = 0.33, 0.13  # of the head from the point where roll, pitch and yaw axes meet [m]
RADIUS = 2.6


def still(robot, q):
    return head_motion(robot, np.array([q]), *np.zeros((2, 1, 4)))


def test_axes_at_zero_and_attitudes_are_those_of_flying(robot):
    """x tangential (where the pilot looks), y towards the hub, z up."""
    motion = still(robot, (0, 0, 0, 0))
    np.testing.assert_allclose(motion.rotation[0], [[0, -1, 0], [1, 0, 0], [0, 0, 1]], atol=1e-12)
    np.testing.assert_allclose(motion.position[0], [RADIUS, -BEHIND, ABOVE], atol=1e-12)
    np.testing.assert_allclose(motion.resultant_g, 1, rtol=1e-14)
    s, c = GRAVITY * np.sin(0.4), GRAVITY * np.cos(0.4)
    for q, force in (
        ((0, 0, 0, 0), (0, 0, GRAVITY)),
        ((0, 0.4, 0, 0), (0, s, c)),  # roll, right ear down: pushed left
        ((0, 0, 0.4, 0), (s, 0, c)),  # pitch, nose up: pushed forward
    ):
        np.testing.assert_allclose(still(robot, q).specific_force[0], force, atol=1e-12)


def test_samples_are_differentiated_about_their_own_times(robot):
    """To second order: one-sided differences would be off by a hundred times more."""
    t, w = np.arange(0, 1, 0.001)[:, None], np.array([1.0, 2.0, 3.0, 4.0])
    q, v, vd = np.sin(w * t), w * np.cos(w * t), -(w**2) * np.sin(w * t)
    exact = head_motion(robot, q, v, vd).specific_force
    found = head_motion_of_samples(robot, 0.001, q, v).specific_force
    np.testing.assert_allclose(found[1:-1], exact[1:-1], atol=1e-4)


def test_a_robot_without_a_head_says_how_to_add_one():
    robot = loaded(ARM)
    assert not has_head(robot)
    for refuse in (check_head, lambda robot: head_motion(robot, *np.zeros((3, 1, 2)))):
        with pytest.raises(InputError, match=r'\.sdf: no pilot\'s head; add <frame name="head"'):
            refuse(robot)
