"""Deviations of the links from the robot's file, for a controller's model or a simulated robot."""

import xml.etree.ElementTree as ET
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated
from weakref import WeakKeyDictionary, WeakValueDictionary

import numpy as np
from pydantic import Field

from sdt_drake.io.errors import InputError, within
from sdt_drake.io.fields import FileOf, Input, NonEmpty, Number, Positive, Problems, Values, field
from sdt_drake.io.numbers import read_numbers
from sdt_drake.io.resources import find_file
from sdt_drake.robot import sdf
from sdt_drake.robot.parsed import parts_of
from sdt_drake.robot.robot import Robot, edited
from sdt_drake.robot.xml_files import parse_xml

_PAYLOAD = "payload"  # default name; such a link is needed only if the payload changes


@dataclass(frozen=True)
class Deviation(Input):
    """Deviations of the links from the robot's file.

    They concern masses and inertias of the links, joint side. Rotors, gears, limits, damping and
    kinematics do not change.
    """

    payload: str = _PAYLOAD
    """Name of the link that payload_mass and payload_offset change. A given name must exist in the
    file."""
    payload_mass: Number = field(0.0, unit="kg")
    """Mass added to the link. Its inertia scales with its mass."""
    payload_offset: Values[Number] = field((0.0, 0.0, 0.0), min_length=3, max_length=3, unit="m")
    """Shift of the link's centre of mass, in the frame of the link."""
    inertia_scale: Positive = field(1.0, unit="-")
    """Factor on masses and inertias of all links, applied after the payload's change. The links'
    mass matrix, velocity torques and gravity torques scale with it, the rotors' inertia does
    not."""
    link_scales: NonEmpty[Positive] | None = field(None, unit="-")
    """Further factor on mass and inertia of each link, in the order of the file."""
    spread: Annotated[str, FileOf("directions")] = ""
    """File of the directions in which the links are uncertain, written by `identify`. None by
    default."""
    along: NonEmpty[Annotated[Number, Field(ge=-10, le=10)]] | None = field(None, unit="-")
    """Change along each of these directions, in standard deviations, applied first."""

    def problems(self) -> Problems:
        if self.along and not self.spread:
            yield "along", "needs spread, the file of the directions"

    @property
    def exact(self) -> bool:
        """True if nothing deviates."""
        scales = [self.inertia_scale, *(self.link_scales or ())]
        changed = self._changes_payload or any(self.along or ())
        return not changed and all(scale == 1 for scale in scales)

    @property
    def _changes_payload(self) -> bool:
        """True if the link `payload` changes."""
        return self.payload_mass != 0 or any(x != 0 for x in self.payload_offset)


_made: WeakKeyDictionary[Robot, WeakValueDictionary[Deviation, Robot]] = WeakKeyDictionary()


def deviated(robot: Robot, deviation: Deviation, where: str = "deviation") -> Robot:
    """Return a robot with deviations of its links; `robot` itself if nothing deviates.

    Deviations add up: they start from `robot` as given. Equal calls return the same object while it
    is in use.

    >>> from sdt_drake.robot.robot import load_robot
    >>> heavier = deviated(load_robot(), Deviation(payload_mass=20))
    >>> heavier.plant.GetBodyByName("payload").default_mass()
    200.0

    Args:
        robot: the robot, which does not change.
        deviation: the deviations.
        where: prefix of the places in messages.

    Raises:
        InputError: no such link, or a body that is physically impossible.
    """
    if deviation.payload != _PAYLOAD:  # check a given name even if nothing changes
        with within(place=where):
            sdf.link_named(parse_xml(robot.sdf, robot.path), deviation.payload, "payload")
    if deviation.exact:
        return robot
    known = _made.setdefault(robot, WeakValueDictionary())
    made = known.get(deviation)
    if made is None:
        with within(place=where):
            made = edited(robot, lambda root: _apply(deviation, robot, root))
        known[deviation] = made
    return made


def _apply(deviation: Deviation, robot: Robot, root: ET.Element) -> None:
    """Apply the deviations to the robot's SDF, in place."""
    if deviation.along:
        _spread(robot, root, find_file(deviation.spread), deviation.along)
    if deviation._changes_payload:
        payload = sdf.link_named(root, deviation.payload, "payload")
        _add_mass(payload, deviation.payload_mass)
        sdf.shift_link(payload, deviation.payload_offset)
    links = sdf.links_by_name(root)
    scales = deviation.link_scales or (1.0,) * len(links)
    if len(scales) != len(links):
        each = f"{len(links)}, one for each of {', '.join(links)}"
        raise InputError(f"{len(scales)} value(s), expected {each}", place="link_scales")
    for link, own in zip(links.values(), scales, strict=True):
        sdf.scale_link(link, deviation.inertia_scale * own)


def _spread(robot: Robot, root: ET.Element, file: Path, along: Sequence[float]) -> None:
    """Move the links along directions of a file: ten numbers for each link, in file order."""
    directions = read_numbers(file, min_rows=1).data[:, 1:]
    links = sdf.links_by_name(root)
    if directions.shape[1] != 10 * len(links) or not np.all(np.isfinite(directions)):
        raise InputError(
            f"{file}: {directions.shape[1]} columns beside the first, expected {10 * len(links)} "
            "finite ones, ten for each link of the robot"
        )
    if len(along) != len(directions):
        raise InputError(
            f"{len(along)} value(s), expected {len(directions)}, one for each row of {file}",
            place="along",
        )
    changes = (np.array(along) @ directions).reshape(-1, 10)
    for (name, link), change in zip(links.items(), changes, strict=True):
        if np.any(change != 0):
            pseudo = sdf.pseudo_inertia(*parts_of(robot.plant.GetBodyByName(name)))
            sdf.set_inertia(link, *sdf.body_of(sdf.stretched(pseudo, change)))


def _add_mass(link: ET.Element, added: float) -> None:
    """Add mass [kg] to a link, and scale its inertia with it."""
    mass, name = float(link.findtext("inertial/mass", "nan")), link.get("name")
    if mass == 0:
        raise InputError(
            f"link '{name}' has no mass to scale, expected another link", place="payload_mass"
        )
    if mass + added <= 0:
        raise InputError(
            f"{added:g} kg would leave {mass + added:g} kg of link '{name}', "
            f"expected more than {-mass:g}",
            place="payload_mass",
        )
    sdf.scale_link(link, (mass + added) / mass)
