"""Files as they are published: rounded inertias, zeros of motors, wrists whose motors are
coupled."""

import numpy as np
import pytest
from helpers.robots import ARM, URDF, loaded, refused
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

from sdt_drake.io.errors import InputError
from sdt_drake.machine.drive_files.drives import Axis, Drives
from sdt_drake.machine.drive_files.formats import write_drive_table
from sdt_drake.machine.drive_files.set_points import Samples, samples_from, samples_of, set_points
from sdt_drake.machine.recordings.columns import Columns
from sdt_drake.machine.recordings.reading import read_recording
from sdt_drake.motion import Motion, checked_torque, margins
from sdt_drake.robot.parsed import parts_of
from sdt_drake.robot.published import few

FLAT = '<inertia ixx="0.1" iyy="0.2" izz="0.25"/>'


def moments_of(robot, link):
    return parts_of(robot.plant.GetBodyByName(link))[2]


def test_rounded_inertia_becomes_the_nearest_physical_one(caplog):
    """0.25 + 0.50 < 0.76 by one digit, 0.01: half of it on each of the two small moments."""
    robot = loaded(ARM.replace("<izz>0.6", "<izz>0.76"))
    np.testing.assert_allclose(np.diag(moments_of(robot, "upper")), [0.255, 0.505, 0.76])
    (told,) = robot.accepted
    assert "link 'upper': inertia misses the triangle inequality by 0.01 kg m²" in told
    assert [r.message for r in caplog.records] == [f"{robot.path}: {told}"]


def test_inertia_printed_as_0_is_raised_where_a_joint_needs_it():
    text = URDF.replace('xyz="0.3 0 0"', 'xyz="0 0.3 0"')  # the mass is on the elbow's axis
    text = text.replace(FLAT, '<inertia ixx="0.003" iyy="0.000" izz="0.003"/>')
    robot = loaded(text, ".urdf")
    np.testing.assert_allclose(np.diag(moments_of(robot, "lower")), [0.003, 0.0005, 0.003])
    assert robot.accepted == ("link 'lower': iyy printed as 0, set to 0.0005 kg m²",)
    whole = 'ixx="3" iyy="0" izz="3"'
    refused(text, 'ixx="0.003" iyy="0.000" izz="0.003"', whole, "joint 'elbow': inertia about")


# --- coupled motors ------------------------------------------------------------------------------

TURNS = '<sdt:turns_with joint="shoulder">-2</sdt:turns_with><drake:gear_ratio>4</drake:gear_ratio>'
COUPLED = ARM.replace("<sdf ", '<sdf xmlns:sdt="urn:sdt_drake" ')
COUPLED = COUPLED.replace("40</effort></limit></axis>", f"40</effort></limit></axis>{TURNS}")
MATRIX = np.array([[10.0, 0.0], [-2.0, 4.0]])


@pytest.fixture
def wrist():
    return loaded(COUPLED)


def test_coupled_motor_has_the_sides_and_inertia_by_hand(wrist):
    np.testing.assert_array_equal(wrist.coupling, MATRIX)
    assert wrist.is_coupled and "also turns with 'shoulder' (-2)" in wrist.accepted[0]
    # Motor speeds: 10 x 1 = 10, -2 x 1 + 4 x 3 = 10. Torques by power: 5 x 10 - 2 x 7, 4 x 7.
    np.testing.assert_allclose(wrist.of_motors([1, 3]), [10, 10])
    np.testing.assert_allclose(wrist.of_joints([10, 10]), [1, 3])
    np.testing.assert_allclose(wrist.joint_torque([5, 7]), [36, 28])
    np.testing.assert_allclose(wrist.motor_torque([36, 28]), [5, 7])


def test_urdf_transmissions_give_the_coupling():
    second = (
        '<transmission name="wrist"><type>SimpleTransmission</type><joint name="elbow"/>'
        '<actuator name="m2"><sdt:turns_with joint="shoulder" value="-2"/>'
        "<mechanicalReduction>4</mechanicalReduction></actuator></transmission></robot>"
    )
    wrist = loaded(URDF.replace("</robot>", second), ".urdf")
    np.testing.assert_array_equal(wrist.coupling, MATRIX)


def test_ros_differential_transmission_gives_the_coupling():
    """Motors 2 (3 v_1 + 5 v_2) and 7 (3 v_1 - 5 v_2), the second counted the other way."""
    part = '<{0} name="{1}"><mechanicalReduction>{2}</mechanicalReduction></{0}>'
    parts = [("joint", "shoulder", 3), ("joint", "elbow", 5), ("actuator", "a", 2)]
    inner = "".join(part.format(*each) for each in (*parts, ("actuator", "b", 7)))
    kind = "<type>transmission_interface/DifferentialTransmission</type>"
    start, end = URDF.index("<transmission"), URDF.index("</transmission>")
    text = f'{URDF[:start]}<transmission name="wrist">{kind}{inner}{URDF[end:]}'
    robot = loaded(text, ".urdf")
    np.testing.assert_array_equal(robot.coupling, [[6, 10], [-21, 35]])
    for one, other in zip(
        ("'shoulder'", "'elbow'"), ("'elbow' (10)", "'shoulder' (-21)"), strict=True
    ):
        assert f"the motor of {one} also turns with {other}: rec" in " ".join(robot.accepted)
    refused(text, ">5<", ">0<", "'wrist': <mechanicalReduction> is '0', expected")


def test_of_many_names_the_first_are_told():
    assert few("abcd") == "a, b, c and d" and few("abcdef") == "a, b, c and 3 others"


