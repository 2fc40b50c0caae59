"""A URDF in the words of an SDF, so that there is one way to read, check and change a robot."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path

from sdt_drake.io.errors import InputError
from sdt_drake.io.fields import suggestion

# Elements that are read, by their parent: their attributes. Numbers stay texts, as in the file.
_READ = {
    "/robot": {"name", "version"},
    "robot/link": {"name"},
    "link/inertial": set(),
    "inertial/origin": {"xyz", "rpy"},
    "inertial/mass": {"value"},
    "inertial/inertia": {"ixx", "iyy", "izz", "ixy", "ixz", "iyz"},
    "robot/joint": {"name", "type"},
    "joint/origin": {"xyz", "rpy"},
    "joint/parent": {"link"},
    "joint/child": {"link"},
    "joint/axis": {"xyz"},
    "joint/limit": {"lower", "upper", "effort", "velocity", "drake:acceleration"},
    "joint/dynamics": {"damping", "friction"},
    "robot/frame": {"name", "link", "xyz", "rpy"},
    "robot/transmission": {"name", "type"},
    "transmission/type": set(),
    "transmission/joint": {"name"},
    "transmission/actuator": {"name"},
    "actuator/drake:rotor_inertia": {"value"},
    "actuator/drake:gear_ratio": {"value"},
    "actuator/mechanicalReduction": set(),
    "transmission/mechanicalReduction": set(),
}
_TYPES = {"revolute": "revolute", "continuous": "revolute", "fixed": "fixed"}
# Elements that say nothing of bodies and motors.
_IGNORED = {"gazebo", "material", "calibration", "safety_controller", "self_collision_checking"}
_IGNORED |= {"hardwareInterface", "role", "robotNamespace"}


def sdf_of_urdf(robot: ET.Element, file: Path) -> ET.Element:
    """The same robot as an SDF, its root link fixed to the world.

    A joint without a transmission has a motor, too, of the effort of its <limit>. The inertia of
    the root does not matter and is not read. Other links without <inertial> have no mass; those of
    joints that turn have to say so.

    Args:
        robot: what a URDF has outermost; elements that say nothing of bodies and motors go.
        file: what errors name.

    Raises:
        InputError: for whatever would not be read or be read twice, and instead of guesses.
    """
    _check("", robot, str(file))
    sdf = ET.Element("sdf", version="1.9")
    model = ET.SubElement(sdf, "model", name=robot.get("name", ""))
    motors = _motors(robot, file)
    inboard = {_end(joint, "child"): joint for joint in robot.findall("joint")}
    links = robot.findall("link")
    names = [link.get("name", "") for link in links]
    if "world" not in names and any(_end(j, "parent") == "world" for j in inboard.values()):
        names.append("world")  # it need not be said
    roots = [name for name in names if name not in inboard]
    if len(roots) != 1:
        raise InputError(f"{file}: {len(roots)} links that no joint carries, expected one")
    for link in links:
        where = f"{file}: link '{link.get('name')}'"
        if link.get("name") != "world":
            _add_link(model, link, inboard.get(link.get("name", "")), where)
        elif len(link):
            raise InputError(f"{where}: <inertial> would have no effect; remove it")
    if roots != ["world"]:
        base = ET.SubElement(model, "joint", name=f"base of {roots[0]}", type="fixed")
        _add_ends(base, "world", roots[0])
    for joint in robot.findall("joint"):
        where = f"{file}: joint '{joint.get('name')}'"
        _add_joint(model, joint, motors.pop(joint.get("name", ""), []), where)
    for name in motors:
        raise InputError(f"{file}: <transmission> of joint '{name[:40]}', which is not there")
    for frame in robot.findall("frame"):
        name = frame.get("name", "")
        new = ET.SubElement(model, "frame", name=name, attached_to=frame.get("link", ""))
        new.append(_pose(frame, f"{file}: frame '{name}'"))
    return sdf


def _check(parent: str, element: ET.Element, where: str) -> None:
    """Everything that is there is read, and read once."""
    key = f"{parent}/{element.tag}"
    if key not in _READ:
        known = [tag for above, _, tag in (x.partition("/") for x in _READ) if above == parent]
        better = suggestion(element.tag, known, "remove it")
        place = f"in <{parent}> is not supported; {better}" if parent else "is not <robot>"
        raise InputError(f"{where}: <{element.tag[:40]}> {place}")
    if parent and "name" in element.attrib:
        where = f"{where}: {element.tag} '{element.attrib['name'][:40]}'"
    for name in element.attrib:
        if name not in _READ[key] and not name.startswith("xmlns"):
            raise InputError(f"{where}: {name[:40]} of <{element.tag}> is not supported; remove it")
    for child in [child for child in element if child.tag in _IGNORED]:
        element.remove(child)
    names = [(child.tag, child.get("name")) for child in element]
    for child, named in zip(element, names, strict=True):
        if names.count(named) > 1:
            raise InputError(f"{where}: <{child.tag[:40]}> more than once in <{element.tag}>")
        _check(element.tag, child, where)


def _motors(robot: ET.Element, file: Path) -> dict[str, list[ET.Element]]:
    """Rotor inertia and gear ratio, as an SDF has them, of each joint with a transmission."""
    motors: dict[str, list[ET.Element]] = {}
    for transmission in robot.findall("transmission"):
        where = f"{file}: transmission '{transmission.get('name')}'"
        kind = transmission.get("type") or transmission.findtext("type") or ""
        if not kind.strip().endswith("SimpleTransmission"):
            raise InputError(f"{where}: type '{kind.strip()[:40]}', expected SimpleTransmission")
        joints, actuators = transmission.findall("joint"), transmission.findall("actuator")
        if (len(joints), len(actuators)) != (1, 1) or joints[0].get("name") in motors:
            raise InputError(
                f"{where}: expected one joint, one actuator, and no other on the joint"
            )
        motor = [_leaf(e.tag, e.get("value")) for e in actuators[0] if e.tag.startswith("drake:")]
        for reduction in transmission.iter("mechanicalReduction"):
            text = (reduction.text or "").strip()
            if text not in ("1", "1.0"):  # else the ratio is that of Drake's element, if any
                motor.append(_leaf("drake:gear_ratio", text))
        motors[joints[0].get("name", "")] = motor
    return motors


def _add_link(model: ET.Element, old: ET.Element, joint: ET.Element | None, where: str) -> None:
    link = ET.SubElement(model, "link", name=old.get("name", ""))
    if joint is not None:
        ET.SubElement(link, "pose", relative_to=joint.get("name", ""))
    new = ET.SubElement(link, "inertial")
    inertial = old.find("inertial") if joint is not None else None  # a root stands still
    if inertial is None:
        if joint is not None and joint.get("type") != "fixed":
            raise InputError(
                f"{where}: no <inertial>; write its mass and inertia, 0 if it has none"
            )
        inertial = _NO_MASS
    new.append(_pose(inertial.find("origin"), where))
    for mass in inertial.findall("mass"):
        new.append(_leaf("mass", mass.get("value")))
    for inertia in inertial.findall("inertia"):
        ET.SubElement(new, "inertia").extend(_leaf(*moment) for moment in inertia.items())


_NO_MASS = ET.fromstring('<a><mass value="0"/><inertia ixx="0" iyy="0" izz="0"/></a>')


def _add_joint(model: ET.Element, old: ET.Element, motor: list[ET.Element], where: str) -> None:
    kind = old.get("type", "")
    if kind not in _TYPES:
        raise InputError(f"{where} is {kind[:40]}, expected {', '.join(_TYPES)}")
    joint = ET.SubElement(model, "joint", name=old.get("name", ""), type=_TYPES[kind])
    parent = _end(old, "parent")
    pose = _pose(old.find("origin"), where)
    pose.set("relative_to", "__model__" if parent == "world" else parent)
    joint.append(pose)
    _add_ends(joint, parent, _end(old, "child"))
    joint.extend(motor)
    if kind == "fixed":
        return
    axis = ET.SubElement(joint, "axis")
    along = old.find("axis")
    axis.append(_leaf("xyz", "1 0 0" if along is None else along.get("xyz")))
    limit = old.find("limit")
    given = {} if limit is None else limit.attrib
    if {"lower", "upper"} & set(given) != ({"lower", "upper"} if kind == "revolute" else set()):
        raise InputError(
            f"{where}: expected <limit> with lower and upper, or type continuous and neither"
        )
    ET.SubElement(axis, "limit").extend(_leaf(*limit) for limit in given.items())
    for dynamics in old.findall("dynamics"):
        ET.SubElement(axis, "dynamics").extend(_leaf(*number) for number in dynamics.items())


def _add_ends(joint: ET.Element, parent: str, child: str) -> None:
    joint.extend([_leaf("parent", parent), _leaf("child", child)])


def _end(joint: ET.Element, which: str) -> str:
    """Name of the link "parent" or "child" of a joint; empty if there is none."""
    element = joint.find(which)
    return "" if element is None else element.get("link", "")


def _pose(origin: ET.Element | None, where: str) -> ET.Element:
    """An <origin>, or what else has xyz and rpy."""
    given = {} if origin is None else origin.attrib
    parts = [given.get(name, "0 0 0") for name in ("xyz", "rpy")]
    for part in parts:
        if len(part.split()) != 3:
            raise InputError(f"{where}: xyz or rpy is '{part[:40]}', expected 3 numbers")
    return _leaf("pose", " ".join(parts))


def _leaf(tag: str, text: str | None) -> ET.Element:
    leaf = ET.Element(tag)
    leaf.text = text
    return leaf
