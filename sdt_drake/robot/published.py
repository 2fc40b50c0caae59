"""Contents of published URDFs beside a robot: left out and told, or refused."""

import difflib
import shlex
import xml.etree.ElementTree as ET
from collections import defaultdict
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path

from sdt_drake.io.errors import InputError, Problem, gathering, meant, raise_all
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
    "joint/mimic": {"joint", "multiplier", "offset"},
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
# Elements without data on bodies and motors.
_IGNORED = {"gazebo", "material", "calibration", "safety_controller", "self_collision_checking"}
_IGNORED |= {"hardwareInterface", "offset", "robotNamespace", "ros2_control"}
_IGNORED |= {"ignoreTransmissionAbsoluteEncoder"}
_NO_PART_OF_FIXED = {"axis", "limit", "dynamics", "mimic"}  # of a joint that does not move
# Forces, closed loops and rotations, which a robot without them would lack.
_LOOP, _FORCE = "loop_joint", "drake:"
_ROTATIONS = {"quat", "quat_xyzw", "quat_wxyz"}
_NEAR = 0.8  # similarity of a misspelled name


def cleaned(robot: ET.Element, file: Path) -> list[str]:
    """Leave out of a URDF what has no meaning in it or is repeated, in place.

    Returns:
        One sentence for what was left out of the same parts.

    Raises:
        InputError: a problem for each element or attribute that is repeated, misspelled, or has an
            effect that is not supported; xacro that is not expanded.
    """
    refuse_xacro(robot, file)
    if robot.tag != "robot":
        raise InputError(f"{file}: <{robot.tag[:40]}> is not <robot>")
    for joint in robot.findall("joint"):
        if joint.get("type") == "fixed":
            _remove(joint, [part for part in joint if part.tag in _NO_PART_OF_FIXED])
    sentences = [
        f"transmission '{transmission.get('name')}': <offset> {text} is ignored: the zero position "
        "of a motor has no effect"
        for transmission in robot.iter("transmission")
        for text in (offset.text or "" for offset in transmission.iter("offset"))
        if text.strip().strip("0.")
    ]
    sentences += _positive_reductions(robot)
    left: dict[str, list[str]] = defaultdict(list)
    problems: list[Problem] = []
    _clean(robot, "/robot", f"{file}", "the robot", left, problems)
    for joint in robot.findall("joint"):
        limits = [x for x in joint.findall("limit") if {"lower", "upper"} <= x.attrib.keys()]
        for limit in limits if joint.get("type") == "continuous" else ():
            for name in ("lower", "upper"):
                del limit.attrib[name]
                left[f"{name} of <limit>"].append(f"joint '{joint.get('name')}'")
    _remove_spare_transmissions(robot, left)
    raise_all(problems)
    return [*_told(left), *sentences, *make_distinct(robot)]


def _positive_reductions(robot: ET.Element) -> list[str]:
    """Remove signs of reductions of motors of one joint, in place; return one sentence each."""
    sentences = []
    for transmission in robot.findall("transmission"):
        for reduction in transmission.iter("mechanicalReduction"):
            text = (reduction.text or "").strip()
            if text.startswith("-") and len(transmission.findall("joint")) == 1:
                reduction.text = text.removeprefix("-")
                sentences.append(
                    f"transmission '{transmission.get('name')}': the sign of <mechanicalReduction> "
                    f"{text[:40]} is ignored: motors turn with their joints here"
                )
    return sentences


def refuse_xacro(root: ET.Element, file: Path) -> None:
    """Raise InputError, with the command that expands it, if a robot's XML is xacro."""
    suffix = file.suffix.lower()
    if suffix == ".xacro" or any(element.tag.startswith("xacro:") for element in root.iter()):
        other = file.with_suffix("") if suffix == ".xacro" else file.with_suffix(".expanded")
        other = other if other.suffix.lower() == ".urdf" else Path(f"{other}.urdf")
        command = f"xacro {shlex.quote(str(file))} > {shlex.quote(str(other))}"
        raise InputError(f"{file}: is xacro, which has to be expanded first: {command}")