def test_recorded_torques_of_coupled_motors_become_joint_torques(wrist, tmp_path):
    path = tmp_path / "run.csv"
    rows = "".join(f"{0.01 * i},{0.1 * i},0,5,7\n" for i in range(50))
    path.write_text("time,q_1,q_2,tau_1,tau_2\n" + rows)
    tau = read_recording(path, wrist, side="motor").signals["tau"]
    np.testing.assert_allclose(tau, np.tile([36.0, 28.0], (50, 1)))
    columns = Columns(position_side="motor", direction=[1, -1])  # motor 2 counts the other way
    q = read_recording(path, wrist, columns).signals["q"]
    np.testing.assert_allclose(q[10], [0.1, 0.05])  # 1 = 10 x 0.1, and 0 = -2 x 0.1 + 4 x 0.05


def test_plan_keeps_torque_limits_of_coupled_motors(wrist):
    """At rest at q = 0 the shoulder carries 4 x 0.5 + 2 x 1.1, the elbow 2 x 0.3 kg m times g; the
    shoulder's motor carries half of the elbow's load, too: tau_1 = 10 m_1 - 2 m_2."""
    motion = Motion(0.005, *np.zeros((3, 3, 2)))
    asked = 9.81 * np.array([(4.2 + 0.6 / 2) / 90, 0.6 / 40])
    np.testing.assert_allclose(margins(wrist, motion).share["torque"][0], asked, rtol=1e-9)
    weak = COUPLED.replace("<effort>90", f"<effort>{0.99 * asked[0] * 90}")
    with pytest.raises(InputError, match=r"joint 1 'shoulder'.*torque"):
        checked_torque(loaded(weak), motion)
    checked_torque(loaded(weak.replace(TURNS, "")), motion)


def test_drive_table_has_rotor_torques_of_coupled_motors(wrist, tmp_path):
    """A rotor of 0.03 kg m² on motor 2, which turns at -2 v_1 + 4 v_2, and nothing on motor 1."""
    turns = TURNS + "<drake:rotor_inertia>0.03</drake:rotor_inertia>"
    heavier = loaded(COUPLED.replace(TURNS, turns))
    v = np.array([[0.0, 0.0], [0.02, 0.0], [0.02, 0.05], [0.0, 0.0]])
    motion = Motion.from_speeds(0.01, np.array([0.3, -0.2]), v)
    torque = []
    for robot in (wrist, heavier):
        write_drive_table(tmp_path / "t.csv", robot, samples_of(robot, motion, 0.01))
        torque.append(np.loadtxt(tmp_path / "t.csv", delimiter=",", skiprows=1)[:, -2:])
    rotor = 0.03 * (motion.vd @ [-2, 4])
    np.testing.assert_allclose(torque[1] - torque[0], np.stack([0 * rotor, rotor], 1), atol=1e-9)


def test_set_points_of_coupled_motors_convert_back(wrist):
    """A motor turn is 1000 increments, but the second counts the other way."""
    axes = [Axis(increments=1000, rated_torque=10, sign=sign) for sign in (1, -1)]
    drives = Drives(cycle_time=0.01, axes=axes)
    q = np.array([[0.0, 0.0], [0.01, 0.03], [0.01, 0.03]]) * 2 * np.pi
    v = np.diff(q, axis=0, append=q[-1:]) / 0.01
    points = set_points(wrist, drives, Samples(0.01, q, v, np.tile([36.0, 28.0], (3, 1))))
    np.testing.assert_array_equal(points.position[1], [100, -100])
    np.testing.assert_array_equal(points.torque[0], [500, -700])
    back = samples_from(wrist, drives, points, q[0])
    np.testing.assert_allclose([back.q, back.v], [q, v], atol=1e-9)
    np.testing.assert_allclose(back.tau, np.tile([36.0, 28.0], (3, 1)), atol=1e-9)


# --- what a urdf says is read as drake reads it ----------------------------------------------


def dynamics(plant, q):
    """Mass matrix and gravity torques, joint side."""
    context = plant.CreateDefaultContext()
    plant.SetPositions(context, q)
    return plant.CalcMassMatrix(context), plant.CalcGravityGeneralizedForces(context)


def test_urdf_poses_and_inertias_equal_drakes_own_reader():
    text = URDF
    for old, new in (
        ('<origin xyz="0.8 0 0"/>', '<origin xyz="0.8 0.1 -0.2" rpy="0.3 -0.5 1.1"/>'),
        ('<origin xyz="0.5 0 0" rpy="0 0 0"/>', '<origin xyz="0.5 0.1 0" rpy="0.4 -0.3 0.9"/>'),
        ('ixy="0" ixz="0" iyz="0"', 'ixy="0.02" ixz="-0.01" iyz="0.03"'),
        ('<link name="lower">', '<link name="world"/><link name="lower">'),
        ('<link name="base"/>', ""),
        ('link="base"', 'link="world"'),
        ('<axis xyz="0 1 0"/>\n    <limit effort="40"/>', '<limit effort="40"/>'),  # along x
    ):
        assert old in text
        text = text.replace(old, new)
    robot, plant = loaded(text, ".urdf"), MultibodyPlant(0.0)
    still = text.replace('inertia value="0.01"', 'inertia value="0"')
    Parser(plant).AddModelsFromString(still, "urdf")
    plant.Finalize()
    for q in np.random.default_rng(1).uniform(-3, 3, (5, 2)):
        (M, gravity), (M_drake, gravity_drake) = dynamics(robot.plant, q), dynamics(plant, q)
        np.testing.assert_allclose(M - np.diag(robot.reflected_inertia), M_drake, rtol=1e-10)
        np.testing.assert_allclose(gravity, gravity_drake, rtol=1e-12, atol=1e-12)
