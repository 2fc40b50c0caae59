"""Motion of the head against closed forms."""

import numpy as np
import pytest
from robots import ARM, loaded

from sdt_drake.io.errors import InputError
from sdt_drake.robot.head import GRAVITY, check_head, has_head, head_motion, head_motion_of_samples

ABOVE, BEHIND = 0.33, 0.13  # of the head from the point where roll, pitch and yaw axes meet [m]
RADIUS = 2.6


def still(robot, q, v=(0, 0, 0, 0), vd=(0, 0, 0, 0)):
    return head_motion(robot, *np.array([[q], [v], [vd]], dtype=float))


def test_axes_of_the_head_at_zero(robot):
    """x tangential (where the pilot looks), y towards the hub, z up."""
    motion = still(robot, (0, 0, 0, 0))
    np.testing.assert_allclose(motion.rotation[0], [[0, -1, 0], [1, 0, 0], [0, 0, 1]], atol=1e-12)
    np.testing.assert_allclose(motion.position[0], [RADIUS, -BEHIND, ABOVE], atol=1e-12)
    np.testing.assert_allclose(motion.specific_force[0], [0, 0, GRAVITY], atol=1e-12)
    np.testing.assert_allclose(motion.resultant_g, 1, rtol=1e-14)


def test_attitudes_have_the_signs_of_flying(robot):
    """Roll by joint 2 tilts the force sideways, pitch by joint 3 forward or back."""
    s, c = GRAVITY * np.sin(0.4), GRAVITY * np.cos(0.4)
    rolled = still(robot, (0, 0.4, 0, 0)).specific_force[0]
    pitched = still(robot, (0, 0, 0.4, 0)).specific_force[0]
    np.testing.assert_allclose(rolled, [0, s, c], atol=1e-12)  # right ear down: pushed left
    np.testing.assert_allclose(pitched, [s, 0, c], atol=1e-12)  # nose up: pushed forward


def test_constant_planetary_speed_with_the_gondola_aligned(robot, omega=-2.4):
    """sqrt(1 + (omega² R / g)²), with R that of the head, not that of the roll axis.

    Aligned: the roll angle phi at which nothing pushes sideways. The head is then closer to the
    hub, at x = a - h sin(phi) with a bank inwards; the 0.13 m behind lie along the tangent and
    give a force of their own, forward.
    """
    phi = np.arctan(omega**2 * RADIUS / GRAVITY)
    for _ in range(50):
        radius = RADIUS - ABOVE * np.sin(phi)
        phi = np.arctan(omega**2 * radius / GRAVITY)
    motion = still(robot, (0.8, -phi, 0, 0), (omega, 0, 0, 0))
    x, y, z = motion.specific_force[0]

    g = np.sqrt(1 + (omega**2 * radius / GRAVITY) ** 2)
    assert z / GRAVITY == pytest.approx(g, rel=1e-12)
    assert y == pytest.approx(0, abs=1e-12)
    assert x == pytest.approx(omega**2 * BEHIND, rel=1e-12)
    assert motion.resultant_g[0] == pytest.approx(np.hypot(g, omega**2 * BEHIND / GRAVITY))


def test_samples_are_differentiated_in_time_with_position_and_speed(robot):
    """Second order: ten times the rate, a hundred times less error."""
    errors = []
    for period in (0.01, 0.001):
        t = np.arange(0, 1 + period / 2, period)[:, None]
        w = np.array([1.0, 2.0, 3.0, 4.0])
        q, v, vd = np.sin(w * t), w * np.cos(w * t), -(w**2) * np.sin(w * t)
        exact = head_motion(robot, q, v, vd).specific_force
        found = head_motion_of_samples(robot, period, q, v).specific_force
        errors.append(np.abs(found - exact)[1:-1].max())
    assert errors[0] < 0.01 and errors[0] / errors[1] == pytest.approx(100, rel=0.1)


def test_a_robot_without_a_head_says_how_to_add_one():
    robot = loaded(ARM)
    assert not has_head(robot)
    for refuse in (check_head, lambda r: still(r, (0, 0), (0, 0), (0, 0))):
        with pytest.raises(InputError, match=r'\.sdf: no pilot\'s head; add <frame name="head"'):
            refuse(robot)
