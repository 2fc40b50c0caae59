"""The learned reference: the input of a controller in place of the planned motion."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError, within
from sdt_drake.io.tables import read_table, write_table
from sdt_drake.motion.plan import checked_torque
from sdt_drake.motion.trajectory import Motion
from sdt_drake.robot.robot import Robot

_PLAN_TOLERANCE = 1e-4  # rad; between the planned motions of the file and of the scenario
# Largest distance from the planned motion, for files without the motion that they were learned for:
_MAX_RANGE_SHARE = 0.1  # of the joint's range of angles [-], plus
_MAX_ANGLE = 0.02  # rad
_START_TOLERANCE = 1e-9  # rad, rad/s


@dataclass(frozen=True, eq=False)
class LearnedReference:
    """A corrected reference with which the joints track the planned motion better."""

    motion: Motion
    """Motion that the controller tracks."""
    torque: Array | None = None
    """Torque added to the feedforward, motor side [N m], shape (N + 1, n); None for none."""
    planned: Array | None = None
    """Angles of the planned motion that it was learned for [rad], shape (N + 1, n), if known."""

    def to_csv(self, path: str | Path, wanted: Motion) -> None:
        """Write a CSV with time, q_ref_k, v_ref_k, vd_ref_k, tau_ff_k (if any) and q_planned_k.

        q_planned_k are the angles of `wanted`, the planned motion that it was learned for.
        """
        torque = {} if self.torque is None else {"tau_ff": self.torque}
        columns = self.motion.columns | torque | {"q_planned": wanted.q}
        write_table(path, self.motion.time, columns)

    @staticmethod
    def from_csv(path: str | Path) -> "LearnedReference":
        """Read a file that `to_csv` has written.

        Raises:
            InputError: as `Motion.from_csv`; if tau_ff or q_planned have another number of joints.
        """
        motion, columns = Motion.from_csv(path), read_table(path)[1]
        beside = {name: columns.get(name) for name in ("tau_ff", "q_planned")}
        for name, x in beside.items():
            if x is not None and x.shape != motion.q.shape:
                raise InputError(f"{path}: {name} has {x.shape[1]} joint(s), expected {motion.n}")
        return LearnedReference(motion, *beside.values())

    def check(self, wanted: Motion, robot: Robot, *, torque_margin: float) -> None:
        """Check that the reference was learned for a motion and that the robot can do it.

        Raises:
            InputError: with joint and time.
        """
        own = self.motion
        if own.q.shape != wanted.q.shape or abs(own.period / wanted.period - 1) > 1e-6:
            raise InputError(
                f"{own.n} joint(s), {len(own.q)} samples of {own.period:g} s, expected {wanted.n} "
                f"joint(s), {len(wanted.q)} samples of {wanted.period:g} s as in the planned motion"
            )
        start = np.abs(np.stack([own.q[0] - wanted.q[0], own.v[0] - wanted.v[0]])).max(axis=0)
        if start.max() > _START_TOLERANCE:
            k = int(start.argmax())
            raise InputError(
                f"joint {k + 1} starts {start[k]:.3g} rad or rad/s from the planned motion, "
                "expected the same start"
            )
        apart = np.abs(own.q - wanted.q)
        beyond = apart > _MAX_RANGE_SHARE * np.ptp(wanted.q, axis=0) + _MAX_ANGLE
        if self.planned is not None:
            apart = np.abs(self.planned - wanted.q)
            beyond = apart > _PLAN_TOLERANCE
        for i, k in np.argwhere(beyond):
            raise InputError(
                f"joint {k + 1} is {np.degrees(apart[i, k]):.3g} deg from the planned motion at "
                f"{wanted.time[i]:.3f} s, expected a reference that was learned for this motion"
            )
        checked_torque(robot, own, torque_margin=torque_margin)
        if self.torque is not None:
            available = robot.torque_range(own.v, torque_margin)
            least, most = (limit / robot.gear_ratio for limit in available)
            for i, k in np.argwhere((self.torque < least) | (self.torque > most)):
                raise InputError(
                    f"joint {k + 1} at {own.time[i]:.3f} s: feedforward of {self.torque[i, k]:.6g} "
                    f"N m (motor side), available {least[i, k]:.6g} to {most[i, k]:.6g} N m"
                )


def load_learned(
    path: str | Path, wanted: Motion, robot: Robot, *, torque_margin: float
) -> LearnedReference:
    """Read and check a learned reference.

    Args:
        path: CSV that `LearnedReference.to_csv` has written.
        wanted: planned motion that it was learned for.
        robot: robot that tracks it.
        torque_margin: share of the motors' torque that may be used, in (0, 1].

    Raises:
        InputError: with the file: see `LearnedReference.from_csv` and `LearnedReference.check`.
    """
    learned = LearnedReference.from_csv(path)
    with within(path):
        learned.check(wanted, robot, torque_margin=torque_margin)
    return learned
