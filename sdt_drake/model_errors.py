"""A controller's own model of the robot: the same SDF with stated errors."""

# Drake's YAML loader reads the annotations of ModelErrors: they may not be postponed (scenario.py).
import xml.etree.ElementTree as ET
from dataclasses import dataclass, field
from pathlib import Path

from sdt_drake.errors import InputError, checked_number
from sdt_drake.robot import Robot, load_robot


@dataclass
class ModelErrors:
    """What the controller's model of the robot gets wrong.

    Masses and inertias here are those of the links, joint side. Rotors, gears, limits, damping and
    kinematics are known exactly.

    Attributes:
        payload: name of the link that payload_mass and payload_offset change.
        payload_mass: [kg], added to the link's mass in the model; its inertia scales with the mass
            (the same body, evenly heavier).
        payload_offset: [m], added to the position of the link's centre of mass, in the frame in
            which <inertial><pose> is written: that of the link.
        inertia_scale: factor on masses and inertias of all links [-], applied after the payload's
            change. So the links' part of the mass matrix, the velocity torques and the gravity
            torques all scale with it; what the rotors add to the mass matrix does not.
    """

    payload: str = "payload"
    payload_mass: float = 0.0
    payload_offset: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])
    inertia_scale: float = 1.0

    @property
    def exact(self) -> bool:
        """Whether the model is the robot itself."""
        return not self._changes_payload and self.inertia_scale == 1

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


def load_model(robot: Robot, errors: ModelErrors) -> Robot:
    """What a controller takes `robot` for: `robot` itself if the errors are none.

    The errors are counted from the SDF file, not from `robot`: they do not add up if `robot` is a
    model already.

    Raises:
        InputError: if an error is out of range, or the payload is no link or is left without mass.
    """
    errors.validate("errors")
    if errors.exact:
        return robot
    return load_robot(robot.path, edit=lambda root: _apply(errors, root, robot.path))


def _apply(errors: ModelErrors, root: ET.Element, file: Path) -> None:
    """Put the errors into the XML of the SDF."""
    links = {link.get("name", ""): link for link in root.iter("link")}
    if errors._changes_payload:
        if errors.payload not in links:
            raise InputError(
                f"payload: no link '{errors.payload}' in {file}, expected one of {', '.join(links)}"
            )
        _add_mass(links[errors.payload], errors.payload_mass)
        _shift(links[errors.payload], errors.payload_offset)
    for link in links.values():
        _scale(link, errors.inertia_scale)


def _add_mass(link: ET.Element, added: float) -> None:
    """Add mass [kg] to a link, and inertia in proportion."""
    mass = float(link.findtext("inertial/mass", "nan"))
    if mass + added <= 0:
        raise InputError(
            f"payload_mass: {added:g} kg would leave {mass + added:g} kg of link "
            f"'{link.get('name')}', expected more than {-mass:g}"
        )
    _scale(link, (mass + added) / mass)


def _shift(link: ET.Element, offset: list[float]) -> None:
    """Move a link's centre of mass by `offset` [m], in the frame of the link."""
    inertial = link.find("inertial")
    pose = inertial.find("pose")
    if pose is None:
        pose = ET.SubElement(inertial, "pose")
    if not (pose.text or "").strip():  # at the link's origin
        pose.attrib.clear()  # it might ask for a quaternion
        pose.text = "0 0 0 0 0 0"
    values = pose.text.split()
    position = [repr(float(x) + float(dx)) for x, dx in zip(values[:3], offset, strict=True)]
    pose.text = " ".join(position + values[3:])


def _scale(link: ET.Element, factor: float) -> None:
    """Multiply a link's mass and inertia by `factor`."""
    for element in (*link.findall("inertial/mass"), *link.findall("inertial/inertia/*")):
        element.text = repr(float(element.text) * float(factor))
