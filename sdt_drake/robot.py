"""An SDF file as a validated serial robot: its plant, motors, gears and limits."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import RevoluteJoint, RigidBody, WeldJoint

from sdt_drake.errors import InputError
from sdt_drake.resources import find_file, models_dir

Vector = NDArray[np.float64]

DRAKE = "{http://drake.mit.edu}"
# Drake knows its elements by this prefix; with another, rotor inertias and gears are not read.
ET.register_namespace("drake", DRAKE.strip("{}"))

DEFAULT_ROBOT = "package://sdt/sdt.sdf"


@dataclass(frozen=True, eq=False)
class Robot:
    """A serial chain of n revolute joints, each with a motor and a gear, base to tip.

    Attributes:
        name: of the SDF model.
        path: of the SDF file.
        plant: finalized continuous MultibodyPlant. Velocity k and actuator k belong to joint k;
            rotor inertias are reflected in its mass matrix; it has **no effort limits** (the
            saturation block is the one limiter of a loop).
        joint_names: base to tip.
        rotor_inertia: I_m of motor and gearbox, motor side [kg m²], shape (n,).
        gear_ratio: r, motor speed over joint speed [-], shape (n,).
        effort_limit: largest torque, **joint side** [N m], shape (n,).
        velocity_limit: largest joint speed [rad/s], inf where the file gives none, shape (n,).
        acceleration_limit: largest joint acceleration [rad/s²], of `<drake:acceleration>`, inf
            where the file gives none, shape (n,).
        position_lower, position_upper: joint stops [rad], ±inf where there are none, shape (n,).
        damping: viscous friction of the joints, joint side [N m s/rad], shape (n,).
        sdf: text that the plant was parsed from.
        frequency_factor: lowest natural frequency of the structure over that of the SDF file [-].
    """

    name: str
    path: Path
    plant: MultibodyPlant
    joint_names: tuple[str, ...]
    rotor_inertia: Vector
    gear_ratio: Vector
    effort_limit: Vector
    velocity_limit: Vector
    acceleration_limit: Vector
    position_lower: Vector
    position_upper: Vector
    damping: Vector
    sdf: str
    frequency_factor: float = 1.0

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.joint_names)

    @cached_property
    def motor_torque_limit(self) -> Vector:
        """Largest torque of each motor, motor side [N m], shape (n,)."""
        return self.effort_limit / self.gear_ratio

    @cached_property
    def reflected_inertia(self) -> Vector:
        """r² I_m: what the motors add to the diagonal of the mass matrix [kg m²], shape (n,)."""
        return self.gear_ratio**2 * self.rotor_inertia

    def make_plant(self) -> MultibodyPlant:
        """A copy of the plant that a diagram can own."""
        return self.plant.Clone()

    def make_open_plant(self) -> MultibodyPlant:
        """A plant like `plant`, not finalized: bodies and joints can still be added."""
        plant = _parse(self.path, self.sdf)
        joints = [plant.GetJointByName(name) for name in self.joint_names]
        _replace_actuators(plant, joints, _actuators(plant, joints, self.path))
        return plant


def load_robot(path: str | Path = DEFAULT_ROBOT) -> Robot:
    """Load and validate a serial robot.

    What Drake would silently repair or ignore is refused: masses and inertias that are missing or
    impossible, `<friction>`, actuators without a limit.

    Args:
        path: an SDF file, or `package://sdt/...` for a robot that ships with the package.

    Raises:
        InputError: naming the file, the link or joint, and the number.
    """
    file = find_file(path)
    if file.suffix != ".sdf":
        raise InputError(f"{file}: expected an .sdf file")
    return _checked_robot(file, _read(file), from_file=True)


def edited(robot: Robot, edit: Callable[[ET.Element], None]) -> Robot:
    """Another robot from the text of this one, so that edits add up; its file stays as it is.

    Args:
        robot: stays as it is, too.
        edit: changes the XML in place, <sdf> and all below, before it is checked and parsed.

    Raises:
        InputError: as `load_robot` does, if no robot could be as the edit leaves it.
    """
    root = ET.fromstring(robot.sdf)
    edit(root)
    other = _checked_robot(robot.path, root, from_file=False)
    return replace(other, frequency_factor=robot.frequency_factor)


def _checked_robot(file: Path, root: ET.Element, *, from_file: bool) -> Robot:
    """The robot of this XML, which is that of the file, or an edited one."""
    _check_text(root, file)
    text = ET.tostring(root, encoding="unicode")
    plant = _parse(file, None if from_file else text)
    joints = _chain(plant, file)
    actuators = _actuators(plant, joints, file)
    effort_limit = np.array([a.effort_limit() for a in actuators])
    rotor_inertia = np.array([a.default_rotor_inertia() for a in actuators])
    gear_ratio = np.array([a.default_gear_ratio() for a in actuators])
    _replace_actuators(plant, joints, actuators)
    plant.Finalize()
    _check_inertias_kept(plant, root, file)
    _check_dynamics(plant, joints, file)
    return Robot(
        name=plant.GetModelInstanceName(joints[0].model_instance()),
        path=file,
        plant=plant,
        joint_names=tuple(j.name() for j in joints),
        rotor_inertia=rotor_inertia,
        gear_ratio=gear_ratio,
        effort_limit=effort_limit,
        velocity_limit=np.array([j.velocity_upper_limits()[0] for j in joints]),
        acceleration_limit=np.array([j.acceleration_upper_limits()[0] for j in joints]),
        position_lower=np.array([j.position_lower_limits()[0] for j in joints]),
        position_upper=np.array([j.position_upper_limits()[0] for j in joints]),
        damping=np.array([j.default_damping_vector()[0] for j in joints]),
        sdf=text,
    )


# --- what only the text of the file can tell -------------------------------------------------


def _read(file: Path) -> ET.Element:
    """The XML of the file, Drake's elements in the namespace `DRAKE`.

    Drake goes by the prefix alone and takes any address for it; many files have "drake.mit.edu".
    """
    try:
        with file.open("rb") as stream:
            reader = ET.iterparse(stream, events=["start-ns"])
            prefixes = {f"{{{uri}": prefix for _, (prefix, uri) in reader}
    except (ET.ParseError, UnicodeDecodeError) as error:
        raise InputError(f"{file}: not well-formed XML ({error})") from None
    for element in reader.root.iter():
        uri, _, tag = element.tag.rpartition("}")
        if prefixes.get(uri) == "drake":
            element.tag = DRAKE + tag
    return reader.root


def _check_text(root: ET.Element, file: Path) -> None:
    """Refuse what the SDF parser would fill in, replace or drop without an error."""
    if root.find(".//include") is not None:
        raise InputError(f"{file}: <include> is not supported, write the links into the file")
    if len(root.findall(".//model")) != 1:
        raise InputError(f"{file}: {len(root.findall('.//model'))} models, expected one")
    for link in root.iter("link"):
        where = f"{file}: link '{link.get('name')}'"
        _check_inertial(link, where)
        if link.find(".//fluid_added_mass") is not None:
            raise InputError(f"{where}: <fluid_added_mass> would have no effect here; remove it")
    for joint in root.iter("joint"):
        _check_joint(joint, f"{file}: joint '{joint.get('name')}'")


# In joints: numbers that must be finite, numbers that may be infinite, elements that must be zero
# because nothing here models them, and elements that nothing here models at all.
_FINITE = ("damping", f"{DRAKE}rotor_inertia", f"{DRAKE}gear_ratio")
_ACCELERATION = f"{DRAKE}acceleration"
_LIMITS = ("lower", "upper", "effort", "velocity", _ACCELERATION)
_ZERO = {
    "friction": "Drake would drop it",
    "spring_stiffness": "springs are not supported",
    "spring_reference": "springs are not supported",
}
_UNKNOWN = (
    "mimic",
    f"{DRAKE}mimic",
    f"{DRAKE}controller_gains",
)


def _check_joint(joint: ET.Element, where: str) -> None:
    for element in joint.iter():
        tag = element.tag.removeprefix(DRAKE)
        if element.tag in _UNKNOWN:
            raise InputError(f"{where}: <{tag}> would have no effect here; remove it")
        if element.tag in _FINITE:
            _number(element, where)
        if element.tag in _LIMITS:
            limit = _number(element, where, finite=False)
            if element.tag == _ACCELERATION and limit <= 0:
                raise InputError(f"{where}: <{tag}> {element.text}, expected a number > 0")
        if element.tag in _ZERO and _number(element, where) != 0:
            raise InputError(f"{where}: <{tag}> {element.text}, {_ZERO[tag]}; remove it")


def _check_inertial(link: ET.Element, where: str) -> None:
    """Mass > 0; central inertia with principal moments that some rigid body can have."""
    mass = link.find("inertial/mass")
    if mass is None:
        raise InputError(f"{where}: no <mass>; Drake would take 1 kg")
    if _number(mass, where) <= 0:
        raise InputError(f"{where}: <mass> {mass.text} kg, expected a number > 0")
    moments = np.linalg.eigvalsh(_inertia_matrix(link, where))
    if moments[0] < 0:
        raise InputError(
            f"{where}: inertia has the principal moment {moments[0]:g} kg m², expected >= 0"
        )
    if moments[2] > (moments[0] + moments[1]) * (1 + 1e-12):
        raise InputError(
            f"{where}: inertia breaks the triangle inequality, principal moments "
            f"{moments[0]:g} + {moments[1]:g} < {moments[2]:g} kg m²"
        )


def _inertia_matrix(link: ET.Element, where: str) -> NDArray[np.float64]:
    values = {}
    for key in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz"):
        element = link.find(f"inertial/inertia/{key}")
        if element is None and key[1] == key[2]:
            raise InputError(f"{where}: no <{key}>; Drake would take 1 kg m²")
        values[key] = 0.0 if element is None else _number(element, where)
    return np.array(
        [
            [values["ixx"], values["ixy"], values["ixz"]],
            [values["ixy"], values["iyy"], values["iyz"]],
            [values["ixz"], values["iyz"], values["izz"]],
        ]
    )


def _number(element: ET.Element, where: str, *, finite: bool = True) -> float:
    try:
        value = float(element.text or "")
    except ValueError:
        value = float("nan")
    if np.isnan(value) or (finite and np.isinf(value)):
        tag = element.tag.removeprefix(DRAKE)
        raise InputError(f"{where}: <{tag}> is '{element.text}', expected a number")
    return value


# --- what the parsed plant tells -------------------------------------------------------------


_PLACE_IN_TEXT = r"<(data|literal)-string>\S* "  # as Drake writes it


def _parse(file: Path, text: str | None) -> MultibodyPlant:
    """The plant of the file, or of its edited `text`, not finalized.

    No geometry is read, so paths of meshes, which a text could not resolve, do not matter.
    """
    plant = MultibodyPlant(time_step=0.0)
    parser = Parser(plant)
    parser.SetStrictParsing()
    parser.package_map().AddPackageXml(str(models_dir() / "package.xml"))
    try:
        if text is None:
            parser.AddModels(str(file))
        else:
            parser.AddModelsFromString(text, "sdf")
    except RuntimeError as error:
        reason = " ".join(str(error).split())
        if text is not None:  # its lines are not those of the file
            raise InputError(f"{file}, edited: {re.sub(_PLACE_IN_TEXT, '', reason)}") from None
        reason = re.sub(rf"\S*{re.escape(file.name)}:", "line ", reason)
        raise InputError(f"{file}: {reason}") from None
    return plant


def _chain(plant: MultibodyPlant, file: Path) -> list[RevoluteJoint]:
    """The revolute joints, base to tip; welded bodies count as one."""
    joints = [plant.get_joint(index) for index in plant.GetJointIndices()]
    for joint in joints:
        if not isinstance(joint, RevoluteJoint | WeldJoint):
            raise InputError(
                f"{file}: joint '{joint.name()}' is {joint.type_name()}, expected revolute or fixed"
            )
    chain: list[RevoluteJoint] = []
    reached = _welded_to(plant.world_body(), plant)
    n_reached = len(reached)
    while True:
        outboard = [
            j for j in joints if isinstance(j, RevoluteJoint) and j.parent_body().index() in reached
        ]
        if len(outboard) > 1:
            names = ", ".join(f"'{j.name()}'" for j in outboard)
            raise InputError(f"{file}: the chain branches at joints {names}, expected one chain")
        if not outboard:
            break
        chain.append(outboard[0])
        reached = _welded_to(outboard[0].child_body(), plant)
        n_reached += len(reached)
    if n_reached < plant.num_bodies():
        raise InputError(
            f"{file}: {plant.num_bodies() - n_reached} link(s) are not connected to the world by "
            "revolute or fixed joints; give the base a joint with <parent>world</parent>"
        )
    if not chain:
        raise InputError(f"{file}: no revolute joint")
    return chain


def _welded_to(body: RigidBody, plant: MultibodyPlant) -> set[object]:
    return {b.index() for b in plant.GetBodiesWeldedTo(body)}


def _actuators(plant: MultibodyPlant, joints: list[RevoluteJoint], file: Path) -> list:
    """The actuator of each joint, in the order of the joints, with sound motor data."""
    by_joint = {}
    for index in plant.GetJointActuatorIndices():
        actuator = plant.get_joint_actuator(index)
        by_joint[actuator.joint().index()] = actuator
    for joint in joints:
        where = f"{file}: joint '{joint.name()}'"
        actuator = by_joint.get(joint.index())
        limit = 0.0 if actuator is None else actuator.effort_limit()
        if not 0 < limit < np.inf:
            raise InputError(
                f"{where}: actuator effort limit {limit:g} N m, expected <limit><effort> > 0"
            )
        if actuator.default_rotor_inertia() < 0:
            raise InputError(
                f"{where}: rotor inertia {actuator.default_rotor_inertia():g} kg m², expected >= 0"
            )
        if actuator.default_gear_ratio() <= 0:
            raise InputError(f"{where}: gear ratio {actuator.default_gear_ratio():g}, expected > 0")
    return [by_joint[joint.index()] for joint in joints]


def _replace_actuators(plant: MultibodyPlant, joints: list[RevoluteJoint], old: list) -> None:
    """Put the actuators in the order of the joints and take their effort limits away.

    A plant clamps its actuation by itself, silently; a loop has one limiter, its saturation block.
    """
    motors = [(a.name(), a.default_rotor_inertia(), a.default_gear_ratio()) for a in old]
    for actuator in old:
        plant.RemoveJointActuator(actuator)
    for joint, (name, rotor_inertia, gear_ratio) in zip(joints, motors, strict=True):
        actuator = plant.AddJointActuator(name, joint)
        actuator.set_default_rotor_inertia(rotor_inertia)
        actuator.set_default_gear_ratio(gear_ratio)


def _check_dynamics(plant: MultibodyPlant, joints: list[RevoluteJoint], file: Path) -> None:
    """Only gravity and motors act on the chain, and every joint has something to move."""
    if plant.num_force_elements() > 1:  # the first one is gravity
        raise InputError(f"{file}: springs, bushings and the like are not supported; remove them")
    if plant.num_constraints() > 0:
        raise InputError(f"{file}: constraints are not supported; remove them")
    M = plant.CalcMassMatrix(plant.CreateDefaultContext())
    eigenvalues = np.linalg.eigvalsh(M)
    if eigenvalues[0] <= 1e-12 * eigenvalues[-1]:
        k = int(np.argmin(M.diagonal()))
        raise InputError(
            f"{file}: joint '{joints[k].name()}': no inertia about its axis "
            f"({M[k, k]:g} kg m²), expected > 0"
        )


def _check_inertias_kept(plant: MultibodyPlant, root: ET.Element, file: Path) -> None:
    """Every link of the plant has the mass and the trace of inertia that the XML gives it."""
    for link in root.iter("link"):
        where = f"{file}: link '{link.get('name')}'"
        central = plant.GetBodyByName(link.get("name", "")).default_spatial_inertia()
        mass = _number(link.find("inertial/mass"), where)
        trace = np.trace(_inertia_matrix(link, where))
        com = central.get_com()
        about_origin = central.CalcRotationalInertia().CopyToFullMatrix3()
        shift = central.get_mass() * 2 * (com @ com)  # trace of the parallel-axis term
        if not np.allclose(
            [central.get_mass(), np.trace(about_origin) - shift], [mass, trace], rtol=1e-9
        ):
            raise InputError(f"{where}: Drake replaced its mass or inertia; check <inertial>")
