"""The URDF of a changed robot: the text of its file with other masses, inertias and motors."""

import xml.etree.ElementTree as ET

import numpy as np

from sdt_drake.io.arrays import Array
from sdt_drake.io.files import read_text
from sdt_drake.robot.held import weld
from sdt_drake.robot.parsed import parts_of
from sdt_drake.robot.published import distinct
from sdt_drake.robot.robot import Robot
from sdt_drake.robot.sdf import DRAKE, child
from sdt_drake.robot.xml_text import edited_text

MAX_FILE = 100_000_000
"""Largest size of a robot's file [bytes]."""


def urdf_with(robot: Robot, file: Robot) -> str:
    """Return the text of a URDF with the links, damping and rotors of a robot that was edited.

    All else stays as it is: comments, shapes, names, other tools' elements. Held joints are fixed,
    and relative paths of meshes become absolute.

    Args:
        robot: the edited robot.
        file: the robot of the URDF.
    """
    return edited_text(read_text(file.path, MAX_FILE), lambda root: _edit(root, robot, file))


def _edit(root: ET.Element, robot: Robot, file: Robot) -> None:
    joints = {joint.get("name", ""): joint for joint in root.findall("joint")}
    for link in root.findall("link"):
        name = distinct(link.get("name", ""), joints)
        if robot.plant.HasBodyNamed(name) and robot.plant.GetBodyByName(name).default_mass() > 0:
            new, old = (parts_of(x.plant.GetBodyByName(name)) for x in (robot, file))
            now, was = (
                np.hstack([mass, com, central.ravel()]) for mass, com, central in (new, old)
            )
            if not np.array_equal(now, was):
                _put_link(link, *new)
    for k, name in enumerate(robot.joint_names):
        if robot.damping[k] != file.damping[k]:
            child(joints[name], "dynamics").set("damping", repr(float(robot.damping[k])))
        if robot.rotor_inertia[k] != file.rotor_inertia[k]:
            _put_rotor(root, name, float(robot.rotor_inertia[k]))
    weld(root, file.held, file.path)
    for mesh in root.iter("mesh"):
        uri = mesh.get("filename", "")
        if uri and "://" not in uri:
            mesh.set("filename", str((file.path.parent / uri).resolve()))


def _put_link(link: ET.Element, mass: float, com: Array, central: Array) -> None:
    """Set mass [kg], centre of mass [m] and central inertia [kg m²] along the link's axes."""
    inertial = child(link, "inertial")
    child(inertial, "mass").set("value", repr(mass))
    place = child(inertial, "origin")
    place.set("xyz", " ".join(repr(float(x)) for x in com))
    place.set("rpy", "0 0 0")
    moments = child(inertial, "inertia")
    for i, j in zip(*np.triu_indices(3), strict=True):
        moments.set(f"i{'xyz'[i]}{'xyz'[j]}", repr(float(central[i, j])))


def _put_rotor(root: ET.Element, joint: str, inertia: float) -> None:
    """Set the rotor inertia of a joint's motor, motor side [kg m²], in its transmission."""
    actuators = {
        driven.get("name"): actuator
        for transmission in root.findall("transmission")
        for driven, actuator in zip(
            transmission.findall("joint"), transmission.findall("actuator"), strict=False
        )
    }
    actuator = actuators.get(joint)
    if actuator is None:
        motor = ET.SubElement(root, "transmission", name=f"motor of {joint}")
        ET.SubElement(motor, "type").text = "transmission_interface/SimpleTransmission"
        ET.SubElement(motor, "joint", name=joint)
        actuator = ET.SubElement(motor, "actuator", name=f"motor of {joint}")
    root.set("xmlns:drake", root.get("xmlns:drake", "http://drake.mit.edu"))
    child(actuator, f"{DRAKE}rotor_inertia").set("value", repr(inertia))
