"""Joints that are held: their links are welded where they are told to stand."""

import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
from pydrake.common.eigen_geometry import AngleAxis
from pydrake.math import RollPitchYaw, RotationMatrix

from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError, suggestion
from sdt_drake.robot.coupling import TURNS_WITH
from sdt_drake.robot.published import few

TURNING = ("revolute", "continuous")
"""Types of joints that motors drive here."""
_ONE_AXIS = (*TURNING, "prismatic")


def hold_joints(
    root: ET.Element, hold: str | Sequence[str], tip: str, file: Path
) -> dict[str, float]:
    """Weld the joints that are held, in a URDF or SDF, in place.

    A joint stands at 0, or at the nearest of its limits, unless a position is given. What follows a
    held joint by <mimic> is held with it.

    Args:
        root: the <robot> or <sdf> element.
        hold: names of joints, each with its position [rad, m] if any: "finger=0.02", "wrist". A
            text may have several, with commas between them.
        tip: the link that ends the chain; all joints beside and beyond it are held. "" for none.
        file: the file, for messages.

    Returns:
        The positions of all held joints by their names [rad, m].

    Raises:
        InputError: an unknown joint or link, a position beyond a limit, or a joint that moves but
            is neither revolute nor continuous, nor held.
    """
    joints = _joints(root)
    told = dict(_told(hold, joints, file))
    moving = {name: joint for name, joint in joints.items() if joint.get("type") != "fixed"}
    beside = set(moving) - _chain(root, joints, tip, file) if tip else set()
    held = {
        name: position for name in moving
        if (position := _position(name, told, beside, moving, file)) is not None
    }  # fmt: skip
    _check_others({name: joint for name, joint in moving.items() if name not in held}, file)
    weld(root, held, file)
    return held


def weld(root: ET.Element, held: Mapping[str, float], file: Path) -> None:
    """Make joints fixed at positions [rad, m] by their names, in place.

    Raises:
        InputError: a position other than 0 in an SDF, or of a joint with several axes.
    """
    joints = _joints(root)
    for name, position in held.items():
        _weld(joints[name], position, f"{file}: joint '{name}'", is_sdf=root.tag == "sdf")
    for element in root.iter():
        for coupled in element.findall(TURNS_WITH):
            if coupled.get("joint") in held:  # stands still, so that no motor turns with it
                element.remove(coupled)


def told_held(held: Mapping[str, float]) -> list[str]:
    """Return a sentence on held joints, if there are any."""
    shown = ", ".join(f"{name}={position:g}" for name, position in held.items())
    return [f"joints held at positions [rad, m]: {shown}"] if shown else []


def _joints(root: ET.Element) -> dict[str, ET.Element]:
    model = root if root.tag == "robot" else next(root.iter("model"), root)
    return {joint.get("name", ""): joint for joint in model.findall("joint")}


def _told(
    hold: str | Sequence[str], joints: Mapping[str, ET.Element], file: Path
) -> Iterator[tuple[str, float | None]]:
    """Yield the names of joints to hold, and their positions if given."""
    texts = [hold] if isinstance(hold, str) else hold
    for text in (part.strip() for whole in texts for part in whole.split(",") if part.strip()):
        name, _, value = text.rpartition("=") if text not in joints else (text, "", "")
        name, value = (name or text).strip(), value if name else ""
        if name not in joints:
            known = suggestion(name, joints, f"expected one of {few([*joints], 12)}")
            raise InputError(f"no joint '{name}' in {file}, {known}", place="hold")
        try:
            position = float(value) if value else None
        except ValueError:
            position = np.nan
        if position is not None and not np.isfinite(position):
            raise InputError(f"'{text}', expected NAME or NAME=POSITION [rad, m]", place="hold")
        yield name, position


def _chain(
    root: ET.Element, joints: Mapping[str, ET.Element], tip: str, file: Path
) -> set[str]:  # fmt: skip
    """Return the names of the joints between the base and a link."""
    links = [link.get("name", "") for link in root.iter("link")]
    if tip not in links:
        known = suggestion(tip, links, f"expected one of {few(links, 12)}")
        raise InputError(f"no link '{tip}' in {file}, {known}", place="tip")
    inboard = {_end(joint, "child"): name for name, joint in joints.items()}
    chain, link = set[str](), tip
    while (name := inboard.get(link, "")) and name not in chain:
        chain.add(name)
        link = _end(joints[name], "parent")
    return chain


