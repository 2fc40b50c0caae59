"""The first files of your own robot: values from the robot's file, and assumed values."""

import json
import os
import re
from math import pi
from pathlib import Path
from string import Template
from typing import Any
from xml.sax.saxutils import escape

import numpy as np

from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError
from sdt_drake.io.files import read_text, write_text
from sdt_drake.io.yaml_files import with_comments, with_values
from sdt_drake.motion import MotionProfile, command_of, commanded_motion, margins
from sdt_drake.motion.profile import Track
from sdt_drake.motion.segments import Turn
from sdt_drake.robot.dynamics import torque_groups
from sdt_drake.robot.held import told_held, weld
from sdt_drake.robot.lacks import PLANNING
from sdt_drake.robot.published import few
from sdt_drake.robot.robot import Robot
from sdt_drake.robot.rotors import ASSUMPTION, assumed_inertia
from sdt_drake.robot.shapes import mesh_files
from sdt_drake.robot.xml_text import edited_text

TEMPLATES = Path(__file__).with_name("own")

# Assumed values.
_OMEGA_R = 62.8  # rad/s
_RATED_TORQUE = 0.6  # share of the peak torque
_NO_LOAD_SPEED = 1.5  # share of the speed up to which the peak torque is available
_SLIDING = 0.8  # dynamic torque of a brake over its static torque, the motor's rated torque
_CLOSING_DELAY = 0.1  # s, of a brake
_DECELERATION = 0.5  # of ramps in a stop, share of what the peak torque gives
_MOTOR_MASS = 0.05  # share of the link's mass
_MIN_MOTOR_MASS = 0.01  # kg, on a link without mass

_SCALES = 0.7, 1.0, 1.4  # of a motor's size: weaker, assumed, stronger
_JOINTS_TO_SIZE = 3  # the study runs every combination of their motors
_MAX_FILE = 100_000_000  # bytes
_PERIOD = 0.005  # s
_MAX_SPEED, _MAX_TORQUE = 0.4, 0.7  # of the first motion, share of the limits
_MAX_ANGLE, _MIN_ANGLE = 30.0, 0.5  # deg, of the first motion


def first_motion(robot: Robot) -> MotionProfile:
    """Find a motion within stops, speeds and torques.

    The motion is slowed down until each torque is within 70 % of its limit. Its angles are halved
    where gravity alone takes more.

    Raises:
        InputError: if a motor cannot hold its joint at the start of the motion.
    """
    start, room = _middle(robot.having(*PLANNING))
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
        found = _turns(robot, start, (start + way).round(2), round(duration, 2))
        share = _largest_share(robot, found)
        if share <= max(_MAX_TORQUE, 1.02 * held.max()):
            return found
        ends = [_gravity(robot, np.radians(start + x * way)).max() for x in (0.25, 0.5, 0.75, 1)]
        if max(ends) > _MAX_TORQUE and np.abs(way).max() > _MIN_ANGLE:
            way /= 2
        else:
            duration *= 1.3


def _turns(robot: Robot, start: Array, to: Array, duration: float) -> MotionProfile:
    """Return the motion of all joints from rest to an angle and back, with rests of 1 s between.

    Args:
        robot: the robot.
        start: angles at the start and the end [deg], shape (n,).
        to: angles between [deg], shape (n,).
        duration: duration of each of the two turns [s].
    """
    back = round(duration + 2, 3)
    tracks = [
        Track(
            joint=name,
            segments=[
                Turn(at=1.0, to_deg=there, duration=duration),
                Turn(at=back, to_deg=here, duration=duration),
            ],
        )
        for name, here, there in zip(robot.joint_names, start.tolist(), to.tolist(), strict=True)
    ]
    lasts = round(2 * duration + 3, 3)
    return MotionProfile(duration=lasts, start_deg=start.tolist(), tracks=tracks)


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


