"""Models of a robot with stated errors, against calculations by hand; and edited SDFs."""

from __future__ import annotations

import dataclasses
import re
import xml.etree.ElementTree as ET

import numpy as np
import pytest
from robots import ARM, chain_sdf

from sdt_drake.io.errors import InputError
from sdt_drake.robot.deviation import Deviation, deviated
from sdt_drake.robot.robot import edited, load_robot


@pytest.fixture
def load(tmp_path):
    """Write the text of an SDF, load it, and edit what was loaded."""

    def load_text(text: str, edit=None):
        path = tmp_path / "robot.sdf"
        path.write_text(text, encoding="utf-8")
        robot = load_robot(path)
        return robot if edit is None else edited(robot, edit)

    return load_text


def mass_matrix(robot, q=None):
    """M(q), joint side [kg m²], rotors included."""
    context = robot.plant.CreateDefaultContext()
    if q is not None:
        robot.plant.SetPositions(context, q)
    return robot.plant.CalcMassMatrix(context)


def total_mass(robot) -> float:
    return robot.plant.CalcTotalMass(robot.plant.CreateDefaultContext())


def central_inertia(robot, link: str):
    """Mass [kg], centre of mass [m] and central inertia [kg m²] of a link, in its frame."""
    inertia = robot.plant.GetBodyByName(link).default_spatial_inertia()
    central = inertia.Shift(inertia.get_com()).CalcRotationalInertia().CopyToFullMatrix3()
    return inertia.get_mass(), inertia.get_com(), central


# --- an edit of the SDF ----------------------------------------------------------------------


def test_an_edit_that_does_nothing_changes_nothing(robot):
    same = edited(robot, lambda root: None)
    assert same is not robot
    check_same_but_inertia(same, robot)
    q = [0.3, -1.2, 2.0, 0.7]
    np.testing.assert_array_equal(mass_matrix(same, q), mass_matrix(robot, q))


def check_same_but_inertia(model, robot):
    """All fields agree but plant and text; and the rotors are in the mass matrix of both."""
    for field in dataclasses.fields(robot):
        if field.name not in ("plant", "sdf"):
            a, b = getattr(model, field.name), getattr(robot, field.name)
            assert np.array_equal(a, b), field.name
    for any_robot in (model, robot):
        plant = any_robot.plant
        indices = plant.GetJointActuatorIndices()
        actuators = [plant.get_joint_actuator(index) for index in indices]
        assert tuple(a.joint().name() for a in actuators) == robot.joint_names
        rotors = [a.default_rotor_inertia() for a in actuators]
        np.testing.assert_array_equal(rotors, robot.rotor_inertia)
        ratios = [a.default_gear_ratio() for a in actuators]
        np.testing.assert_array_equal(ratios, robot.gear_ratio)


@pytest.mark.parametrize("uri", ["http://drake.mit.edu", "drake.mit.edu"])
def test_drakes_elements_survive_an_edit_whatever_the_address_of_their_prefix(load, uri):
    text = ARM.replace("http://drake.mit.edu", uri)
    arm, same = load(text), load(text, lambda root: None)
    np.testing.assert_array_equal(same.rotor_inertia, [0.01, 0])
    np.testing.assert_array_equal(same.gear_ratio, [10, 1])
    np.testing.assert_array_equal(mass_matrix(same), mass_matrix(arm))
    # And they are checked.
    with pytest.raises(InputError, match="joint 'shoulder': <rotor_inertia> is 'nan'"):
        load(text.replace("inertia>0.01", "inertia>nan"))


def test_an_edit_reaches_the_plant_and_not_the_file(load):
    def edit(root):
        root.find(".//link[@name='lower']/inertial/mass").text = "7"

    other = load(ARM, edit)
    assert other.plant.GetBodyByName("lower").default_mass() == 7
    assert other.path.read_text(encoding="utf-8") == ARM
    assert total_mass(load_robot(other.path)) == 6


@pytest.mark.parametrize(
    "path, text, message",
    [
        (".//link[@name='lower']/inertial/mass", "-7", ": link 'lower': <mass> -7 kg, expected"),
        (".//joint[@name='elbow']/child", "nothing", ": Child frame .*nothing"),
        (".//joint[@name='elbow']/axis/limit/effort", "0", ": joint 'elbow': actuator effort"),
    ],
)
def test_what_an_edit_leaves_is_checked_as_a_file_is(load, tmp_path, path, text, message):
    def edit(root):
        root.find(path).text = text

    where = re.escape(str(tmp_path / "robot.sdf"))
    with pytest.raises(InputError, match=f"^{where}{message}") as error:
        load(ARM, edit)
    assert "\n" not in str(error.value) and "-string>" not in str(error.value)


def test_meshes_are_not_looked_for(load):
    mesh = "<geometry><mesh><uri>package://nowhere/arm.obj</uri></mesh></geometry>"
    text = ARM.replace(
        '<link name="upper">', f'<link name="upper"><visual name="v">{mesh}</visual>'
    )
    arm = load(text)
    np.testing.assert_array_equal(mass_matrix(load(text, lambda root: None)), mass_matrix(arm))


