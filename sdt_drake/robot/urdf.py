"""Conversion of URDF to SDF, so that robots are checked and edited in one format."""

import xml.etree.ElementTree as ET
from pathlib import Path

from sdt_drake.io.errors import InputError, Problem, gathering, raise_all
from sdt_drake.io.shown import listed
from sdt_drake.robot.coupling import TURNS_WITH

_TYPES = {"revolute": "revolute", "continuous": "revolute", "fixed": "fixed"}


def sdf_of_urdf(robot: ET.Element, file: Path) -> tuple[ET.Element, list[str]]:
    """Convert a cleaned URDF to SDF, with its root link fixed to the world.

    A joint without a transmission also gets a motor, with the effort of its <limit>. The inertia of
    the root has no effect and is ignored. A link without <inertial> has no mass.

    Args:
        robot: the <robot> element, whose moving joints are revolute or continuous.
        file: the file, for messages.

    Returns:
        The <sdf> element, and the names of the links without <inertial>.

    Raises:
        InputError: one problem for each missing or wrong element.
    """
    problems: list[Problem] = []
    sdf = ET.Element("sdf", version="1.9")
    model = ET.SubElement(sdf, "model", name=robot.get("name") or file.stem)
    motors = _motors(robot, file, problems)
    inboard = {_end(joint, "child"): joint for joint in robot.findall("joint")}
    links = robot.findall("link")
    names = [link.get("name", "") for link in links]
    if "world" not in names and any(_end(j, "parent") == "world" for j in inboard.values()):
        names.append("world")  # need not be declared
    roots = [name for name in names if name not in inboard]
    if len(roots) != 1:
        problems.append(Problem(f"{file}: {len(roots)} links that no joint carries, expected one"))
    without = []
    for link in links:
        where, name = f"{file}: link '{link.get('name')}'", link.get("name", "")
        with gathering(problems):
            if name != "world":
                _add_link(model, link, inboard.get(name), where)
                without += [name] * (link.find("inertial/*") is None and name in inboard)
            elif len(link):
                raise InputError(f"{where}: <inertial> would have no effect; remove it")
    for joint in robot.findall("joint"):
        where = f"{file}: joint '{joint.get('name')}'"
        problems += [
            Problem(f"{where}: {which} link '{end[:40]}' is not there")
            for which in ("parent", "child")
            if (end := _end(joint, which)) not in names
        ]
        with gathering(problems):
            _add_joint(model, joint, motors.pop(joint.get("name", ""), []), where)
    problems += [
        Problem(f"{file}: <transmission> of joint '{name[:40]}', which is not there")
        for name in motors
    ]
    raise_all(problems)
    if roots != ["world"]:
        base = ET.SubElement(model, "joint", name=f"base of {roots[0]}", type="fixed")
        _add_ends(base, "world", roots[0])
    for frame in robot.findall("frame"):
        name = frame.get("name", "")
        new = ET.SubElement(model, "frame", name=name, attached_to=frame.get("link", ""))
        new.append(_pose(frame, f"{file}: frame '{name}'"))
    return sdf, without


def _motors(robot: ET.Element, file: Path, problems: list[Problem]) -> dict[str, list[ET.Element]]:
    """Return rotor inertia, gear ratio and coupling as elements of SDF, by moving joint."""
    motors: dict[str, list[ET.Element]] = {}
    still = {joint.get("name") for joint in robot.findall("joint") if joint.get("type") == "fixed"}
    for transmission in robot.findall("transmission"):
        names = {joint.get("name", "") for joint in transmission.findall("joint")}
        if names <= still:
            continue
        where = f"{file}: transmission '{transmission.get('name')}'"
        with gathering(problems):
            if names & motors.keys():
                raise InputError(f"{where}: expected no other on {listed(sorted(names))}")
            motors |= _driven(transmission, where)
    return {
        name: [part for part in parts if part.tag != TURNS_WITH or part.get("joint") not in still]
        for name, parts in motors.items()
        if name not in still
    }


def _driven(transmission: ET.Element, where: str) -> dict[str, list[ET.Element]]:
    """Return the elements of SDF for the motors of a transmission, by joint."""
    kind = (transmission.get("type") or transmission.findtext("type") or "").strip()
    size = next((n for name, n in _TRANSMISSIONS.items() if kind.endswith(name)), 0)
    if not size:
        raise InputError(f"{where}: type '{kind[:40]}', expected {' or '.join(_TRANSMISSIONS)}")
    joints, actuators = transmission.findall("joint"), transmission.findall("actuator")
    names = [joint.get("name", "") for joint in joints]
    if not len(joints) == len(actuators) == size:
        count = "one" if size == 1 else "2"
        raise InputError(f"{where}: expected {count} joint, {count} actuator")
    motors = {
        name: [
            _leaf(own.tag, own.get("value"), own.get("joint"))
            for own in actuator
            if own.tag.startswith(("drake:", "sdt:"))
        ]
        for name, actuator in zip(names, actuators, strict=True)
    }
    if size == 1:
        for reduction in transmission.iter("mechanicalReduction"):
            text = (reduction.text or "").strip()
            if text not in ("1", "1.0"):  # otherwise <drake:gear_ratio> counts, if any
                motors[names[0]].append(_leaf("drake:gear_ratio", text))
        return motors
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
    inertial = inertial if inertial is not None and len(inertial) else _NO_MASS
    new.append(_pose(inertial.find("origin"), where))
    for mass in inertial.findall("mass"):
        new.append(_leaf("mass", mass.get("value")))
    for inertia in inertial.findall("inertia"):
        ET.SubElement(new, "inertia").extend(_leaf(*moment) for moment in inertia.items())


_NO_MASS = ET.fromstring('<a><mass value="0"/><inertia ixx="0" iyy="0" izz="0"/></a>')


def _add_joint(model: ET.Element, old: ET.Element, motor: list[ET.Element], where: str) -> None:
    kind = old.get("type", "")
    joint = ET.SubElement(model, "joint", name=old.get("name", ""), type=_TYPES[kind])
    parent = _end(old, "parent")
    pose = _pose(old.find("origin"), where)
    pose.set("relative_to", "__model__" if parent == "world" else parent)
    joint.append(pose)
    _add_ends(joint, parent, _end(old, "child"))
    if kind == "fixed":
        return
    joint.extend(motor)
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
