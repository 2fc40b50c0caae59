"""`Robot`, a validated serial robot from an SDF or URDF file: plant, motors, gears and limits."""

import logging
import xml.etree.ElementTree as ET
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, cached_property
from pathlib import Path
from typing import cast

import numpy as np
from numpy.typing import ArrayLike
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import BodyIndex, RevoluteJoint
from pydrake.systems.framework import Context

from sdt_drake.io.arguments import a_path, instance_of, takes
from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError, Problem, raise_all
from sdt_drake.io.resources import find_file
from sdt_drake.io.shown import Shown, Summary, joint_count, of_joints
from sdt_drake.robot import parsed
from sdt_drake.robot.coupling import coupling_of, in_words, motor_inertia
from sdt_drake.robot.envelope import Envelope
from sdt_drake.robot.lacks import TORQUES, lacks_of, told_zeros
from sdt_drake.robot.rounding import fill_zeros
from sdt_drake.robot.sdf import check_sdf, zero_limits
from sdt_drake.robot.xml_files import parse_xml, read_robot_file

_NO_STOP = 1e16  # rad

DEFAULT_ROBOT = "package://sdt/sdt.sdf"


@dataclass(frozen=True, eq=False, repr=False)
class Robot(Shown):
    """A serial chain of n revolute joints, each with a motor and a gear, from base to tip."""

    name: str
    """Name of the model."""
    path: Path
    """The SDF or URDF file."""
    plant: MultibodyPlant
    """Finalized continuous plant. Velocity k and actuator k belong to joint k. Its mass matrix
    contains the rotors on the diagonal alone; `mass_matrix` has all. It has **no effort limits**:
    the saturation block limits the torque."""
    joint_names: tuple[str, ...]
    """Names of the joints, base to tip."""
    rotor_inertia: Array
    """I_m of motor and gearbox, motor side [kg m²], shape (n,)."""
    gear_ratio: Array
    """r, motor speed over joint speed [-], shape (n,)."""
    coupling: Array
    """Motor speeds per joint speeds [-], shape (n, n): diag(r), and further entries for coupled
    motors, as in wrists."""
    effort_limit: Array
    """Largest torque, **joint side** [N m], shape (n,); inf if the file has none, or 0."""
    velocity_limit: Array
    """Largest joint speed [rad/s], shape (n,); inf if unlimited."""
    acceleration_limit: Array
    """Largest joint acceleration, `<drake:acceleration>` [rad/s²], shape (n,); inf if unlimited."""
    position_lower: Array
    """Lower joint stops [rad], shape (n,); -inf without a stop."""
    position_upper: Array
    """Upper joint stops [rad], shape (n,); inf without a stop."""
    damping: Array
    """Viscous friction of the joints, joint side [N m s/rad], shape (n,)."""
    coulomb: Array
    """Coulomb friction of the file, `<friction>` [N m], joint side, shape (n,). The plant has none:
    a scenario simulates it with `plant.friction.coulomb`."""
    sdf: str
    """The SDF of the plant as text, without shapes, also if the file is a URDF."""
    frequency_factor: float = 1.0
    """Lowest natural frequency of the structure over that of the file [-]."""
    envelope: Envelope | None = None
    """Torque-speed envelope of the motors; None if unknown."""
    accepted: tuple[str, ...] = ()
    """One sentence for each number of the file that was corrected or ignored."""
    held: Mapping[str, float] = field(default_factory=dict)
    """Positions of the joints of the file that are held, by their names [rad, m]."""
    lacks: tuple[Problem, ...] = ()
    """Gaps of the file for some uses: problems of the kinds that `having` takes."""

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.joint_names)

    def having(self, *kinds: str) -> "Robot":
        """Return the robot itself if its file has what a use of it needs.

        Args:
            kinds: MASSES, TORQUES or SPEEDS.

        Raises:
            InputError: a problem for each kind of what is missing, with all links or joints.
        """
        raise_all([problem for problem in self.lacks if problem.kind in kinds])
        return self

    def summary(self) -> Summary:
        columns = {
            "gear ratio [-]": (".4g", self.gear_ratio),
            "largest torque [N m]": (".5g", self.motor_torque_limit),
            "rotor inertia [kg m²]": (".4g", self.rotor_inertia),
        }
        return of_joints(
            f"{self.name}: {joint_count(self.n)}; motor side", columns, self.joint_names
        )

    @cached_property
    def motor_torque_limit(self) -> Array:
        """Largest torque of each motor, motor side [N m], shape (n,)."""
        return self.effort_limit / self.gear_ratio

    @property
    def is_coupled(self) -> bool:
        """True if a motor also turns with another joint."""
        return bool(np.count_nonzero(self.coupling) > self.n)

    @cached_property
    def motor_inertia(self) -> Array:
        """Inertia of all motors that turn with a joint, seen by its own one [kg m²], shape (n,).

        Motor side. It is I_m unless other motors turn with the joint, too."""
        return motor_inertia(self.coupling, self.gear_ratio, self.rotor_inertia)

    @cached_property
    def reflected_inertia(self) -> Array:
        """Motors' part of the diagonal of the mass matrix, joint side [kg m²], shape (n,).

        The motors turn at C v and have the energy (C v)' I_m (C v) / 2, with the coupling C. So
        their part of the mass matrix is C' I_m C. Its diagonal is r² I_m without coupled motors."""
        return self.gear_ratio**2 * self.motor_inertia

    @cached_property
    def shared_inertia(self) -> Array:
        """Motors' part of the mass matrix off its diagonal [kg m²], shape (n, n).

        Joint side. It belongs to motors that turn with two joints, and is 0 without them."""
        whole = self.coupling.T * self.rotor_inertia @ self.coupling
        return whole * (1 - np.eye(self.n))

    def mass_matrix(self, context: Context) -> Array:
        """Return the mass matrix with all rotors, joint side [kg m²], shape (n, n).

        Args:
            context: a context of `plant`.
        """
        return self.plant.CalcMassMatrix(context) + self.shared_inertia

    @cached_property
    def gear_coupling(self) -> Array:
        """Turns at the output of each motor's gear per turn of each joint [-], shape (n, n).

        The output of a gear turns at the motor's speed over r: with the joint, unless the motor
        turns with another joint, too."""
        return self.coupling / self.gear_ratio[:, None]

    def gear_speed(self, angles: ArrayLike) -> Array:
        """Convert angles, speeds or accelerations of the joints to outputs of gears, (..., n)."""
        return np.asarray(angles, dtype=float) @ self.gear_coupling.T

    def gear_torque(self, torque: ArrayLike) -> Array:
        """Convert torques of the joints to outputs of gears [N m], shape (..., n)."""
        return np.asarray(torque, dtype=float) @ np.linalg.inv(self.gear_coupling)

    def of_motors(self, angles: ArrayLike) -> Array:
        """Convert angles, speeds or accelerations from joint side to motor side, shape (..., n)."""
        return np.asarray(angles, dtype=float) @ self.coupling.T

    def of_joints(self, angles: ArrayLike) -> Array:
        """Convert angles, speeds or accelerations from motor side to joint side, shape (..., n)."""
        return np.asarray(angles, dtype=float) @ np.linalg.inv(self.coupling).T

    def motor_torque(self, torque: ArrayLike) -> Array:
        """Convert torques [N m] from joint side to motor side, shape (..., n)."""
        return np.asarray(torque, dtype=float) @ np.linalg.inv(self.coupling)

    def joint_torque(self, torque: ArrayLike) -> Array:
        """Convert torques [N m] from motor side to joint side, shape (..., n)."""
        return np.asarray(torque, dtype=float) @ self.coupling

    @property
    def gear_speed_limit(self) -> Array:
        """No-load speed at the output of each gear [rad/s], shape (n,); inf if unknown."""
        if self.envelope is None:
            return np.full(self.n, np.inf)
        return self.envelope.n0 / self.gear_ratio

    @property
    def top_speed(self) -> Array:
        """Largest speed of a joint that turns alone [rad/s], shape (n,).

        The file allows it, and the motors that turn with the joint reach it."""
        limit, turns = self.gear_speed_limit[:, None], np.abs(self.gear_coupling)
        alone = np.divide(limit, turns, out=np.full_like(turns, np.inf), where=turns > 0)
        return np.minimum(self.velocity_limit, alone.min(axis=0))

    def speed_share(self, v: ArrayLike) -> Array:
        """Return the used share of the speed limits of each joint and its motor [-], (..., n).

        Args:
            v: joint speeds [rad/s], shape (..., n).
        """
        at_gear = np.abs(self.gear_speed(v)) / self.gear_speed_limit
        return np.maximum(np.abs(v) / self.velocity_limit, at_gear)

    def torque_range(self, v: ArrayLike, share: float = 1.0) -> tuple[Array, Array]:
        """Return the torque range at the outputs of the gears [N m], shape (..., n) each.

        `gear_torque` gives what motion takes of it.

        Args:
            v: joint speeds [rad/s], shape (..., n).
            share: usable share of the motors' torque [-].
        """
        v, limit = np.asarray(v, dtype=float), share * self.effort_limit
        if self.envelope is None:
            return np.broadcast_to(-limit, v.shape), np.broadcast_to(limit, v.shape)
        return self.envelope.range(limit, self.of_motors(v))

    def context_at_zero(self) -> Context:
        """Create a context of the plant with all joints at 0."""
        context = self.plant.CreateDefaultContext()
        self.plant.SetPositions(context, np.zeros(self.n))
        return context

    def joint(self, k: int) -> str:
        """Return number and name of the joint with index k: "joint 2 'roll'" for k = 1."""
        return f"joint {k + 1} '{self.joint_names[k]}'"

    def joint_at_zero(self, name: str) -> tuple[Array, Array]:
        """Return axis and origin [m] of a joint in the world, with all joints at 0, shape (3,)."""
        joint = cast(RevoluteJoint, self.plant.GetJointByName(name))
        pose = joint.frame_on_parent().CalcPoseInWorld(self.context_at_zero())
        return pose.rotation().matrix() @ joint.revolute_axis(), pose.translation()

    def make_plant(self) -> MultibodyPlant:
        """Copy the plant, for a diagram that owns it."""
        return cast(MultibodyPlant, self.plant.Clone())


