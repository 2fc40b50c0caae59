"""A robot whose links differ from its file: a controller's model of it, or what it really is."""

# Drake's YAML loader reads the annotations of Deviation: they may not be postponed, and "or None"
# must be spelled Optional[...] (scenario.py).
import xml.etree.ElementTree as ET
from dataclasses import dataclass, field
from pathlib import Path
from typing import Optional

from sdt_drake.errors import InputError, checked_number
from sdt_drake.links import links_by_name, payload_of, scale_link, shift_link
from sdt_drake.robot import Robot, edited


@dataclass
class Deviation:
    """What differs from the links of the robot's file.

    Masses and inertias here are those of the links, joint side. Rotors, gears, limits, damping and
    kinematics are known exactly.

    Attributes:
        payload: name of the link that payload_mass and payload_offset change.
        payload_mass: [kg], added to the link's mass in the model; its inertia scales with the mass
            (the same body, evenly heavier).
        payload_offset: [m], added to the position of the link's centre of mass, in the frame in
            which <inertial> is written: that of the link.
        inertia_scale: factor on masses and inertias of all links [-], applied after the payload's
            change. So the links' part of the mass matrix, the velocity torques and the gravity
            torques all scale with it; what the rotors add to the mass matrix does not.
        link_scales: the same factor for each link on its own [-], in the order of the file.
    """

    payload: str = "payload"
    payload_mass: float = 0.0
    payload_offset: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])
    inertia_scale: float = 1.0
    link_scales: Optional[list[float]] = None  # noqa: UP045

    @property
    def exact(self) -> bool:
        """Whether the model is the robot itself."""
        scales = [self.inertia_scale, *(self.link_scales or [])]
        return not self._changes_payload and all(scale == 1 for scale in scales)

    @property
    def _changes_payload(self) -> bool:
        """Whether there has to be a link `payload`."""
        return self.payload_mass != 0 or any(x != 0 for x in self.payload_offset)

    def validate(self, where: str) -> None:
        """Check all that does not need the robot.

        Raises:
            InputError: naming `where` and the field.
        """
        checked_number(self.payload_mass, f"{where}.payload_mass")
        if len(self.payload_offset) != 3:
            raise InputError(
                f"{where}.payload_offset: {len(self.payload_offset)} value(s), expected 3: x, y, z"
            )
        for value in self.payload_offset:
            checked_number(value, f"{where}.payload_offset")
        checked_number(self.inertia_scale, f"{where}.inertia_scale", minimum=0, exclusive=True)
        for scale in self.link_scales or []:
            checked_number(scale, f"{where}.link_scales", minimum=0, exclusive=True)


def deviated(robot: Robot, deviation: Deviation) -> Robot:
    """`robot` with a deviation; itself if there is none.

    It is counted from `robot` as it is: deviations add up.

    Raises:
        InputError: if a value is out of range, or the payload is no link or is left without mass.
    """
    deviation.validate("deviation")
    if deviation.exact:
        return robot
    return edited(robot, lambda root: _apply(deviation, root, robot.path))


def _apply(deviation: Deviation, root: ET.Element, file: Path) -> None:
    """Put it into the XML of the SDF."""
    links = links_by_name(root)
    if deviation._changes_payload:
        payload = payload_of(root, deviation.payload, file)
        _add_mass(payload, deviation.payload_mass)
        shift_link(payload, deviation.payload_offset)
    scales = deviation.link_scales or [1.0] * len(links)
    if len(scales) != len(links):
        raise InputError(
            f"link_scales: {len(scales)} value(s), expected {len(links)}: {', '.join(links)}"
        )
    for link, own in zip(links.values(), scales, strict=True):
        scale_link(link, deviation.inertia_scale * own)


def _add_mass(link: ET.Element, added: float) -> None:
    """Add mass [kg] to a link, and inertia in proportion."""
    mass = float(link.findtext("inertial/mass", "nan"))
    if mass == 0:
        raise InputError(
            f"payload_mass: {added:g} kg, but link '{link.get('name')}' has no mass, so no inertia "
            "in proportion to it; expected another link"
        )
    if mass + added <= 0:
        raise InputError(
            f"payload_mass: {added:g} kg would leave {mass + added:g} kg of link "
            f"'{link.get('name')}', expected more than {-mass:g}"
        )
    scale_link(link, (mass + added) / mass)
