"""Motion of the head against Drake's own kinematics, and against closed forms."""

import numpy as np
import pytest
from pydrake.multibody.tree import JacobianWrtVariable

from sdt_drake.io.errors import InputError
from sdt_drake.robot.head import GRAVITY, check_head, has_head, head_motion, head_motion_of_samples
from sdt_drake.robot.robot import edited, load_robot

ABOVE, BEHIND = 0.33, 0.13  # of the head from the point where roll, pitch and yaw axes meet [m]
RADIUS = 2.6


@pytest.fixture(scope="module")
def skew():
    """A chain whose axes meet nowhere and point anywhere, with a tilted head."""

    def edit(root):
        axes = ("0.3 -0.2 0.9", "0.1 0.8 0.5", "-0.7 0.2 0.4", "0.2 0.5 -0.6")
        poses = (None, "1.9 0.2 -0.4 0.3 -0.5 0.8", "0.1 -0.6 0.2 -0.9 0.4 0.1", "0.2 0 0.3 1 2 3")
        for joint, axis, pose in zip(root.iter("joint"), axes, poses, strict=False):
            joint.find("axis/xyz").text = axis
            if pose:
                joint.find("pose").text = pose
        (head,) = (f for f in root.iter("frame") if f.get("name") == "head")
        head.find("pose").text = "0.2 -0.3 0.4 0.5 -0.6 0.7"

    return edited(load_robot(), edit)


def headless(root):
    model = root.find("model")
    for frame in model.findall("frame"):
        if frame.get("name") == "head":
            model.remove(frame)


def moved_head(link):
    """A robot with its head in another link."""

    def edit(root):
        (head,) = (f for f in root.iter("frame") if f.get("name") == "head")
        head.set("attached_to", link)

    return edited(load_robot(), edit)


def of_drake(robot, q, v, vd):
    """Specific force, angular velocity and acceleration, position, rotation by Drake."""
    plant = robot.plant
    context = plant.CreateDefaultContext()
    head, world = plant.GetFrameByName("head"), plant.world_frame()
    plant.SetPositions(context, q)
    plant.SetVelocities(context, v)
    pose = head.CalcPoseInWorld(context)
    R = pose.rotation().matrix()
    velocity = head.CalcSpatialVelocity(context, world, head)
    J = plant.CalcJacobianSpatialVelocity(
        context, JacobianWrtVariable.kV, head, np.zeros(3), world, world
    )
    bias = plant.CalcBiasSpatialAcceleration(
        context, JacobianWrtVariable.kV, head, np.zeros(3), world, world
    )
    acceleration = J @ vd + bias.get_coeffs()
    force = R.T @ (acceleration[3:] - plant.gravity_field().gravity_vector())
    return force, velocity.rotational(), R.T @ acceleration[:3], pose.translation(), R


def compare_with_drake(robot):
    rng = np.random.default_rng(1)
    q, v, vd = rng.uniform(-3, 3, (3, 40, robot.n))
    motion = head_motion(robot, q, v, vd)
    for i in range(len(q)):
        for own, expected in zip(
            (
                motion.specific_force[i],
                motion.angular_velocity[i],
                motion.angular_acceleration[i],
                motion.position[i],
                motion.rotation[i],
            ),
            of_drake(robot, q[i], v[i], vd[i]),
            strict=True,
        ):
            np.testing.assert_allclose(own, expected, rtol=0, atol=1e-10)


def test_reference_device_as_drake(robot):
    compare_with_drake(robot)


def test_any_chain_as_drake(skew):
    compare_with_drake(skew)


@pytest.mark.parametrize("link", ["arm", "pitch_frame"])
def test_a_head_before_the_last_joint_as_drake(link):
    compare_with_drake(moved_head(link))


def still(robot, q, v=(0, 0, 0, 0), vd=(0, 0, 0, 0)):
    return head_motion(robot, *np.array([[q], [v], [vd]], dtype=float))


def test_axes_of_the_head_at_zero(robot):
    """x tangential (where the pilot looks), y towards the hub, z up."""
    motion = still(robot, (0, 0, 0, 0))
    np.testing.assert_allclose(motion.rotation[0], [[0, -1, 0], [1, 0, 0], [0, 0, 1]], atol=1e-12)
    np.testing.assert_allclose(motion.position[0], [RADIUS, -BEHIND, ABOVE], atol=1e-12)
    np.testing.assert_allclose(motion.specific_force[0], [0, 0, GRAVITY], atol=1e-12)
    np.testing.assert_allclose(motion.resultant_g, 1, rtol=1e-14)


@pytest.mark.parametrize("angle", [-0.7, 0.4, 2.0])
def test_attitudes_have_the_signs_of_flying(robot, angle):
    """Roll by joint 2 tilts the force sideways, pitch by joint 3 forward or back."""
    s, c = GRAVITY * np.sin(angle), GRAVITY * np.cos(angle)
    rolled = still(robot, (0, angle, 0, 0)).specific_force[0]
    pitched = still(robot, (0, 0, angle, 0)).specific_force[0]
    np.testing.assert_allclose(rolled, [0, s, c], atol=1e-12)  # right ear down: pushed left
    np.testing.assert_allclose(pitched, [s, 0, c], atol=1e-12)  # nose up: pushed forward


@pytest.mark.parametrize("omega", [0.5, 1.7, -2.4])
def test_constant_planetary_speed_with_the_gondola_aligned(robot, omega):
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


def test_derivative_of_the_angular_velocity_in_the_head_is_the_angular_acceleration(robot, design):
    """So filters on the angular velocity see the angular acceleration."""
    motion = design.motion
    h = 1e-5
    q, v, vd = motion.q[1200], motion.v[1200], motion.vd[1200]
    around = [-h, 0, h]
    samples = head_motion(
        robot,
        [q + v * t + vd * t * t / 2 for t in around],
        [v + vd * t for t in around],
        [vd] * 3,
    )
    rate = (samples.angular_velocity[2] - samples.angular_velocity[0]) / (2 * h)
    np.testing.assert_allclose(rate, samples.angular_acceleration[1], atol=1e-7)


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
    robot = edited(load_robot(), headless)
    assert not has_head(robot)
    for refuse in (check_head, lambda r: still(r, (0, 0, 0, 0))):
        with pytest.raises(InputError, match=r'sdt\.sdf: no pilot\'s head; add <frame name="head"'):
            refuse(robot)
