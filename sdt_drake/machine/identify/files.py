"""The files of an identified robot: SDF, friction, a scenario and a study that use them."""

from pathlib import Path
from typing import Any

import numpy as np

from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError
from sdt_drake.io.files import write_text
from sdt_drake.io.tables import write_table
from sdt_drake.io.yaml_files import parse_yaml, with_values, write_yaml
from sdt_drake.machine.identify.filtering import ABOVE, Smooth, smooth, stretches
from sdt_drake.machine.identify.model import directions, save_robot
from sdt_drake.machine.identify.plant import PlantFriction
from sdt_drake.machine.identify.procedure import Identified
from sdt_drake.motion import Motion
from sdt_drake.motion.trajectory import interpolated
from sdt_drake.robot.deviation import Deviation
from sdt_drake.robot.dynamics import inverse_dynamics
from sdt_drake.robot.robot import DEFAULT_ROBOT, Robot, load_robot
from sdt_drake.robot.urdf_text import urdf_with
from sdt_drake.run.controllers import PPi
from sdt_drake.run.scenario import Scenario, load_scenario, robot_of, save_scenario

_MOTION = "motion.csv"  # the recorded motion, once it is written
_OWN = "real_device"  # scenario of the shipped device with real drives and sensors
_MARGIN = 0.9  # share of the limits that a motion uses; of torque, after gravity
_MAX_STANDING = 0.98  # share of the largest torque that a motor may need at standstill
_OMEGA_R = 60.0  # assumed lowest natural frequency of other robots [rad/s]

FILES = (
    *("robot.sdf", "robot.urdf", "motion.csv", "friction.yaml", "scenario.yaml"),
    *("uncertainty.csv", "uncertain.yaml", "uncertainty.yaml"),
)
"""Names of the files that `write_files` writes; not every robot needs all of them."""


def base_scenario(robot: Robot, base: str | None = None) -> Scenario:
    """Return the scenario with the motion, drives and controller for the identified robot.

    Args:
        robot: The recorded robot.
        base: Name or file of a scenario of that robot. The default for the shipped robot is a
            shipped scenario; for others, a cascade with feedforward and the recorded motion.

    Raises:
        InputError: The scenario is bad, or its robot has other joints.
    """
    if base is None and robot.joint_names == load_robot(DEFAULT_ROBOT).joint_names:
        base = _OWN
    if base is not None:
        scenario = load_scenario(base)
        names = robot_of(scenario).joint_names
        if names != robot.joint_names:
            raise InputError(
                f"{base}: its robot has joints {', '.join(names)}, expected "
                f"{', '.join(robot.joint_names)} as in {robot.path}",
                place="scenario",
            )
        return scenario
    controller = PPi(omega_r=_OMEGA_R, feedforward="id")
    return Scenario(motion=_MOTION, controller=controller)


def write_files(
    found: Identified, robot: Robot, friction: PlantFriction, scenario: Scenario, folder: Path
) -> list[str]:
    """Write the identified robot, and a scenario and a study that use it, into a folder.

    Args:
        found: The identification.
        robot: The identified robot.
        friction: Friction of the identified robot.
        scenario: A `base_scenario`.
        folder: An existing folder.

    Returns:
        Changes of the recorded motion, as sentences.
    """
    notes = list[str]()
    changes: dict[str, Any] = {
        "name": "identified",
        "robot": "robot.sdf",
        "hold": (),
        "tip": "",
        "plant.kind": "coupled",
        "plant.i_eff": None,
        "plant.friction": friction.friction,
        "plant.deviation": Deviation(),
        "controller.model": Deviation(),
    }
    save_robot(found, folder / "robot.sdf")
    if robot.path.suffix.lower() == ".urdf":
        write_text(folder / "robot.urdf", urdf_with(robot, found.nominal))
    if scenario.motion == _MOTION:
        motion, notes = recorded_motion(found, robot, scenario.period)
        motion.to_csv(folder / _MOTION)
        changes["controller.friction_compensation"] = True
    write_yaml(folder / "friction.yaml", friction.friction)
    scenario = scenario.changed(changes)
    save_scenario(scenario, folder / "scenario.yaml")
    _write_study(found, robot, friction, scenario, folder)
    return notes


