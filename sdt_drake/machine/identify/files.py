"""The files of an identified robot: SDF, friction, a scenario and a study that use them."""

from __future__ import annotations

import copy
from pathlib import Path

import numpy as np

from sdt_drake.io.errors import InputError
from sdt_drake.io.files import write_text
from sdt_drake.io.tables import write_table
from sdt_drake.io.yaml_files import write_yaml
from sdt_drake.machine.identify.filtering import smooth, stretches
from sdt_drake.machine.identify.model import PlantFriction, directions, save_robot
from sdt_drake.machine.identify.procedure import Identified
from sdt_drake.motion import Motion
from sdt_drake.motion.trajectory import interpolated
from sdt_drake.robot.deviation import Deviation
from sdt_drake.robot.robot import DEFAULT_ROBOT, Robot, load_robot
from sdt_drake.run.scenario import Scenario, load_scenario, save_scenario

_OWN = "real_device"  # the shipped device's scenario with what a real one has
_OMEGA_R = 60.0  # rad/s, lowest natural frequency of robots of which nobody says one; assumed

FILES = (
    *("robot.sdf", "motion.csv", "friction.yaml", "scenario.yaml"),
    *("uncertainty.csv", "uncertain.yaml", "uncertainty.yaml"),
)
"""Names of the files that `write_files` writes; some robots need only a part of them."""


def base_scenario(robot: Robot, base: str | None = None) -> Scenario:
    """The scenario that the identified robot gets its motion, drives and controller from.

    Args:
        robot: that recordings are of.
        base: name or file of a scenario of that robot; by default one that ships, or, for other
            robots than the shipped one, a PI controller without a motion.

    Raises:
        InputError: for a bad scenario, or one of a robot with other joints.
    """
    if base is None and robot.joint_names == load_robot(DEFAULT_ROBOT).joint_names:
        base = _OWN
    if base is not None:
        scenario = load_scenario(base)
        names = load_robot(scenario.robot).joint_names
        if names != robot.joint_names:
            raise InputError(
                f"--scenario {base}: is of a robot with joints {', '.join(names)}, expected "
                f"{', '.join(robot.joint_names)}, as in {robot.path}"
            )
        return scenario
    scenario = Scenario(motion="")
    scenario.controller.omega_r = _OMEGA_R
    return scenario


def write_files(
    found: Identified, robot: Robot, friction: PlantFriction, scenario: Scenario, folder: Path
) -> None:
    """Write the identified robot, and a scenario and a study that use it, into a folder.

    Args:
        found: what was identified.
        robot: the identified one.
        friction: of it.
        scenario: `base_scenario`; without a motion it gets the recorded one.
        folder: to write to; it exists.
    """
    scenario = copy.deepcopy(scenario)
    save_robot(found, folder / "robot.sdf")
    scenario.robot = "robot.sdf"
    if not scenario.motion:
        scenario.motion = "motion.csv"
        recorded_motion(found, scenario.period).to_csv(folder / scenario.motion)
    write_yaml(folder / "friction.yaml", friction.friction)
    scenario.name, scenario.plant.kind = "identified", "coupled"
    scenario.plant.friction = friction.friction
    scenario.plant.deviation = scenario.controller.model = Deviation()
    save_scenario(scenario, folder / "scenario.yaml")
    _write_study(found, robot, friction, scenario, folder)


def recorded_motion(found: Identified, period: float) -> Motion:
    """The longest stretch of the first recording as a motion at `period` [s]."""
    longest = max(stretches(found.recordings[0])[0], key=lambda part: len(part.q) * part.period)
    motion = smooth(longest, found.cutoff)
    time = np.arange(motion.time[0], motion.time[-1], period)
    v = interpolated(time, motion.time, motion.v)
    return Motion.from_speeds(period, motion.q[0], v)


def _write_study(
    found: Identified, robot: Robot, friction: PlantFriction, scenario: Scenario, folder: Path
) -> None:
    text = Path(__file__).with_name("uncertainty.yaml").read_text(encoding="utf-8")
    along = directions(found, robot)
    if len(along):
        write_table(
            folder / "uncertainty.csv", np.arange(1.0, len(along) + 1), {"entry": along},
            first="direction",
        )  # fmt: skip
        # The directions are in the scenario of the study alone, which is the identified robot
        # itself.
        spread = copy.deepcopy(scenario)
        spread.name = "uncertain"
        spread.plant.deviation = Deviation(spread="uncertainty.csv", along=[0.0] * len(along))
        save_scenario(spread, folder / "uncertain.yaml")
        text = text.replace("scenario: scenario.yaml", "scenario: uncertain.yaml")
    for k in range(len(along)):
        text += (
            f'  - name: links_{k + 1}\n    fields: ["plant.deviation.along[{k + 1}]"]\n'
            "    distribution: !Normal {mean: 0, std: 1, low: -4, high: 4}\n"
        )
    laws = {"coulomb": friction.friction.coulomb, "viscous": friction.friction.viscous}
    for (name, values), std in zip(laws.items(), friction.std, strict=True):
        for k, value in enumerate(values or []):
            share = min(std[k] / value, 1.0) if value > 0 else 0.0
            if share > 1e-6:
                fields = [f'"plant.friction.{name}[{k + 1}]"']
                if name == "coulomb" and friction.friction.breakaway:
                    fields.append(f'"plant.friction.breakaway[{k + 1}]"')
                text += (
                    f"  - name: {name}_{k + 1}\n    fields: [{', '.join(fields)}]\n"
                    "    apply: factor\n"
                    f"    distribution: !Normal {{mean: 1, std: {share:.4g}, low: 0, high: 3}}\n"
                )
    write_text(folder / "uncertainty.yaml", text)
