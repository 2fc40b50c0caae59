"""Files as they are published: rounded inertias, zeros of motors, wrists whose motors are
coupled."""

from __future__ import annotations

import numpy as np
import pytest
from robots import ARM, URDF

from sdt_drake.io.errors import InputError
from sdt_drake.machine.drive_files import Axis, Drives, Samples, samples_from, set_points
from sdt_drake.machine.recordings import Columns, read_recording
from sdt_drake.motion import Motion, checked_torque, margins
from sdt_drake.robot.robot import load_robot, parts_of


@pytest.fixture
def load(tmp_path):
    def load_text(text: str, name: str = "arm.urdf"):
        path = tmp_path / name
        path.write_text(text, encoding="utf-8")
        return load_robot(path)

    return load_text


def test_an_inertia_that_rounding_broke_is_the_nearest_that_a_body_can_have(load, caplog):
    """0.25 + 0.50 < 0.76 by one digit, 0.01: half of it on each of the two small moments."""
    robot = load(ARM.replace("<izz>0.6", "<izz>0.76"), "arm.sdf")
    inertia = parts_of(robot.plant.GetBodyByName("upper"))[2]
    np.testing.assert_allclose(np.diag(inertia), [0.255, 0.505, 0.76], rtol=1e-12)
    assert robot.accepted == (
        "link 'upper': inertia misses the triangle inequality by 0.01 kg m², within its last "
        "printed digit, 0.01; set to the nearest possible inertia",
    )
    assert [r.message for r in caplog.records] == [f"{robot.path}: {robot.accepted[0]}"]


@pytest.mark.parametrize(
    "moments", [("0.25", "0.50", "0.77"), ("1", "1", "3"), ("0.3", "0.2", "0.7")]
)
def test_more_than_a_digit_is_refused(load, moments):
    new = "".join(f"<{k}>{x}</{k}>" for k, x in zip(("ixx", "iyy", "izz"), moments, strict=True))
    old = "<ixx>0.25</ixx><iyy>0.5</iyy><izz>0.6</izz>"
    with pytest.raises(InputError, match="triangle inequality"):
        load(ARM.replace(old, new), "arm.sdf")


def test_an_inertia_below_zero_by_rounding_is_read(load):
    """ixx iyy < ixy²: the small moment is -1e-5, though 0.0002 may be 0.00024."""
    old = '<inertia ixx="0.1" iyy="0.2" izz="0.25"/>'
    new = '<inertia ixx="0.0002" iyy="0.0200" izz="0.0202" ixy="0.0021" ixz="0" iyz="0"/>'
    robot = load(URDF.replace(old, new))
    inertia = parts_of(robot.plant.GetBodyByName("lower"))[2]
    low, middle, high = np.linalg.eigvalsh(inertia)
    assert low >= -1e-15 and low + middle >= high * (1 - 1e-9)
    np.testing.assert_allclose(inertia[0, 1], 0.0021, atol=5e-5)
    np.testing.assert_allclose(np.diag(inertia), [0.0002, 0.02, 0.0202], atol=1e-4)


SPINNING = URDF.replace('xyz="0.3 0 0"', 'xyz="0 0.3 0"')  # the mass is on the elbow's axis
FLAT = '<inertia ixx="0.1" iyy="0.2" izz="0.25"/>'


def test_a_zero_by_rounding_moves_a_joint_that_nothing_else_would(load):
    text = SPINNING.replace(FLAT, '<inertia ixx="0.003" iyy="0.000" izz="0.003"/>')
    robot = load(text)
    np.testing.assert_allclose(
        np.diag(parts_of(robot.plant.GetBodyByName("lower"))[2]), [0.003, 0.0005, 0.003]
    )
    assert robot.accepted == ("link 'lower': iyy printed as 0, set to 0.0005 kg m²",)
    with pytest.raises(InputError, match="joint 'elbow': inertia about its axis"):
        load(text.replace("0.000", "0").replace("0.003", "3"))