def recorded_motion(found: Identified, robot: Robot, period: float) -> tuple[Motion, list[str]]:
    """Return the longest stretch of the first recording as a motion at `period` [s].

    It is as smooth as the compared torques, and slowed down to the limits of the robot.

    Returns:
        The motion, and its changes as sentences.
    """
    longest = max(stretches(found.recordings[0])[0], key=lambda part: len(part.q) * part.period)
    recorded = smooth(longest, found.cutoff / ABOVE)
    slower, standing = _slower(robot, recorded)
    stuck = standing > _MAX_STANDING * robot.effort_limit
    notes = [
        f"motion.csv: {robot.joint(k)} needs {standing[k]:.4g} N m at standstill in the recorded "
        f"positions, expected less than the limit of {robot.effort_limit[k]:.4g} N m in the "
        "robot's file; raise <effort>, or simulate will refuse this motion"
        for k in np.flatnonzero(stuck).tolist()
    ]
    if notes:
        slower = 1.0
    elif slower > 1:
        notes = [
            f"motion.csv: the recorded motion, {slower:.3g} times slower to keep the limits of the "
            "robot's file"
        ]
    time = np.arange(recorded.time[0], recorded.time[-1], period / slower)
    v = interpolated(time, recorded.time, recorded.v) / slower
    return Motion.from_speeds(period, recorded.q[0], v), notes


def _slower(robot: Robot, motion: Smooth) -> tuple[float, Array]:
    """Return the factor s by which a motion has to be slower to keep the robot's limits.

    Then speeds are v / s. Torques are those at standstill plus the rest over s².

    Returns:
        The factor, and the largest torque at standstill, at the gears [N m], shape (n,).
    """
    rest = np.zeros_like(motion.q)
    standing = robot.gear_torque(inverse_dynamics(robot, motion.q, rest, rest))
    whole = robot.gear_torque(inverse_dynamics(robot, motion.q, motion.v, motion.vd))
    moving = whole - standing
    left = robot.effort_limit - np.sign(moving) * standing
    uses = [
        robot.speed_share(motion.v) ** 2,
        np.abs(motion.vd) / robot.acceleration_limit,
        np.abs(moving) / np.maximum(left, 1e-9),
    ]
    slower = float(np.sqrt(np.max(uses) / _MARGIN))
    return max(1.0, slower), np.abs(standing).max(axis=0)


def _write_study(
    found: Identified, robot: Robot, friction: PlantFriction, scenario: Scenario, folder: Path
) -> None:
    """Write a study in which links and friction vary by their standard deviations."""
    base = "scenario.yaml"
    along = directions(found, robot)
    if len(along):
        write_table(
            folder / "uncertainty.csv", np.arange(1.0, len(along) + 1), {"entry": along},
            first="direction",
        )  # fmt: skip
        # Only the scenario of the study has the directions; with all at 0, it is the same robot.
        spread = Deviation(spread="uncertainty.csv", along=(0.0,) * len(along))
        changes = {"name": "uncertain", "plant.deviation": spread}
        save_scenario(scenario.changed(changes), folder / "uncertain.yaml")
        base = "uncertain.yaml"
    variables: list[dict[str, Any]] = [
        {
            "name": f"links_{k + 1}",
            "fields": [f"plant.deviation.along[{k + 1}]"],
            "distribution": _normal(0, 1, -4, 4),
        }
        for k in range(len(along))
    ]
    laws = {"coulomb": friction.friction.coulomb, "viscous": friction.friction.viscous}
    for (name, values), std in zip(laws.items(), friction.std, strict=True):
        for k, value in enumerate(values or []):
            share = min(std[k] / value, 1.0) if value > 0 else 0.0
            if share > 1e-6:
                fields = [f"plant.friction.{name}[{k + 1}]"]
                if name == "coulomb" and friction.friction.breakaway:
                    fields.append(f"plant.friction.breakaway[{k + 1}]")
                factor = _normal(1, float(f"{share:.4g}"), 0, 3)
                variables.append({
                    "name": f"{name}_{k + 1}",
                    "fields": fields,
                    "apply": "factor",
                    "distribution": factor,
                })  # fmt: skip
    text = Path(__file__).with_name("uncertainty.yaml").read_text(encoding="utf-8")
    controllers, *_ = parse_yaml(text)["variables"]
    text = with_values(text, {"scenario": base, "variables": [controllers, *variables]})
    write_text(folder / "uncertainty.yaml", text)


def _normal(mean: float, std: float, low: float, high: float) -> dict[str, Any]:
    return {"_tag": "!Normal", "mean": mean, "std": std, "low": low, "high": high}