def _clean(
    element: ET.Element, key: str, where: str, part: str, left: dict[str, list[str]],
    problems: list[Problem],
) -> None:  # fmt: skip
    """Clean an element: `key` of _READ, the place for messages, and the part for sentences."""
    for name in [x for x in element.attrib if x not in _READ[key] and not x.startswith("xmlns")]:
        with gathering(problems):
            _check_left_out(name, name in _ROTATIONS, f" of <{element.tag}>", where,
                            _READ[key] - element.attrib.keys())  # fmt: skip
            del element.attrib[name]
            left[f"{name[:40]} of <{element.tag}>"].append(part)
    _remove(element, [child for child in element if child.tag in _IGNORED])
    inner = "joint of a transmission" if key == "transmission/joint" else element.tag
    known = {tag for above, _, tag in (x.partition("/") for x in _READ) if above == inner}
    present = {child.tag for child in element}
    for child in [child for child in element if child.tag not in known]:
        has_effect = child.tag == _LOOP or (inner == "robot" and child.tag.startswith(_FORCE))
        with gathering(problems):
            tag = f"<{child.tag[:40]}>"
            _check_left_out(tag, has_effect, f" in <{element.tag}>", where, known - present)
            element.remove(child)
            left[f"{tag} in <{element.tag}>"].append(part)
    with gathering(problems):
        _remove_repeated(element, where, part, left)
    for child in (child for child in element if child.tag in known):
        within, inside = where, part
        if "name" in child.attrib:
            inside = f"{child.tag} '{child.attrib['name'][:40]}'"
            within = f"{where}: {inside}"
        _clean(child, f"{inner}/{child.tag}", within, inside, left, problems)


def _check_left_out(
    name: str, has_effect: bool, of: str, where: str, missing: Collection[str]
) -> None:
    """Refuse an unknown name with an effect, or one that a missing name was meant by."""
    bare = name.strip("<>")
    near = difflib.get_close_matches(bare, missing, n=1, cutoff=_NEAR)
    near = near or [other for other in missing if sorted(other) == sorted(bare)]
    if near or has_effect:
        advice = meant(near) if near else "remove it"
        raise InputError(f"{where}: {name[:42]}{of} is not supported; {advice}")


def _remove_repeated(
    element: ET.Element, where: str, part: str, left: dict[str, list[str]]
) -> None:
    """Remove children without content that are given twice, and copies of others."""
    first: dict[tuple[str, str | None], ET.Element] = {}
    for child in list(element):
        named = child.tag, child.get("name") or child.get("joint")
        if named not in first:
            first[named] = child
            continue
        one, empty = first[named], [x for x in (child, first[named]) if not (x.attrib or len(x))]
        copy = [child] * (ET.tostring(one).strip() == ET.tostring(child).strip())
        if not (empty or copy):
            raise InputError(f"{where}: <{child.tag[:40]}> more than once in <{element.tag}>")
        if empty[:1] == [one]:
            first[named] = child
        element.remove((empty or copy)[0])
        left[f"a second <{child.tag[:40]}> in <{element.tag}>"].append(part)


def _remove_spare_transmissions(robot: ET.Element, left: dict[str, list[str]]) -> None:
    """Remove transmissions of joints that are not there if all moving joints have their own."""
    joints = {joint.get("name", ""): joint.get("type") for joint in robot.findall("joint")}
    moving = {name for name, kind in joints.items() if kind != "fixed"}
    driven = [
        [j.get("name", "") for j in one.findall("joint")] for one in robot.findall("transmission")
    ]
    if moving <= {name for names in driven for name in names}:
        for one, names in zip(robot.findall("transmission"), driven, strict=True):
            if not joints.keys() & names:
                robot.remove(one)
                left[f"<transmission> of {listed(names)}, which is not there,"].append("the robot")


def _remove(element: ET.Element, children: Sequence[ET.Element]) -> None:
    for child in children:
        element.remove(child)


def _told(left: Mapping[str, Sequence[str]]) -> list[str]:
    """Return sentences: "joint 'a': D of <dynamics> has no meaning in URDF and was ignored"."""
    together: dict[tuple[str, ...], list[str]] = defaultdict(list)
    for what, parts in left.items():
        together[tuple(dict.fromkeys(parts))].append(what)
    sentences = []
    for parts, whats in together.items():
        has, was = ("has", "was") if len(whats) == 1 else ("have", "were")
        text = f"{listed(whats)} {has} no meaning in URDF and {was} ignored"
        sentences.append(f"{few(parts)}: {text}")
    return sentences


def few(names: Sequence[str], most: int = 4) -> str:
    """List names in words, of many the first ones and the number of the others.

    >>> few(["a", "b", "c", "d", "e", "f"])
    'a, b, c and 3 others'
    """
    if len(names) <= most:
        return listed(names)
    return listed([*names[: most - 1], f"{len(names) - most + 1} others"])


def distinct(link: str, joints: Collection[str]) -> str:
    """Return the name of a link that no joint has."""
    return f"{link} (link)" if link in joints else link


def make_distinct(robot: ET.Element) -> list[str]:
    """Rename links that have the name of a joint, which SDF does not allow, in place."""
    joints = {joint.get("name", "") for joint in robot.findall("joint")}
    links = {link.get("name", "") for link in robot.findall("link")}
    renamed = {name: distinct(name, joints) for name in sorted(joints & links)}
    for element in robot.iter():
        for attribute in ("name", "link"):
            name = element.get(attribute, "")
            is_link = attribute == "link" or element.tag == "link"
            if is_link and name in renamed:
                element.set(attribute, renamed[name])
    return [
        f"link '{old}' has the name of a joint and is called '{new}' here"
        for old, new in renamed.items()
    ]