@pytest.mark.parametrize("offset, told", [("0.0", 0), ("1.57", 1)])
def test_zeros_of_motors_have_no_say(load, offset, told):
    joint = '<joint name="shoulder"><hardware'
    text = URDF.replace(joint, joint.replace("><", f"><offset>{offset}</offset><"))
    robot = load(text)
    assert len(robot.accepted) == told and all("1.57 is ignored" in x for x in robot.accepted)
    np.testing.assert_array_equal(robot.gear_ratio, [10, 1])


def test_what_has_no_meaning_in_a_urdf_is_left_out(load):
    text = URDF.replace('<limit effort="40"/>', '<limit effort="40" lower="-6.28" upper="6.28"/>')
    text = text.replace("<dynamics ", '<dynamics D="1" K="7000" mu_coulomb="0" mu_viscous="16" ')
    robot = load(text)
    assert np.isinf(robot.position_upper[1]) and robot.position_upper[0] == 1
    np.testing.assert_array_equal(robot.damping, [0.7, 0])
    left = "have no meaning in URDF and were ignored"
    named = [f"{x} of <dynamics>" for x in ("D", "K", "mu_coulomb")]
    assert robot.accepted == (
        f"joint 'shoulder': {', '.join(named)} and mu_viscous of <dynamics> {left}",
        f"joint 'elbow': lower of <limit> and upper of <limit> {left}",
    )


# --- coupled motors ------------------------------------------------------------------------------

COUPLED = ARM.replace(
    "<limit><effort>40</effort></limit></axis>",
    "<limit><effort>40</effort></limit></axis>"
    '<drake:gear_ratio>4</drake:gear_ratio><sdt:turns_with joint="shoulder">-2</sdt:turns_with>',
).replace("<sdf ", '<sdf xmlns:sdt="urn:sdt_drake" ')
MATRIX = np.array([[10.0, 0.0], [-2.0, 4.0]])


@pytest.fixture
def wrist(load):
    return load(COUPLED, "arm.sdf")


def test_a_motor_that_turns_with_another_joint(wrist):
    np.testing.assert_array_equal(wrist.coupling, MATRIX)
    assert wrist.is_coupled and "also turns with 'shoulder' (-2)" in wrist.accepted[0]
    # Motor speeds: 10 x 1 = 10, -2 x 1 + 4 x 3 = 10. Torques by power: 5 x 10 - 2 x 7, 4 x 7.
    np.testing.assert_allclose(wrist.of_motors([1, 3]), [10, 10])
    np.testing.assert_allclose(wrist.of_joints([10, 10]), [1, 3])
    np.testing.assert_allclose(wrist.joint_torque([5, 7]), [36, 28])
    np.testing.assert_allclose(wrist.motor_torque([36, 28]), [5, 7])


def test_the_same_in_a_urdf(load, wrist):
    actuator = '<actuator name="motor">'
    second = (
        '<transmission name="wrist"><type>SimpleTransmission</type><joint name="elbow"/>'
        '<actuator name="m2"><sdt:turns_with joint="shoulder" value="-2"/>'
        "<mechanicalReduction>4</mechanicalReduction></actuator></transmission></robot>"
    )
    assert actuator in URDF
    np.testing.assert_array_equal(load(URDF.replace("</robot>", second)).coupling, MATRIX)


def test_a_differential_of_ros(load):
    """Motors 2 (3 v_1 + 5 v_2) and 7 (3 v_1 - 5 v_2), the second counted the other way."""

    def part(tag, name, ratio):
        return f'<{tag} name="{name}"><mechanicalReduction>{ratio}</mechanicalReduction></{tag}>'

    parts = [("joint", "shoulder", 3), ("joint", "elbow", 5), ("actuator", "a", 2)]
    inner = "".join(part(*each) for each in (*parts, ("actuator", "b", 7)))
    kind = "<type>transmission_interface/DifferentialTransmission</type>"
    start, end = URDF.index("<transmission"), URDF.index("</transmission>")
    text = f'{URDF[:start]}<transmission name="wrist">{kind}{inner}{URDF[end:]}'
    np.testing.assert_array_equal(load(text).coupling, [[6, 10], [-21, 35]])
    with pytest.raises(
        InputError, match="'wrist': <mechanicalReduction> is '0', expected a number"
    ):
        load(text.replace(">5<", ">0<"))