def _largest_share(robot: Robot, motion: MotionProfile) -> float:
    """Return the largest share of any limit but the stops that a motion takes [-]."""
    share = margins(robot, commanded_motion(robot, command_of(motion, robot), _PERIOD)).share
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
    rotors = robot.gear_ratio**2 * (_rotors(robot) - robot.rotor_inertia)  # the assumed ones
    turned = np.diag(robot.mass_matrix(robot.context_at_zero())) + rotors
    slowing = _DECELERATION * robot.effort_limit / turned
    mass = _motor_masses(robot)
    speeds = np.where(np.isfinite(robot.velocity_limit), robot.velocity_limit, 1.0)
    chosen = sorted(np.argsort(-robot.effort_limit)[:_JOINTS_TO_SIZE].tolist())
    fitted = [name * bool(m) for name, m in zip(names, mass, strict=True)]
    words = {
        "name": robot.name,
        "robot": robot.path.name,
        "joints": ", ".join(names),
        "motors": _motors_line(robot),
        "assumption": ASSUMPTION,
        **_friction_words(robot),
        "sets": f"{len(_SCALES) ** len(chosen)}",
        "example": ", ".join(f"{name}.position" for name in names),
        "speed": f"{100 * _MAX_SPEED:g}",
        "torque": f"{100 * _MAX_TORQUE:g}",
    }
    values: dict[str, dict[str, Any]] = {
        "acceptance.yaml": {"pose_deg": motion.start_deg},
        "drives.yaml": {"axes": [*map(_axis, robot.motor_torque_limit)]},
        "motion.yaml": {
            "title": f"First motion of {robot.name}",
            "duration": motion.duration,
            "start_deg": motion.start_deg,
            "tracks": motion.tracks,
        },
        "motors.yaml": {"motors": _motors(robot, np.where(mass > 0, mass, _MIN_MOTOR_MASS))},
        "scenario.yaml": {
            "robot": robot.path.name, "device.fitted": fitted, "controller.omega_r": _OMEGA_R,
        },
        "sizing.yaml": {
            "device.fitted": fitted,
            "motors": [
                [_scaled(name, x) for x in _SCALES] if k in chosen else [name]
                for k, name in enumerate(names)
            ],
            "requirements.max_abs_speed_error": [_digits(0.05 * v, 2) for v in speeds],
        },
        "stops.yaml": {
            "deceleration": [_digits(x, 2) for x in slowing.tolist()], "motors": [*names],
        },
    }  # fmt: skip
    write_text(folder / robot.path.name, _robot_text(robot, place))
    files = [path.name for path in sorted(TEMPLATES.iterdir())]
    for name in files:
        text = Template((TEMPLATES / name).read_text(encoding="utf-8")).substitute(words)
        text = with_values(text, values.get(name, {}))
        if name == "drives.yaml":
            text = with_comments(text, {f"axes[{k + 1}]": names[k] for k in range(robot.n)})
        write_text(folder / name, text)
    return sorted([robot.path.name, *files])


def notes_of(robot: Robot) -> list[str]:
    """Return what the files assume or take over beside limits, as sentences."""
    lacking = [robot.joint(k) for k in np.flatnonzero(robot.motor_inertia == 0).tolist()]
    file, notes = robot.path.name, list[str]()
    if lacking:
        notes.append(
            f"{file} has no rotor inertia of {few(lacking)}; motors.yaml has ASSUMED ones, which "
            f"scenario.yaml uses, such that {ASSUMPTION}"
        )
    if robot.coulomb.any():
        notes.append(f"plant.friction.coulomb in scenario.yaml is the <friction> of {file}")
    return [*notes, *told_held(robot.held)]


def _axis(peak: float) -> dict[str, Any]:
    """Return the data of a drive by the peak torque of its motor [N m]."""
    rated, largest = _digits(_RATED_TORQUE * peak, 5), _digits(peak, 5)
    return {"increments": 1048576, "rated_torque": rated, "maximum_torque": largest}


def _digits(value: float, count: int) -> float:
    return float(f"{value:.{count}g}")