# --- each error ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "deviation",
    [
        Deviation("link_2", payload_mass=3),
        Deviation("link_2", payload_mass=-0.5, payload_offset=[0.1, -0.2, 0.3]),
        Deviation(inertia_scale=1.25),  # there is no link "payload" here
        Deviation("link_2", 3.0, [0.1, -0.2, 0.3], 0.8, link_scales=[1.5, 0.9, 1.0, 1.1]),
    ],
    ids=str,
)
def test_every_link_is_what_the_deviation_says_and_nothing_else_changes(load, deviation):
    robot = load(chain_sdf(3, seed=4, base=True))  # with products of inertia
    model = deviated(robot, deviation)
    in_file = [link.get("name") for link in ET.fromstring(robot.sdf).iter("link")]
    for link, own in zip(in_file, deviation.link_scales or [1.0] * 4, strict=True):
        m, com, central = central_inertia(robot, link)
        scale = deviation.inertia_scale * own
        if link == deviation.payload:  # the same body, evenly heavier, at another place
            scale *= (m + deviation.payload_mass) / m
            com = com + deviation.payload_offset
        mass, moved, inertia = central_inertia(model, link)
        assert mass == pytest.approx(scale * m, rel=1e-12)
        np.testing.assert_allclose(moved, com, atol=1e-14)
        np.testing.assert_allclose(inertia, scale * central, rtol=1e-9, atol=1e-11)
    check_same_but_inertia(model, robot)


@pytest.mark.parametrize(
    "pose, com",
    [
        ("", [0.1, 0.2, 0.3]),
        ('<pose rotation_format="quat_xyzw"/>', [0.1, 0.2, 0.3]),
        ('<pose degrees="true">\n 0.3 0 -1\n 0 0 90 </pose>', [0.4, 0.2, -0.7]),
        ('<pose rotation_format="quat_xyzw">0.3 0 -1 0 0 1 1</pose>', [0.4, 0.2, -0.7]),
    ],
)
def test_any_way_to_write_the_pose_of_the_payload_will_do(load, pose, com):
    arm = load(ARM.replace("<pose>0.3 0 0 0 0 0</pose>", pose))
    model = deviated(arm, Deviation("lower", payload_offset=[0.1, 0.2, 0.3]))
    _, moved, central = central_inertia(model, "lower")
    np.testing.assert_allclose(moved, com, atol=1e-15)
    # It is not turned by the offset: a pose of 90 deg about z swaps ixx and iyy, another does not.
    turned = " 90 " in pose or "1 1<" in pose
    moments = [0.2, 0.1, 0.25] if turned else [0.1, 0.2, 0.25]
    np.testing.assert_allclose(central, np.diag(moments), atol=1e-12)


def test_a_link_without_mass_gets_none(load):
    start, end = ARM.index("<mass>"), ARM.index("</inertial>")
    zero = "<mass>0</mass><inertia><ixx>0</ixx><iyy>0</iyy><izz>0</izz></inertia>"
    robot = load(ARM[:start] + zero + ARM[end:])
    assert total_mass(deviated(robot, Deviation(inertia_scale=1.5))) == 3.0
    with pytest.raises(InputError, match="payload_mass: link 'upper' has no mass to scale"):
        deviated(robot, Deviation("upper", payload_mass=1.0))


# --- none, several, bad ones -----------------------------------------------------------------


def test_without_errors_the_model_is_the_robot_itself(robot):
    assert Deviation().exact
    assert deviated(robot, Deviation()) is robot
    assert deviated(robot, Deviation(payload="gondola")) is robot
    with pytest.raises(InputError, match=r"^deviation\.payload: no link 'paylod', expected one"):
        deviated(robot, Deviation(payload="paylod"))
    for errors in (
        Deviation(payload_mass=1e-9),
        Deviation(payload_offset=[0, 0, 1e-9]),
        Deviation(inertia_scale=1 + 1e-9),
    ):
        assert not errors.exact
        assert deviated(robot, errors) is not robot


def test_errors_of_a_model_of_a_model_add_up(robot):
    once = deviated(robot, Deviation(inertia_scale=2, payload_mass=10))
    twice = deviated(once, Deviation(payload_mass=5))
    assert total_mass(once) == pytest.approx(2 * (total_mass(robot) + 10), rel=1e-12)
    assert total_mass(twice) == pytest.approx(total_mass(once) + 5, rel=1e-12)


@pytest.mark.parametrize(
    "values, message",
    [
        (
            {"payload_mass": -200},
            "payload_mass: -200 kg would leave -20 kg of link 'payload', expected more than -180",
        ),
        (
            {"payload_mass": -180, "inertia_scale": 2.0},
            "payload_mass: -180 kg would leave 0 kg of link 'payload', expected more than -180",
        ),
        (
            {"payload": "seat", "payload_offset": [0, 0, 1]},
            "payload: no link 'seat', expected one of arm, roll_frame, pitch_frame, gondola, "
            "payload",
        ),
        (
            {"link_scales": [1.1] * 4},
            "link_scales: 4 value(s), expected 5, one for each of arm, roll_frame, pitch_frame, "
            "gondola, payload",
        ),
    ],
)
def test_an_error_that_does_not_fit_the_robot_is_refused(robot, values, message):
    with pytest.raises(InputError) as error:
        deviated(robot, Deviation(**values), "model")
    assert str(error.value) == f"model.{message}"
