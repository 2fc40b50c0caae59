"""The first files of your own robot: values from the robot's file, and assumed values."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from math import pi
from pathlib import Path
from string import Template
from tempfile import TemporaryDirectory

import numpy as np

from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError
from sdt_drake.io.files import read_text, write_text
from sdt_drake.motion import load_commanded, margins
from sdt_drake.robot.dynamics import torque_groups
from sdt_drake.robot.robot import Robot
from sdt_drake.robot.shapes import mesh_files

TEMPLATES = Path(__file__).with_name("own")

# Assumed values.
_OMEGA_R = 62.8  # rad/s
_RATED_TORQUE = 0.6  # share of the peak torque
_NO_LOAD_SPEED = 1.5  # share of the speed up to which the peak torque is available
_ROTOR_INERTIA = 0.02  # share of the joint's inertia
_MOTOR_MASS = 0.05  # share of the link's mass
_MIN_MOTOR_MASS = 0.01  # kg, on a link without mass

_SCALES = 0.7, 1.0, 1.4  # of a motor's size: weaker, assumed, stronger
_JOINTS_TO_SIZE = 3  # the study runs every combination of their motors
_MAX_FILE = 100_000_000  # bytes
_PERIOD = 0.005  # s
_MAX_SPEED, _MAX_TORQUE = 0.4, 0.7  # of the first motion, share of the limits
_MAX_ANGLE, _MIN_ANGLE = 30.0, 0.5  # deg, of the first motion


@dataclass(frozen=True)
class FirstMotion:
    """The first motion of a robot: all joints turn to an angle and back, from rest to rest."""

    start: list[float]
    """Angles at the start and the end [deg], shape (n,)."""
    to: list[float]
    """Angles between [deg], shape (n,)."""
    duration: float
    """Duration of each of the two turns [s]."""

    @property
    def lasts(self) -> float:
        """The whole duration, with one second of rest at both ends and between [s]."""
        return round(2 * self.duration + 3, 3)

    def tracks(self, robot: Robot) -> str:
        """Return the tracks as YAML text of a motion profile."""
        back = round(self.duration + 2, 3)
        return "\n".join(
            f"  - joint: {json.dumps(name)}\n    segments:\n"
            f"      - !Turn {{at: 1, to_deg: {to:g}, duration: {self.duration:g}}}\n"
            f"      - !Turn {{at: {back:g}, to_deg: {start:g}, duration: {self.duration:g}}}"
            for name, start, to in zip(robot.joint_names, self.start, self.to, strict=True)
        )


def first_motion(robot: Robot) -> FirstMotion:
    """Find a motion within stops, speeds and torques.

    The motion is slowed down until each torque is within 70 % of its limit. Its angles are halved
    where gravity alone takes more.

    Raises:
        InputError: if a motor cannot hold its joint at the start of the motion.
    """
    start, room = _middle(robot)
    way = np.sign(room) * np.minimum(np.abs(room) * _MAX_SPEED, _MAX_ANGLE)
    duration = float(np.max(np.abs(np.radians(way)) * 2 / (_MAX_SPEED * robot.velocity_limit)))
    duration = max(1.0, np.ceil(10 * duration) / 10)
    held = _gravity(robot, np.radians(start))
    for k in np.flatnonzero(held > 0.95).tolist():
        raise InputError(
            f"{robot.path}: {robot.joint(k)}: gravity takes {held[k] * robot.effort_limit[k]:.4g} "
            f"N m at {start[k]:g} deg, its <effort> is {robot.effort_limit[k]:g}"
        )
    while True:
        found = FirstMotion(start.tolist(), (start + way).round(2).tolist(), round(duration, 2))
        share = _largest_share(robot, found)
        if share <= max(_MAX_TORQUE, 1.02 * held.max()):
            return found
        ends = [_gravity(robot, np.radians(start + x * way)).max() for x in (0.25, 0.5, 0.75, 1)]
        if max(ends) > _MAX_TORQUE and np.abs(way).max() > _MIN_ANGLE:
            way /= 2
        else:
            duration *= 1.3


def _middle(robot: Robot) -> tuple[Array, Array]:
    """Return the joints' start angles and the room to the farther stop [deg], shape (n,) each."""
    low, high = np.degrees(robot.position_lower), np.degrees(robot.position_upper)
    edge = 0.1 * np.nan_to_num(high - low, posinf=0.0)
    start = np.clip(0.0, low + edge, high - edge).round()
    room = np.where(high - start >= start - low, high - start, low - start)
    return start, np.where(np.isfinite(room), room, 360.0)


def _gravity(robot: Robot, q: Array) -> Array:
    """Return the share of each torque limit that gravity takes at rest [-], shape (n,)."""
    rest = np.zeros(robot.n)
    held = robot.gear_torque(torque_groups(robot, q, rest, rest).gravity)
    share: Array = np.abs(held) / robot.effort_limit
    return share


def _largest_share(robot: Robot, motion: FirstMotion) -> float:
    """Return the largest share of any limit but the stops that a motion takes [-]."""
    with TemporaryDirectory() as folder:
        file = write_text(Path(folder) / "motion.yaml", _motion_text(robot, motion))
        share = margins(robot, load_commanded(file, robot, _PERIOD)).share
    return max(float(values.max()) for name, values in share.items() if name != "position")


# --- files ---------------------------------------------------------------------------------------


