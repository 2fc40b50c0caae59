"""A robot judged by recordings as it is: what links, motors and friction leave of the torques."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError
from sdt_drake.io.shown import Shown, Summary, of_joints
from sdt_drake.io.yaml_files import load_yaml
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
    """What a robot leaves of recorded torques.

    Attributes:
        robot: that is judged.
        cutoff: below which torques are compared [Hz].
        left: RMS of what is left where a joint moves, over the RMS of its torque, shape (n,).
        left_without: the same without friction.
    """

    robot: Robot
    cutoff: float
    left: Array
    left_without: Array

    def summary(self) -> Summary:
        columns = {
            "torque not explained [%]": (".2f", 100 * self.left),
            "without friction [%]": (".2f", 100 * self.left_without),
        }
        title = f"{self.robot.name}, below {self.cutoff:.3g} Hz"
        return of_joints(title, columns, self.robot.joint_names)


def load_friction(path: str | Path, robot: Robot) -> Friction:
    """The friction of a robot in a file such as `identify` writes.

    Raises:
        InputError: for a bad file, or one of another number of joints.
    """
    friction, file = load_yaml(Friction, path)
    for name in ("coulomb", "viscous", "breakaway", "offset"):
        values = getattr(friction, name)
        if values is not None and len(values) != robot.n:
            raise InputError(
                f"{file}: {name}: {len(values)} value(s), but the robot has {robot.n} joint(s)"
            )
    return friction


def judge(
    robot: Robot,
    recordings: Sequence[Recorded],
    friction: Friction | None = None,
    cutoff: float | None = None,
) -> Judged:
    """Judge a robot by recordings, of which nothing is fitted.

    Args:
        robot: with its links, motors and damping.
        recordings: with q and tau.
        friction: of its joints, joint side; none by default.
        cutoff: below which torques are compared [Hz]; by default `cutoff.chosen`.

    Raises:
        InputError: for recordings that say nothing.
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
        raise InputError(f"{recordings[0].path}: no joint moves, but for noise")
    with np.errstate(invalid="ignore"):  # a joint that never moves
        left, without = (
            np.sqrt(
                np.sum(eq.moves * (eq.tau - tau) ** 2, axis=0)
                / np.sum(eq.moves * eq.tau**2, axis=0)
            )
            for tau in (eq.nominal + rubs, eq.nominal)
        )
    return Judged(robot, cutoff, left, without)