@pytest.mark.parametrize(
    "old, new, message",
    [
        ('joint="shoulder">', 'joint="wrist">', "joint='wrist', expected another of shoulder"),
        ('joint="shoulder">', 'joint="elbow">', "joint='elbow', expected another of shoulder"),
        (">-2</sdt", ">some</sdt", "<sdt:turns_with> is 'some', expected a number"),
        ("sdt:turns_with", "sdt:turn_with", "<turn_with> in <joint> is not supported"),
        (
            "<drake:rotor_inertia>",
            '<sdt:turns_with joint="elbow">-20</sdt:turns_with><drake:rotor_inertia>',
            "motors cannot turn each joint alone",
        ),
    ],
)
def test_a_coupling_that_is_none_is_refused(load, old, new, message):
    assert old in COUPLED
    with pytest.raises(InputError, match=message):
        load(COUPLED.replace(old, new), "arm.sdf")


def test_recorded_torques_of_coupled_motors_become_those_of_the_joints(wrist, tmp_path):
    path = tmp_path / "run.csv"
    rows = "".join(f"{0.01 * i},{0.1 * i},0,5,7\n" for i in range(50))
    path.write_text("time,q_1,q_2,tau_1,tau_2\n" + rows)
    tau = read_recording(path, wrist, side="motor").signals["tau"]
    np.testing.assert_allclose(tau, np.tile([36.0, 28.0], (50, 1)))
    columns = Columns(position_side="motor", direction=[1, -1])  # motor 2 counts the other way
    q = read_recording(path, wrist, columns).signals["q"]
    np.testing.assert_allclose(q[10], [0.1, 0.05])  # 1 = 10 x 0.1, and 0 = -2 x 0.1 + 4 x 0.05


def still(robot, q):
    rest = np.zeros((3, robot.n))
    return Motion(0.005, rest + q, rest, rest)


def test_planned_motions_keep_what_coupled_motors_can_give(wrist, load):
    """At rest at q = 0 the shoulder carries 4 x 0.5 + 2 x 1.1, the elbow 2 x 0.3 kg m times g; the
    shoulder's motor carries half of the elbow's load, too: tau_1 = 10 m_1 - 2 m_2."""
    motion, g = still(wrist, [0.0, 0.0]), 9.81
    loads = -np.array([4.2, 0.6]) * g  # about +y, which lifts
    asked = [(loads[0] + loads[1] / 2) / 90, loads[1] / 40]
    np.testing.assert_allclose(margins(wrist, motion).share["torque"][0], np.abs(asked), rtol=1e-9)
    just = f"<effort>{0.99 * abs(asked[0]) * 90}"
    weak = load(COUPLED.replace("<effort>90", just), "weak.sdf")
    with pytest.raises(InputError, match=r"joint 1 'shoulder'.*torque"):
        checked_torque(weak, motion)
    uncoupled = COUPLED.replace('<sdt:turns_with joint="shoulder">-2</sdt:turns_with>', "")
    checked_torque(load(uncoupled.replace("<effort>90", "<effort>41.3"), "own.sdf"), motion)


def test_set_points_of_coupled_motors(wrist):
    """A motor turn is 1000 increments, but the second counts the other way."""
    drives = Drives(
        cycle_time=0.01,
        axes=[
            Axis(increments=1000, rated_torque=10),
            Axis(increments=1000, rated_torque=10, sign=-1),
        ],
    )
    turn = 2 * np.pi
    q = np.array([[0.0, 0.0], [0.01, 0.03], [0.01, 0.03]]) * turn
    v, tau = np.diff(q, axis=0, append=q[-1:]) / 0.01, np.tile([36.0, 28.0], (3, 1))
    samples = Samples(0.01, q, v, tau)
    points = set_points(wrist, drives, samples)
    np.testing.assert_array_equal(points.position[1], [100, -100])
    np.testing.assert_array_equal(points.torque[0], [500, -700])
    back = samples_from(wrist, drives, points, q[0])
    for name in ("q", "v", "tau"):
        np.testing.assert_allclose(getattr(back, name), getattr(samples, name), atol=1e-9)
