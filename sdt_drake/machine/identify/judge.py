"""Validation of a robot by recordings, without any fit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError
from sdt_drake.io.fields import check_joints
from sdt_drake.io.shown import Shown, Summary, of_joints
from sdt_drake.io.yaml_files import load_yaml
from sdt_drake.machine.diagnose.finding import Finding
from sdt_drake.machine.diagnose.recording import check_recording
from sdt_drake.machine.identify.base_parameters import Unknown
from sdt_drake.machine.identify.cutoff import CUTOFFS, chosen
from sdt_drake.machine.identify.equations import equations
from sdt_drake.machine.identify.friction import COULOMB, OFFSET, VISCOUS, FrictionLaw, Term
from sdt_drake.machine.identify.procedure import belief, few_of, parts_of
from sdt_drake.machine.recordings import Recorded
from sdt_drake.robot.device import Friction, friction_parameters
from sdt_drake.robot.robot import Robot


@dataclass(frozen=True, eq=False, repr=False)
class Judged(Shown):
    """The share of recorded torques that a robot does not explain."""

    robot: Robot
    """The robot to validate."""
    cutoff: float
    """Cut-off frequency of the compared torques [Hz]."""
    left: Array
    """Torque not explained [-]: RMS residual over RMS torque while the joint moves, shape (n,)."""
    left_without: Array
    """Torque not explained by the robot without friction [-], shape (n,)."""
    findings: tuple[Finding, ...]
    """What the recordings show by themselves."""

    def summary(self) -> Summary:
        columns = {
            "torque not explained [%]": (".2f", 100 * self.left),
            "without friction [%]": (".2f", 100 * self.left_without),
        }
        title = f"{self.robot.name}, below {self.cutoff:.3g} Hz"
        return of_joints(title, columns, self.robot.joint_names)


def load_friction(path: str | Path, robot: Robot) -> Friction:
    """Load the friction of a robot from a file such as `identify` writes.

    Raises:
        InputError: The file is bad, or has another number of joints.
    """
    friction, file = load_yaml(Friction, path)
    check_joints(friction, file, robot.n)
    return friction


def judge(
    robot: Robot,
    recordings: Sequence[Recorded],
    friction: Friction | None = None,
    cutoff: float | None = None,
) -> Judged:
    """Compare a robot's torques with recordings, without any fit.

    Args:
        robot: The robot with its links, motors and damping.
        recordings: Recordings with q and tau.
        friction: Friction of the joints, joint side; none by default.
        cutoff: Cut-off frequency of the compared torques [Hz]; by default `cutoff.chosen`.

    Raises:
        InputError: No joint moves, or a torque is constant.
    """
    parts, _ = parts_of((), recordings, 1.0)
    nothing = Unknown.nothing()
    stretches = [stretch for *_, stretch in few_of(parts, CUTOFFS[-1])]
    cutoff = chosen(robot, nothing, belief(robot, nothing), stretches, cutoff).cutoff
    own = friction_parameters(friction or Friction(), robot.n)
    law = FrictionLaw("file", (VISCOUS, COULOMB, OFFSET, Term("stribeck", own.stribeck_speed)))
    eq = equations(robot, nothing, few_of(parts, cutoff), cutoff, lambda fastest: (law,))
    values = np.stack([own.viscous, own.coulomb, own.offset, own.breakaway - own.coulomb], axis=1)
    rubs = np.einsum("mkt,kt->mk", eq.friction, values)
    if not eq.moves.any():
        raise InputError(f"{recordings[0].path}: no joint moves more than the noise")
    with np.errstate(invalid="ignore"):  # a joint that never moves
        left, without = (
            np.sqrt(
                np.sum(eq.moves * (eq.tau - tau) ** 2, axis=0)
                / np.sum(eq.moves * eq.tau**2, axis=0)
            )
            for tau in (eq.nominal + rubs, eq.nominal)
        )
    checked = [one for recorded in recordings for one in check_recording(robot, recorded)]
    return Judged(robot, cutoff, left, without, tuple(checked))
