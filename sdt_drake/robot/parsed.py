"""Parse the plant of an SDF into Drake, and refuse what is no serial chain of driven joints."""

import re
import xml.etree.ElementTree as ET
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import Joint, JointActuator, RevoluteJoint, RigidBody

from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError, one_line
from sdt_drake.robot.coupling import without_coupling
from sdt_drake.robot.published import few
from sdt_drake.robot.sdf import mass_and_inertia

STILL = "still"  # kind of problem: a joint moves no mass

_PLACE = re.compile(r"<(data|literal)-string>\S* |error: ")  # places in Drake's messages


def parse(file: Path, root: ET.Element) -> MultibodyPlant:
    """Parse the plant of an SDF, without finalizing it."""
    text = ET.tostring(without_coupling(root), encoding="unicode")
    plant = MultibodyPlant(time_step=0.0)
    parser = Parser(plant)
    parser.SetStrictParsing()
    try:
        parser.AddModelsFromString(text, "sdf")
    except Exception as error:  # Drake raises many types
        raise InputError(f"{file}: {_PLACE.sub('', one_line(error))}") from None
    return plant


def chain_of(plant: MultibodyPlant, file: Path) -> list[RevoluteJoint]:
    """Return the revolute joints, base to tip. Welded bodies count as one."""
    joints = [plant.get_joint(index) for index in plant.GetJointIndices()]
    chain: list[RevoluteJoint] = []
    reached = welded_to(plant.world_body(), plant)
    n_reached = len(reached)
    turning = [joint for joint in joints if isinstance(joint, RevoluteJoint)]
    while outboard := [j for j in turning if j.parent_body().index() in reached]:
        if len(outboard) > 1:
            names = ", ".join(f"'{j.name()}'" for j in outboard)
            raise InputError(
                f"{file}: the chain branches at joints {names}, expected one chain; tip=... names "
                f"the link that ends it, such as {few(_ends(joints))}, and holds all other joints"
            )
        chain += outboard
        reached = welded_to(outboard[0].child_body(), plant)
        n_reached += len(reached)
    if n_reached < plant.num_bodies():
        raise InputError(
            f"{file}: {plant.num_bodies() - n_reached} link(s) are not connected to the world by "
            "revolute or fixed joints; give the base a joint with <parent>world</parent>"
        )
    if not chain:
        raise InputError(f"{file}: no revolute joint")
    return chain


def _ends(joints: Sequence[Joint]) -> list[str]:
    """Return the names of the links that carry no other, those beyond most moving joints first."""
    inboard = {joint.child_body().index(): joint for joint in joints}
    inner = {joint.parent_body().index() for joint in joints}
    depth = {}
    for index in inboard.keys() - inner:
        link, count = index, 0
        while joint := inboard.get(link):
            count += isinstance(joint, RevoluteJoint)
            link = joint.parent_body().index()
        depth[inboard[index].child_body().name()] = count
    return sorted(depth, key=lambda name: (-depth[name], name))


def welded_to(body: RigidBody, plant: MultibodyPlant) -> set[object]:
    """Return the indices of the bodies that are welded to one, itself included."""
    return {b.index() for b in plant.GetBodiesWeldedTo(body)}


def actuators_of(plant: MultibodyPlant, joints: Sequence[Joint], file: Path) -> list[JointActuator]:
    """Check the motors, and return the actuators in the order of the joints."""
    found = [plant.get_joint_actuator(index) for index in plant.GetJointActuatorIndices()]
    by_joint = {actuator.joint().index(): actuator for actuator in found}
    for joint in joints:
        actuator = by_joint.get(joint.index())
        rotor = actuator.default_rotor_inertia() if actuator else 0.0
        ratio = actuator.default_gear_ratio() if actuator else 1.0
        for good, text in (
            (rotor >= 0, f"rotor inertia {rotor:g} kg m², expected >= 0"),
            (ratio > 0, f"gear ratio {ratio:g}, expected > 0"),
        ):
            if not good:
                raise InputError(f"{file}: joint '{joint.name()}': {text}")
    return [by_joint[joint.index()] for joint in joints]


def friction_of(root: ET.Element, names: Sequence[str]) -> Array:
    """Return the Coulomb friction of joints by their names, joint side [N m], shape (n,)."""
    texts = {
        joint.get("name"): joint.findtext("axis/dynamics/friction") for joint in root.iter("joint")
    }
    return np.array([float(texts[name] or 0) for name in names])


def massless(plant: MultibodyPlant, joints: Sequence[Joint], without: Sequence[str]) -> list[str]:
    """Return the links that joints move and that have no <inertial>, nor has one welded to them.

    Args:
        plant: the plant.
        joints: the joints, base to tip.
        without: names of all links without <inertial>.
    """
    moved = [plant.GetBodiesWeldedTo(joint.child_body()) for joint in joints]
    return [
        joint.child_body().name()
        for joint, bodies in zip(joints, moved, strict=True)
        if {body.name() for body in bodies} <= {*without}
    ]


def replace_actuators(
    plant: MultibodyPlant, joints: Sequence[Joint], old: list[JointActuator], inertia: Array
) -> None:
    """Put the actuators in the order of the joints and remove their effort limits.

    Otherwise the plant would silently limit its torque. The saturation block does that in a loop.

    Args:
        plant: the plant, not yet finalized.
        joints: the joints, base to tip.
        old: their actuators.
        inertia: inertia that each motor sees of all motors [kg m²], shape (n,).
    """
    motors = [(a.name(), a.default_gear_ratio()) for a in old]
    for actuator in old:
        plant.RemoveJointActuator(actuator)
    for joint, (name, gear_ratio), seen in zip(joints, motors, inertia, strict=True):
        actuator = plant.AddJointActuator(name, joint)
        actuator.set_default_rotor_inertia(seen)
        actuator.set_default_gear_ratio(gear_ratio)


def check_dynamics(M: Array, names: Sequence[str], file: Path) -> None:
    """Check that every joint moves some mass.

    Args:
        M: mass matrix with rotors, joint side [kg m²], shape (n, n).
        names: names of the joints.
        file: the file, for messages.
    """
    eigenvalues = np.linalg.eigvalsh(M)
    if eigenvalues[0] <= 1e-12 * eigenvalues[-1]:
        k, most = int(np.argmin(M.diagonal())), int(np.argmax(M.diagonal()))
        raise InputError(
            f"{file}: joint '{names[k]}': inertia about its axis {M[k, k]:g} kg m², "
            f"expected more: that of '{names[most]}' is {M[most, most]:g} kg m²",
            kind=STILL,
        )


def check_inertias_kept(plant: MultibodyPlant, root: ET.Element, file: Path) -> None:
    """Check that Drake kept mass and inertia of every link."""
    for link in root.iter("link"):
        where = f"{file}: link '{link.get('name')}'"
        mass, inertia = mass_and_inertia(link, where)
        kept, _, central = parts_of(plant.GetBodyByName(link.get("name", "")))
        same = np.allclose(
            [kept, np.trace(central)], [mass, np.trace(inertia)], rtol=1e-9, atol=1e-9 * mass
        )
        if not same:
            raise InputError(f"{where}: Drake replaced its mass or inertia; check <inertial>")


def parts_of(body: RigidBody) -> tuple[float, Array, Array]:
    """Return mass [kg], centre of mass [m] and central inertia [kg m²] of a link, in its frame."""
    inertia = body.default_spatial_inertia()
    com = inertia.get_com()
    return inertia.get_mass(), com, inertia.Shift(com).CalcRotationalInertia().CopyToFullMatrix3()