@takes(path=a_path, hold=instance_of(str | Sequence[str]), tip=instance_of(str))
def load_robot(
    path: str | Path = DEFAULT_ROBOT, *, hold: str | Sequence[str] = (), tip: str = ""
) -> Robot:
    """Load and validate a serial robot.

    Content that Drake would silently misread, repair or ignore is refused: malformed numbers, and
    impossible masses and inertias. A link with mass 0 is accepted, and logged, if its joint moves
    other mass. Moving links of a URDF without `<inertial>`, and torque limits of 0 or none, are
    refused only by what needs them.

    >>> robot = load_robot("sdt")
    >>> robot.joint_names
    ('planetary', 'roll', 'pitch', 'yaw')
    >>> robot.motor_torque_limit.round(1)
    array([ 203.2, 3950. , 2150. , 2150. ])

    Args:
        path: an SDF or URDF file, or the short name of a shipped robot.
        hold: names of joints whose links are welded, such as those of a gripper, each with its
            position [rad, m] if it is not 0: ["finger=0.02", "wrist"], or "finger=0.02,wrist".
        tip: link that ends the chain; joints beside and beyond it are held. None by default.

    Raises:
        InputError: a wrong file; the message has the file, the link or joint, and the number.
    """
    file = find_file(path, "robot")
    root, changes, held, without = read_robot_file(file, hold, tip)
    try:
        robot = _checked_robot(file, root, without)
    except InputError as error:
        filled = fill_zeros(root) if error.problems[0].kind == parsed.STILL else []
        if not filled:
            raise
        changes += filled
        robot = _checked_robot(file, root, without)
    plant = robot.plant
    still = parsed.welded_to(plant.world_body(), plant)
    bodies = [plant.get_body(BodyIndex(k)) for k in range(plant.num_bodies())]
    moving = [body for body in bodies if body.index() not in still]
    massless = [body.name() for body in moving if body.default_mass() == 0]
    if massless:
        changes.append(f"accepted without mass: {', '.join(massless)}")
    robot = replace(robot, accepted=(*changes, *robot.accepted), held=held)
    for text in robot.accepted:
        _log_once(f"{file}: {text}")
    return robot