def write_own(robot: Robot, folder: Path, place: Path) -> list[str]:
    """Write the robot's file and all files to run it into a folder, and return their names.

    Args:
        robot: the robot, loaded from its file.
        folder: folder to write to.
        place: final place of that folder; paths of meshes start there.

    Raises:
        InputError: if a motor cannot hold its joint, or a file cannot be written.
    """
    names, motion = robot.joint_names, first_motion(robot)
    mass = _motor_masses(robot)
    chosen = sorted(np.argsort(-robot.effort_limit)[:_JOINTS_TO_SIZE].tolist())
    motors = _motors(robot, np.where(mass > 0, mass, _MIN_MOTOR_MASS))
    values = {
        "name": robot.name,
        "robot": robot.path.name,
        "joints": ", ".join(robot.joint_names),
        "omega_r": f"{_OMEGA_R:g}",
        "fitted": json.dumps([x * bool(m) for x, m in zip(names, mass, strict=True)]),
        "kept": json.dumps([""] * robot.n),
        "zeros": json.dumps([0] * robot.n),
        "motors": "\n".join(line for each in motors for line in each),
        "axes": "\n".join(
            f"  - {{increments: 1048576, rated_torque: {_RATED_TORQUE * peak:.5g}, "
            f"maximum_torque: {peak:.5g}}}  # {name}"
            for peak, name in zip(robot.motor_torque_limit, robot.joint_names, strict=True)
        ),
        "choices": "\n".join(
            f"  - {json.dumps([_scaled(name, x) for x in _SCALES] if k in chosen else [name])}"
            for k, name in enumerate(names)
        ),
        "sets": str(len(_SCALES) ** len(chosen)),
        "errors": json.dumps([float(f"{0.05 * v:.2g}") for v in _usual_speed(robot)]),
        "example": ", ".join(f"{name}.position" for name in robot.joint_names),
    }
    write_text(folder / robot.path.name, _robot_text(robot, place))
    write_text(folder / "motion.yaml", _motion_text(robot, motion))
    files = [name.name for name in sorted(TEMPLATES.iterdir()) if name.name != "motion.yaml"]
    for name in files:
        write_text(folder / name, _filled(name, values))
    return sorted([robot.path.name, "motion.yaml", *files])


def _filled(name: str, values: dict[str, str]) -> str:
    return Template((TEMPLATES / name).read_text(encoding="utf-8")).substitute(values)


def _motion_text(robot: Robot, motion: FirstMotion) -> str:
    values = {
        "name": robot.name,
        "speed": f"{100 * _MAX_SPEED:g}",
        "torque": f"{100 * _MAX_TORQUE:g}",
        "duration": f"{motion.lasts:g}",
        "start": json.dumps(motion.start),
        "tracks": motion.tracks(robot),
    }
    return _filled("motion.yaml", values)


def _robot_text(robot: Robot, place: Path) -> str:
    """Return the text of the robot's file, with paths of meshes that start at `place`."""
    text = read_text(robot.path, _MAX_FILE)
    for uri, path in mesh_files(robot).items():
        other = os.path.relpath(path, place.resolve())
        text = text.replace(f'"{uri}"', f'"{other}"').replace(f">{uri}<", f">{other}<")
    return text


def _scaled(name: str, scale: float) -> str:
    return name if scale == 1 else f"{name}-{scale:g}"


def _usual_speed(robot: Robot) -> Array:
    return np.where(np.isfinite(robot.velocity_limit), robot.velocity_limit, 1.0)


def _motor_masses(robot: Robot) -> Array:
    """Return the assumed masses of motors [kg], shape (n,); 0 on links without mass."""
    plant, masses = robot.plant, []
    still = {body.index() for body in plant.GetBodiesWeldedTo(plant.world_body())}
    for joint in map(plant.GetJointByName, robot.joint_names):
        carrier, moved = joint.parent_body(), plant.GetBodiesWeldedTo(joint.child_body())
        bodies = moved if carrier.index() in still else [carrier]
        masses.append(_MOTOR_MASS * sum(body.default_mass() for body in bodies))
    return np.array(masses)


def _motors(robot: Robot, mass: Array) -> list[list[str]]:
    """Return the YAML lines of each joint's motors."""
    M = robot.plant.CalcMassMatrix(robot.context_at_zero())
    ratio = robot.gear_ratio
    rotor = np.where(
        robot.rotor_inertia > 0, robot.rotor_inertia, _ROTOR_INERTIA * np.diag(M) / ratio**2
    )
    rpm = robot.velocity_limit * ratio * 60 / (2 * pi)
    lines = []
    for k, name in enumerate(robot.joint_names):
        speeds = f"n1_rpm: {rpm[k]:.5g}, n0_rpm: {_NO_LOAD_SPEED * rpm[k]:.5g}, "
        kind = "torque motor" if ratio[k] == 1 else f"geared motor, gear_ratio: {ratio[k]:.6g}"
        lines.append([
            f"  - {{id: {json.dumps(_scaled(name, x))}, kind: {kind}, "
            f"peak_torque: {x * robot.motor_torque_limit[k]:.6g}, "
            f"rated_torque: {x * _RATED_TORQUE * robot.motor_torque_limit[k]:.5g},\n"
            f"     rotor_inertia: {x * rotor[k]:.4g}, {speeds * bool(np.isfinite(rpm[k]))}"
            f"mass: {x * mass[k]:.4g},\n     thermal_time_constant: 600, "
            f"source: {json.dumps(f'assumed around {robot.path.name}')}}}"
            for x in _SCALES
        ])  # fmt: skip
    return lines
