"""Conversion of URDF to SDF, so that robots are checked and edited in one format."""

import xml.etree.ElementTree as ET
from collections import Counter
from pathlib import Path

from sdt_drake.io.errors import InputError, suggestion
from sdt_drake.io.shown import listed
from sdt_drake.robot.coupling import TURNS_WITH

# Attributes of the accepted elements, by parent and element.
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
    "joint of a transmission/role": set(),
    "joint of a transmission/mechanicalReduction": set(),
    "actuator/role": set(),
    "actuator/drake:rotor_inertia": {"value"},
    "actuator/drake:gear_ratio": {"value"},
    f"actuator/{TURNS_WITH}": {"joint", "value"},
    "actuator/mechanicalReduction": set(),
    "transmission/mechanicalReduction": set(),
}
_TYPES = {"revolute": "revolute", "continuous": "revolute", "fixed": "fixed"}
# Elements without data on bodies and motors.
_IGNORED = {"gazebo", "material", "calibration", "safety_controller", "self_collision_checking"}
_IGNORED |= {"hardwareInterface", "offset", "robotNamespace", "ros2_control"}
_IGNORED |= {"ignoreTransmissionAbsoluteEncoder"}
_IGNORED_DYNAMICS = ("D", "K", "mu_coulomb", "mu_viscous")  # have no meaning in URDF


def sdf_of_urdf(robot: ET.Element, file: Path) -> tuple[ET.Element, list[str]]:
    """Convert a URDF to SDF, with its root link fixed to the world.

    A joint without a transmission also gets a motor, with the effort of its <limit>. The inertia of
    the root has no effect and is ignored. A link without <inertial> has no mass; links of revolute
    joints must have an <inertial>.

    Args:
        robot: the <robot> element, from which ignored elements are removed.
        file: the file, for messages.

    Returns:
        The <sdf> element, and one sentence for each ignored number.

    Raises:
        InputError: an unknown, repeated or missing element.
    """
    ignored = _remove_meaningless(robot) + [
        f"transmission '{transmission.get('name')}': <offset> {text} is ignored: the zero position "
        "of a motor has no effect"
        for transmission in robot.iter("transmission")
        for text in (offset.text or "" for offset in transmission.iter("offset"))
        if text.strip().strip("0.")
    ]
    _check("", robot, str(file))
    sdf = ET.Element("sdf", version="1.9")
    model = ET.SubElement(sdf, "model", name=robot.get("name", ""))
    motors = _motors(robot, file)
    inboard = {_end(joint, "child"): joint for joint in robot.findall("joint")}
    links = robot.findall("link")
    names = [link.get("name", "") for link in links]
    if "world" not in names and any(_end(j, "parent") == "world" for j in inboard.values()):
        names.append("world")  # need not be declared
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
    return sdf, ignored


def _remove_meaningless(robot: ET.Element) -> list[str]:
    """Remove numbers of published files that have no meaning in URDF, one sentence each."""
    sentences = []
    for joint in robot.findall("joint"):
        left = [
            (e, name)
            for e in joint.findall("dynamics")
            for name in _IGNORED_DYNAMICS
            if name in e.attrib
        ]
        for limit in joint.findall("limit"):
            if joint.get("type") == "continuous" and {"lower", "upper"} <= limit.attrib.keys():
                left += [(limit, "lower"), (limit, "upper")]
        for element, name in left:
            del element.attrib[name]
        if left:
            names = listed([f"{name} of <{element.tag}>" for element, name in left])
            sentences.append(
                f"joint '{joint.get('name')}': {names} have no meaning in URDF and were ignored"
            )
    return sentences


def _check(parent: str, element: ET.Element, where: str) -> None:
    """Check that each element and attribute is known, and no element is repeated."""
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
    names = [(child.tag, child.get("name") or child.get("joint")) for child in element]
    counts = Counter(names)
    inner = "joint of a transmission" if key == "transmission/joint" else element.tag
    for child, named in zip(element, names, strict=True):
        if counts[named] > 1:
            raise InputError(f"{where}: <{child.tag[:40]}> more than once in <{element.tag}>")
        _check(inner, child, where)


