"""The first files of a robot of one's own: what its file tells, and what has to be assumed."""

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

_OMEGA_R = 62.8  # rad/s, assumed
_RATED, _NO_LOAD = 0.6, 1.5  # of the peak torque, of the speed up to which there is all of it
_ROTOR, _MOTOR = 0.02, 0.05  # of the inertia of the joint, of the mass of the link; assumed
_WEAKER, _STRONGER = 0.7, 1.4
_CHOSEN = 3  # joints with motors to choose from: every combination is run
_MOST_MB = 100
_LEAST_MASS = 0.01  # kg, of a motor on a link without mass
_PERIOD = 0.005  # s
_SPEED, _TORQUE, _LARGEST = 0.4, 0.7, 30.0  # of a first motion: shares of the limits, deg
_LEAST = 0.5  # deg; less is no motion


@dataclass(frozen=True)
class FirstMotion:
    """Each joint goes a way and back, all at once, from rest to rest.

    Attributes:
        start: angles [deg].
        to: angles of the other end [deg].
        duration: of a way [s].
    """

    start: list[float]
    to: list[float]
    duration: float

    @property
    def lasts(self) -> float:
        """Whole time, with a second of rest at the ends and between [s]."""
        return round(2 * self.duration + 3, 3)

    def tracks(self, robot: Robot) -> str:
        """As in the file of a motion."""
        back = round(self.duration + 2, 3)
        return "\n".join(
            f"  - joint: {json.dumps(name)}\n    segments:\n"
            f"      - !Turn {{at: 1, to_deg: {to:g}, duration: {self.duration:g}}}\n"
            f"      - !Turn {{at: {back:g}, to_deg: {start:g}, duration: {self.duration:g}}}"
            for name, start, to in zip(robot.joint_names, self.start, self.to, strict=True)
        )


def first_motion(robot: Robot) -> FirstMotion:
    """Find a motion within stops, speeds and torques.

    It gets slower until it is within 70 % of each torque, and shorter where gravity alone takes
    more.

    Raises:
        InputError: if a joint cannot be held where the motion begins.
    """
    start, room = _middle(robot)
    way = np.sign(room) * np.minimum(np.abs(room) * _SPEED, _LARGEST)
    duration = float(np.max(np.abs(np.radians(way)) * 2 / (_SPEED * robot.velocity_limit)))
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
        if share <= max(_TORQUE, 1.02 * held.max()):
            return found
        ends = [_gravity(robot, np.radians(start + x * way)).max() for x in (0.25, 0.5, 0.75, 1)]
        if max(ends) > _TORQUE and np.abs(way).max() > _LEAST:
            way /= 2
        else:
            duration *= 1.3


def _middle(robot: Robot) -> tuple[Array, Array]:
    """Where joints start, and the room to the farther stop from there [deg], shape (n,) each."""
    low, high = np.degrees(robot.position_lower), np.degrees(robot.position_upper)
    edge = 0.1 * np.nan_to_num(high - low, posinf=0.0)
    start = np.clip(0.0, low + edge, high - edge).round()
    room = np.where(high - start >= start - low, high - start, low - start)
    return start, np.where(np.isfinite(room), room, 360.0)


def _gravity(robot: Robot, q: Array) -> Array:
    """Share of each torque that gravity takes at rest [-], shape (n,)."""
    rest = np.zeros(robot.n)
    held = robot.motor_torque(torque_groups(robot, q, rest, rest).gravity) * robot.gear_ratio
    share: Array = np.abs(held) / robot.effort_limit
    return share


def _largest_share(robot: Robot, motion: FirstMotion) -> float:
    """Of all limits of a robot but its stops, that a motion takes."""
    with TemporaryDirectory() as folder:
        file = write_text(Path(folder) / "motion.yaml", _motion_text(robot, motion))
        share = margins(robot, load_commanded(file, robot, _PERIOD)).share
    return max(float(values.max()) for name, values in share.items() if name != "position")


# --- files ---------------------------------------------------------------------------------------