def _end(joint: ET.Element, which: str) -> str:
    """Return the link at an end of a joint, of a URDF or SDF; "" if there is none."""
    element = joint.find(which)
    return "" if element is None else element.get("link") or (element.text or "").strip()


def _position(
    name: str, told: Mapping[str, float | None], beside: set[str],
    joints: Mapping[str, ET.Element], file: Path, above: tuple[str, ...] = (),
) -> float | None:  # fmt: skip
    """Return where a joint is held [rad, m]; None if it is not."""
    joint, mimic = joints[name], _mimic(joints[name])
    low, high = (_number(joint.find("limit"), key, way * np.inf)
                 for key, way in (("lower", -1), ("upper", 1)))  # fmt: skip
    position = told.get(name)
    if position is not None:
        if not low <= position <= high:
            text = f"{name}={position:g}, expected {low:g} to {high:g}, its limits in {file}"
            raise InputError(text, place="hold")
        return position
    leader = "" if mimic is None else mimic.get("joint", "")
    if leader in joints and leader not in above:
        position = _position(leader, told, beside, joints, file, (*above, name))
        if position is not None:
            return _number(mimic, "multiplier", 1.0) * position + _number(mimic, "offset", 0.0)
    return float(np.clip(0.0, low, high)) if name in told or name in beside else None


def _number(element: ET.Element | None, name: str, otherwise: float) -> float:
    try:
        return (
            otherwise
            if element is None
            else float(element.get(name) or element.findtext(name) or otherwise)
        )
    except ValueError:  # is refused where limits are read
        return otherwise


def _mimic(joint: ET.Element) -> ET.Element | None:
    """Return the element by which a joint of a URDF or SDF follows another one."""
    own = joint.find("mimic")
    return joint.find("axis/mimic") if own is None else own


def _check_others(moving: Mapping[str, ET.Element], file: Path) -> None:
    """Refuse joints that no motor can drive here, all at once, with the option that holds them."""
    wrong = {}
    for name, joint in moving.items():
        kind, mimic = joint.get("type", ""), _mimic(joint)
        if mimic is not None:
            wrong[name] = f"follows '{mimic.get('joint')}' by <mimic>"
        elif kind not in TURNING:
            wrong[name] = f"is {kind[:40]}"
    if wrong:
        names = few([f"joint '{name}' {why}" for name, why in wrong.items()])
        raise InputError(
            f"{file}: {names}, expected revolute or continuous joints; hold what does not belong "
            f"to the chain, with its links as load: hold='{','.join(wrong)}', or make it fixed"
        )


def _weld(joint: ET.Element, position: float, where: str, *, is_sdf: bool) -> None:
    """Make a joint fixed at a position [rad, m]."""
    kind, axis, origin = joint.get("type", ""), joint.find("axis"), joint.find("origin")
    if position and (is_sdf or kind not in _ONE_AXIS):
        what = "an SDF" if is_sdf else f"a {kind} joint"
        raise InputError(f"{where}: held at {position:g}, expected 0 in {what}", place="hold")
    joint.set("type", "fixed")
    if position:
        if origin is None:
            origin = ET.SubElement(joint, "origin")
        along = _numbers(axis, "xyz", "1 0 0", where)
        along /= np.linalg.norm(along) or 1.0
        turned = RotationMatrix(RollPitchYaw(_numbers(origin, "rpy", "0 0 0", where)))
        if kind == "prismatic":
            moved = _numbers(origin, "xyz", "0 0 0", where) + turned @ (position * along)
            origin.set("xyz", " ".join(repr(float(x)) for x in moved))
        else:
            turned = turned @ RotationMatrix(AngleAxis(position, along))
            origin.set("rpy", " ".join(repr(float(x)) for x in RollPitchYaw(turned).vector()))
    for part in [x for x in joint if x.tag in _MOVES or x.tag.startswith(_MOTORS)]:
        joint.remove(part)


_MOVES, _MOTORS = {"axis", "axis2", "limit", "dynamics", "mimic"}, ("drake:", "sdt:")


def _numbers(element: ET.Element | None, name: str, otherwise: str, where: str) -> Array:
    text = otherwise if element is None else element.get(name, otherwise)
    try:
        values = np.array([float(word) for word in text.split()])
    except ValueError:
        values = np.zeros(0)
    if len(values) != 3:
        raise InputError(f"{where}: xyz or rpy is '{text[:40]}', expected 3 numbers")
    return values