def _motors(robot: ET.Element, file: Path) -> dict[str, list[ET.Element]]:
    """Return rotor inertia, gear ratio and coupling as elements of SDF, by joint."""
    motors: dict[str, list[ET.Element]] = {}
    for transmission in robot.findall("transmission"):
        where = f"{file}: transmission '{transmission.get('name')}'"
        kind = (transmission.get("type") or transmission.findtext("type") or "").strip()
        size = next((n for name, n in _TRANSMISSIONS.items() if kind.endswith(name)), 0)
        if not size:
            raise InputError(f"{where}: type '{kind[:40]}', expected {' or '.join(_TRANSMISSIONS)}")
        joints, actuators = transmission.findall("joint"), transmission.findall("actuator")
        names = [joint.get("name", "") for joint in joints]
        if not len(joints) == len(actuators) == size or any(name in motors for name in names):
            each = "one joint, one actuator, and no other on the joint"
            raise InputError(f"{where}: expected {each if size == 1 else each.replace('one', '2')}")
        for name, actuator in zip(names, actuators, strict=True):
            own = [e for e in actuator if e.tag.startswith(("drake:", "sdt:"))]
            motors[name] = [_leaf(e.tag, e.get("value"), e.get("joint")) for e in own]
        if size == 1:
            for reduction in transmission.iter("mechanicalReduction"):
                text = (reduction.text or "").strip()
                if text not in ("1", "1.0"):  # otherwise <drake:gear_ratio> counts, if any
                    motors[names[0]].append(_leaf("drake:gear_ratio", text))
        else:
            ratios = [_reduction(part, where) for part in (*joints, *actuators)]
            # The motors turn n_1 (r_1 v_1 + r_2 v_2) and n_2 (r_1 v_1 - r_2 v_2) in ROS. The sign
            # of a motor that turns against its joint is reversed.
            r_1, r_2, n_1, n_2 = ratios
            for k, (turns, other) in enumerate(((n_1 * r_1, n_1 * r_2), (-n_2 * r_2, n_2 * r_1))):
                other = other if turns > 0 else -other
                motors[names[k]].append(_leaf("drake:gear_ratio", repr(abs(turns))))
                motors[names[k]].append(_leaf(TURNS_WITH, repr(other), names[1 - k]))
    return motors


_TRANSMISSIONS = {"SimpleTransmission": 1, "DifferentialTransmission": 2}  # number of joints


def _reduction(part: ET.Element, where: str) -> float:
    """Read the reduction of a joint or actuator of a differential, 1 by default."""
    text = part.findtext("mechanicalReduction", "1").strip()
    try:
        ratio = float(text)
    except ValueError:
        ratio = 0.0
    if not 0 < abs(ratio) < 1e9:
        raise InputError(
            f"{where}: <mechanicalReduction> is '{text[:40]}', expected a number other than 0"
        )
    return ratio


def _add_link(model: ET.Element, old: ET.Element, joint: ET.Element | None, where: str) -> None:
    link = ET.SubElement(model, "link", name=old.get("name", ""))
    if joint is not None:
        ET.SubElement(link, "pose", relative_to=joint.get("name", ""))
    new = ET.SubElement(link, "inertial")
    inertial = old.find("inertial") if joint is not None else None  # the root does not move
    if inertial is None:
        if joint is not None and joint.get("type") != "fixed":
            raise InputError(f"{where}: no <inertial>; add its mass and inertia, 0 if it has none")
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
    """Return the link in <parent> or <child> of a joint; "" if there is none."""
    element = joint.find(which)
    return "" if element is None else element.get("link", "")


def _pose(origin: ET.Element | None, where: str) -> ET.Element:
    """Convert an element with xyz and rpy, such as <origin>, to a <pose>."""
    given = {} if origin is None else origin.attrib
    parts = [given.get(name, "0 0 0") for name in ("xyz", "rpy")]
    for part in parts:
        if len(part.split()) != 3:
            raise InputError(f"{where}: xyz or rpy is '{part[:40]}', expected 3 numbers")
    return _leaf("pose", " ".join(parts))


def _leaf(tag: str, text: str | None, joint: str | None = None) -> ET.Element:
    leaf = ET.Element(tag, {} if joint is None else {"joint": joint})
    leaf.text = text
    return leaf
