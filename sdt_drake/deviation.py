"""A robot whose links differ from its file: a controller's model of it, or what it really is."""

# Real annotations, for the check of the fields (sdt_drake.fields): they may not be postponed.
import xml.etree.ElementTree as ET
from dataclasses import dataclass
from typing import Optional

from sdt_drake.errors import InputError, within
from sdt_drake.fields import setting
from sdt_drake.links import link_named, links_by_name, scale_link, shift_link
from sdt_drake.robot import Robot, edited


@dataclass(slots=True)
class Deviation:
    """What differs from the links of the robot's file.

    Masses and inertias here are those of the links, joint side. Rotors, gears, limits, damping and
    kinematics are known exactly.

    Attributes:
        payload: name of the link that payload_mass and payload_offset change.
        payload_mass: added to the link's mass; its inertia scales with the mass (the same body,
            evenly heavier).
        payload_offset: added to the position of the link's centre of mass, in the frame in which
            <inertial> is written: that of the link.
        inertia_scale: factor on masses and inertias of all links, applied after the payload's
            change. So the links' part of the mass matrix, the velocity torques and the gravity
            torques all scale with it; what the rotors add to the mass matrix does not.
        link_scales: the same factor for each link on its own, in the order of the file.
    """

    payload: str = "payload"
    payload_mass: float = setting(0.0, unit="kg")
    payload_offset: list[float] = setting([0.0, 0.0, 0.0], count=3, unit="m")
    inertia_scale: float = setting(1.0, above=0, unit="-")
    link_scales: Optional[list[float]] = setting(None, above=0, unit="-")

    @property
    def exact(self) -> bool:
        """Whether the model is the robot itself."""
        scales = [self.inertia_scale, *(self.link_scales or [])]
        return not self._changes_payload and all(scale == 1 for scale in scales)

    @property
    def _changes_payload(self) -> bool:
        """Whether there has to be a link `payload`."""
        return self.payload_mass != 0 or any(x != 0 for x in self.payload_offset)


def deviated(robot: Robot, deviation: Deviation, where: str = "deviation") -> Robot:
    """`robot` with a deviation; itself if there is none.

    It is counted from `robot` as it is: deviations add up.

    Args:
        robot: stays as it is.
        deviation: what is different.
        where: what errors start with.

    Raises:
        InputError: if the payload is no link, or a body is left that cannot be.
    """
    if deviation.exact:
        return robot
    with within(where):
        return edited(robot, lambda root: _apply(deviation, root, where))


def _apply(deviation: Deviation, root: ET.Element, where: str) -> None:
    """Put it into the XML of an SDF."""
    if deviation._changes_payload:
        payload = link_named(root, deviation.payload, f"{where}.payload")
        _add_mass(payload, deviation.payload_mass, f"{where}.payload_mass")
        shift_link(payload, deviation.payload_offset)
    links = links_by_name(root)
    scales = deviation.link_scales or [1.0] * len(links)
    if len(scales) != len(links):
        each = f"{len(links)}, one for each of {', '.join(links)}"
        raise InputError(f"{where}.link_scales: {len(scales)} value(s), expected {each}")
    for link, own in zip(links.values(), scales, strict=True):
        scale_link(link, deviation.inertia_scale * own)


def _add_mass(link: ET.Element, added: float, where: str) -> None:
    """Add mass [kg] to a link, and inertia in proportion."""
    mass, name = float(link.findtext("inertial/mass", "nan")), link.get("name")
    if mass == 0:
        raise InputError(f"{where}: link '{name}' has no mass to be scaled, expected another link")
    if mass + added <= 0:
        raise InputError(
            f"{where}: {added:g} kg would leave {mass + added:g} kg of link '{name}', "
            f"expected more than {-mass:g}"
        )
    scale_link(link, (mass + added) / mass)