def _robot_text(robot: Robot, place: Path) -> str:
    """Return the text of the robot's file, with paths of meshes that start at `place`.

    Held joints are fixed in it.
    """
    text = read_text(robot.path, _MAX_FILE)
    if robot.held:
        text = edited_text(text, lambda root: weld(root, robot.held, robot.path))
    for uri, path in mesh_files(robot).items():
        other = os.path.relpath(path, place.resolve()).replace("%", "%25")
        other = escape(other, {"'": "&apos;", '"': "&quot;"}).replace("\\", r"\\")
        for own in {uri, escape(uri)}:  # as a name in XML
            text = re.sub(rf"([\"'>]\s*){re.escape(own)}(?=\s*[\"'<])", rf"\g<1>{other}", text)
    return text


def _scaled(name: str, scale: float) -> str:
    return name if scale == 1 else f"{name}-{scale:g}"


def _motor_masses(robot: Robot) -> Array:
    """Return the assumed masses of motors [kg], shape (n,); 0 on links without mass."""
    plant, masses = robot.plant, []
    still = {body.index() for body in plant.GetBodiesWeldedTo(plant.world_body())}
    for joint in map(plant.GetJointByName, robot.joint_names):
        carrier, moved = joint.parent_body(), plant.GetBodiesWeldedTo(joint.child_body())
        bodies = moved if carrier.index() in still else [carrier]
        masses.append(_MOTOR_MASS * sum(body.default_mass() for body in bodies))
    return np.array(masses)


def _rotors(robot: Robot) -> Array:
    """Return the rotor inertias, assumed where missing, motor side [kg m²], shape (n,)."""
    assumed = assumed_inertia(robot) / robot.gear_ratio**2
    return np.where(robot.motor_inertia > 0, robot.rotor_inertia, assumed)


def _motors_line(robot: Robot) -> str:
    """Return the line with the motors of a scenario: those whose rotors the robot's file lacks."""
    lacking = robot.motor_inertia == 0
    names = [name * bool(x) for name, x in zip(robot.joint_names, lacking, strict=True)]
    if lacking.any():
        why = f"with ASSUMED rotor inertias, which {robot.path.name} lacks; '' keeps its own"
        return f"motors: {json.dumps(names, ensure_ascii=False)}  # of motors.yaml, {why}"
    return f"# motors: {json.dumps(names)}  # other motors of motors.yaml; '' keeps the fitted one"


def _friction_words(robot: Robot) -> dict[str, str]:
    """Return the friction of the file as lines of a scenario, comments if it has none."""
    has = bool(robot.coulomb.any())
    zeros = json.dumps([0] * robot.n)
    return {
        "friction": "" if has else "# ",
        "coulomb": json.dumps(robot.coulomb.tolist()) if has else zeros,
        "zeros": zeros,
    }


def _motors(robot: Robot, mass: Array) -> list[dict[str, Any]]:
    """Return the motors of all joints, of each size, as in a file of motors."""
    ratio, rotor = robot.gear_ratio, _rotors(robot)
    rpm = robot.velocity_limit * ratio * 60 / (2 * pi)
    motors = []
    for k, name in enumerate(robot.joint_names):
        peak = robot.motor_torque_limit[k]
        for x in _SCALES:
            motor: dict[str, Any] = {"id": _scaled(name, x), "kind": "torque motor"}
            if ratio[k] != 1:
                motor |= {"kind": "geared motor", "gear_ratio": _digits(ratio[k], 6)}
            motor["peak_torque"] = _digits(x * peak, 6)
            motor["rated_torque"] = _digits(x * _RATED_TORQUE * peak, 5)
            motor["rotor_inertia"] = _digits(x * rotor[k], 4)
            if np.isfinite(rpm[k]):
                motor["n1_rpm"] = _digits(rpm[k], 5)
                motor["n0_rpm"] = _digits(_NO_LOAD_SPEED * rpm[k], 5)
            motor["mass"] = _digits(x * mass[k], 4)
            motor["thermal_time_constant"] = 600
            motor["brake"] = {
                "static_torque": motor["rated_torque"],
                "dynamic_torque": _digits(_SLIDING * motor["rated_torque"], 5),
                "closing_delay": _CLOSING_DELAY,
                "source": "assumed: the motor's rated torque",
            }
            motor["source"] = f"assumed around {robot.path.name}"
            motors.append(motor)
    return motors