@cache
def _log_once(text: str) -> None:
    logging.getLogger(__name__).warning(text)


def edited(robot: Robot, edit: Callable[[ET.Element], None]) -> Robot:
    """Make another robot from the edited SDF of this one. Edits add up; no file changes.

    Args:
        robot: the robot, which does not change.
        edit: a function that changes the <sdf> element in place.

    Raises:
        InputError: the edited SDF is wrong, as in `load_robot`.
    """
    root = parse_xml(robot.sdf, robot.path)
    edit(root)
    other = _checked_robot(robot.path, root)
    return replace(
        other,
        frequency_factor=robot.frequency_factor,
        envelope=robot.envelope,
        accepted=robot.accepted,
        held=robot.held,
        lacks=(*(x for x in robot.lacks if x.kind != TORQUES), *other.lacks),
    )


def _checked_robot(file: Path, root: ET.Element, without_mass: Sequence[str] = ()) -> Robot:
    """Check an SDF, from a file or edited, and make its robot.

    Args:
        file: the file, for messages.
        root: the <sdf> element.
        without_mass: names of links without <inertial>.
    """
    corrected = check_sdf(root, file)
    zeros = zero_limits(root)
    text = ET.tostring(root, encoding="unicode")
    plant = parsed.parse(file, root)
    joints = parsed.chain_of(plant, file)
    actuators = parsed.actuators_of(plant, joints, file)
    effort_limit = np.array([a.effort_limit() for a in actuators])
    names = tuple(j.name() for j in joints)
    gear_ratio = np.array([a.default_gear_ratio() for a in actuators])
    rotor_inertia = np.array([a.default_rotor_inertia() for a in actuators])
    coupling = coupling_of(root, names, gear_ratio, file)
    coulomb, massless = (
        parsed.friction_of(root, names),
        parsed.massless(plant, joints, without_mass),
    )
    seen = motor_inertia(coupling, gear_ratio, rotor_inertia)
    parsed.replace_actuators(plant, joints, actuators, seen)
    plant.Finalize()
    parsed.check_inertias_kept(plant, root, file)
    robot = Robot(
        name=plant.GetModelInstanceName(joints[0].model_instance()),
        path=file,
        plant=plant,
        joint_names=names,
        rotor_inertia=rotor_inertia,
        gear_ratio=gear_ratio,
        coupling=coupling,
        effort_limit=effort_limit,
        velocity_limit=np.array([j.velocity_upper_limits()[0] for j in joints]),
        acceleration_limit=np.array([j.acceleration_upper_limits()[0] for j in joints]),
        position_lower=_stops([j.position_lower_limits()[0] for j in joints]),
        position_upper=_stops([j.position_upper_limits()[0] for j in joints]),
        damping=np.array([j.default_damping_vector()[0] for j in joints]),
        coulomb=coulomb,
        sdf=text,
        accepted=(*corrected, *told_zeros(zeros), *in_words(coupling, names)),
        lacks=lacks_of(file, massless, names, effort_limit, zeros["velocity"]),
    )  # fmt: skip
    if not massless:
        parsed.check_dynamics(robot.mass_matrix(plant.CreateDefaultContext()), names, file)
    return robot


def _stops(limits: Sequence[float]) -> Array:
    """Convert position limits [rad]: ±1e16, which many SDF files contain, means unlimited."""
    stops = np.array(limits)
    return np.where(np.abs(stops) < _NO_STOP, stops, np.copysign(np.inf, stops))
