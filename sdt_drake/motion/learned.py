"""What flights have taught: the reference that a controller gets in place of the planned motion."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError, within
from sdt_drake.io.tables import read_table, write_table
from sdt_drake.motion.plan import checked_torque
from sdt_drake.motion.trajectory import Motion
from sdt_drake.robot.robot import Robot

_SAME = 1e-4  # rad; angles of the same plan
# How far a learned angle may be from the planned one, where a file does not tell of which motion it
# was learned; farther, it is of another one.
_FARTHEST = 0.1  # of the joint's range of angles, and
_FARTHEST_ANGLE = 0.02  # rad
_SAME_START = 1e-9  # rad, rad/s


@dataclass(frozen=True, eq=False)
class LearnedReference:
    """A reference, and what is added to the torque feedforward.

    Attributes:
        motion: what the controller follows, so that the joints follow the planned motion.
        torque: added to what the controller feeds forward, motor side [N m], shape (N + 1, n); None
            for nothing.
        planned: positions of the motion that it was learned of [rad], shape (N + 1, n); None where
            nobody knows.
    """

    motion: Motion
    torque: Array | None = None
    planned: Array | None = None

    def to_csv(self, path: str | Path, wanted: Motion) -> None:
        """Write time, q_ref_k, v_ref_k, vd_ref_k (a motion), tau_ff_k where there is some, and
        q_planned_k, of the motion that it was learned of."""
        torque = {} if self.torque is None else {"tau_ff": self.torque}
        columns = self.motion.columns | torque | {"q_planned": wanted.q}
        write_table(path, self.motion.time, columns)

    @staticmethod
    def from_csv(path: str | Path) -> LearnedReference:
        """Read what `to_csv` writes.

        Raises:
            InputError: as `Motion.from_csv`; if tau_ff or q_planned have another number of joints.
        """
        motion, columns = Motion.from_csv(path), read_table(path)[1]
        beside = {name: columns.get(name) for name in ("tau_ff", "q_planned")}
        for name, x in beside.items():
            if x is not None and x.shape != motion.q.shape:
                raise InputError(f"{path}: {name} of {x.shape[1]} joint(s), expected {motion.n}")
        return LearnedReference(motion, *beside.values())

    def check(self, wanted: Motion, robot: Robot, *, torque_margin: float) -> None:
        """Refuse what was not learned of a motion, and what the robot cannot do.

        Raises:
            InputError: naming joint and time.
        """
        own = self.motion
        if own.q.shape != wanted.q.shape or abs(own.period / wanted.period - 1) > 1e-6:
            raise InputError(
                f"{own.n} joint(s), {len(own.q)} samples of {own.period:g} s, expected {wanted.n}, "
                f"{len(wanted.q)} of {wanted.period:g} s as the planned motion"
            )
        start = np.abs(np.stack([own.q[0] - wanted.q[0], own.v[0] - wanted.v[0]])).max(axis=0)
        if start.max() > _SAME_START:
            k = int(start.argmax())
            raise InputError(f"joint {k + 1} does not start as the planned motion does")
        apart = np.abs(own.q - wanted.q)
        beyond = apart > _FARTHEST * np.ptp(wanted.q, axis=0) + _FARTHEST_ANGLE
        if self.planned is not None:
            apart = np.abs(self.planned - wanted.q)
            beyond = apart > _SAME
        for i, k in np.argwhere(beyond):
            raise InputError(
                f"joint {k + 1} is {np.degrees(apart[i, k]):.3g} deg from the planned motion at "
                f"{wanted.time[i]:.3f} s: learned of another one"
            )
        checked_torque(robot, own, torque_margin=torque_margin)
        if self.torque is not None:
            available = robot.torque_range(own.v, torque_margin)
            least, most = (limit / robot.gear_ratio for limit in available)
            for i, k in np.argwhere((self.torque < least) | (self.torque > most)):
                raise InputError(
                    f"joint {k + 1} at {own.time[i]:.3f} s: feeds {self.torque[i, k]:.6g} N m "
                    f"forward, motor side, available {least[i, k]:.6g} to {most[i, k]:.6g} N m"
                )


def load_learned(
    path: str | Path, wanted: Motion, robot: Robot, *, torque_margin: float
) -> LearnedReference:
    """A learned reference from CSV.

    Args:
        path: of what `LearnedReference.to_csv` writes.
        wanted: the planned motion that it was learned of.
        robot: that has to do it.
        torque_margin: share of the motors' torque that the reference may take [-].

    Raises:
        InputError: naming the file: what `from_csv` and `check` refuse.
    """
    learned = LearnedReference.from_csv(path)
    with within(path):
        learned.check(wanted, robot, torque_margin=torque_margin)
    return learned