def write_own(robot: Robot, folder: Path, place: Path) -> list[str]:
    """Write a robot's file and those that run it into a folder; their names.

    Args:
        robot: as it is in its file.
        folder: to write to.
        place: where that folder will be; meshes are named from there.

    Raises:
        InputError: as `first_motion`, or for a file that cannot be written.
    """
    names, motion = robot.joint_names, first_motion(robot)
    mass = _motor_masses(robot)
    chosen = sorted(np.argsort(-robot.effort_limit)[:_CHOSEN].tolist())
    motors = _motors(robot, np.where(mass > 0, mass, _LEAST_MASS))
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
            f"  - {{increments: 1048576, rated_torque: {_RATED * peak:.5g}, "
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


_SCALES = (_WEAKER, 1.0, _STRONGER)


def _filled(name: str, values: dict[str, str]) -> str:
    return Template((TEMPLATES / name).read_text(encoding="utf-8")).substitute(values)


def _motion_text(robot: Robot, motion: FirstMotion) -> str:
    values = {
        "name": robot.name,
        "speed": f"{100 * _SPEED:g}",
        "torque": f"{100 * _TORQUE:g}",
        "duration": f"{motion.lasts:g}",
        "start": json.dumps(motion.start),
        "tracks": motion.tracks(robot),
    }
    return _filled("motion.yaml", values)


def _robot_text(robot: Robot, place: Path) -> str:
    """The file of the robot, its meshes named from another folder."""
    text = read_text(robot.path, _MOST_MB * 1_000_000)
    for uri, path in mesh_files(robot).items():
        other = os.path.relpath(path, place.resolve())
        text = text.replace(f'"{uri}"', f'"{other}"').replace(f">{uri}<", f">{other}<")
    return text


def _scaled(name: str, scale: float) -> str:
    return name if scale == 1 else f"{name}-{scale:g}"


def _usual_speed(robot: Robot) -> Array:
    return np.where(np.isfinite(robot.velocity_limit), robot.velocity_limit, 1.0)


def _motor_masses(robot: Robot) -> Array:
    """Shares of the links that carry the motors [kg], shape (n,); 0 on links without mass."""
    plant, masses = robot.plant, []
    still = {body.index() for body in plant.GetBodiesWeldedTo(plant.world_body())}
    for joint in map(plant.GetJointByName, robot.joint_names):
        carrier, moved = joint.parent_body(), plant.GetBodiesWeldedTo(joint.child_body())
        bodies = moved if carrier.index() in still else [carrier]
        masses.append(_MOTOR * sum(body.default_mass() for body in bodies))
    return np.array(masses)


def _motors(robot: Robot, mass: Array) -> list[list[str]]:
    """Lines of the motors of each joint."""
    M = robot.plant.CalcMassMatrix(robot.context_at_zero())
    ratio = robot.gear_ratio
    rotor = np.where(robot.rotor_inertia > 0, robot.rotor_inertia, _ROTOR * np.diag(M) / ratio**2)
    rpm = robot.velocity_limit * ratio * 60 / (2 * pi)
    lines = []
    for k, name in enumerate(robot.joint_names):
        speeds = f"n1_rpm: {rpm[k]:.5g}, n0_rpm: {_NO_LOAD * rpm[k]:.5g}, "
        kind = "torque motor" if ratio[k] == 1 else f"geared motor, gear_ratio: {ratio[k]:.6g}"
        lines.append([
            f"  - {{id: {json.dumps(_scaled(name, x))}, kind: {kind}, "
            f"peak_torque: {x * robot.motor_torque_limit[k]:.6g}, "
            f"rated_torque: {x * _RATED * robot.motor_torque_limit[k]:.5g},\n"
            f"     rotor_inertia: {x * rotor[k]:.4g}, {speeds * bool(np.isfinite(rpm[k]))}"
            f"mass: {x * mass[k]:.4g},\n     thermal_time_constant: 600, "
            f"source: {json.dumps(f'assumed around {robot.path.name}')}}}"
            for x in _SCALES
        ])  # fmt: skip
    return lines
