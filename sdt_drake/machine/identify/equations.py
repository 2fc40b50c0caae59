"""Linear equations of recordings: measured torques and their columns of unknown parameters."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from sdt_drake.io.arrays import Array, Index, Mask
from sdt_drake.machine.identify import filtering
from sdt_drake.machine.identify.base_parameters import Unknown, rigid_columns, rigid_parameters
from sdt_drake.machine.identify.filtering import Smooth
from sdt_drake.machine.identify.friction import FrictionLaw, Term, laws, terms_of
from sdt_drake.robot.robot import Robot

_BLOCK_SAMPLES = 20_000  # samples in memory at once; each has hundreds of numbers
_MARGIN = 8.0  # overlap in periods of the cut-off, after which a filter's response is below 1e-8

_SLIDING_SPEED = 0.01
"""Speed above which a joint slides, over its largest speed."""


@dataclass(frozen=True, eq=False)
class Equations:
    """The equations tau = known + rigid beta + friction below a cut-off frequency.

    There are M rows for each of n motors. Torques are those at the outputs of their gears, where
    friction acts: torques of the joints unless a motor turns with two.
    """

    time: Array
    """Time in the recording [s], shape (M,)."""
    source: Index
    """Index of the recording of each row, shape (M,)."""
    part: Index
    """Index of the stretch of each row, shape (M,)."""
    q: Array
    v: Array
    vd: Array
    """`q`, `v`, `vd`: joint position, speed, acceleration [rad, rad/s, rad/s²], shape (M, n)."""
    turns: Array
    """`Robot.gear_coupling` [-], shape (n, n)."""
    tau: Array
    """Measured torque [N m], shape (M, n)."""
    known: Array
    """Torque of the known parameters, without friction [N m], shape (M, n)."""
    nominal: Array
    """Torque that the robot's file predicts, with its damping [N m], shape (M, n)."""
    rigid: Array
    """Columns of the base parameters, shape (M, n, r)."""
    laws: tuple[tuple[FrictionLaw, ...], ...]
    """Candidate friction laws of each joint."""
    friction: Array
    """Columns of the friction terms, shape (M, n, terms)."""
    moves: Mask
    """Mask of motors in motion, shape (M, n). Friction is undetermined at rest."""
    fit: Mask
    """Mask of fitted rows; the others are held out, shape (M,)."""

    @property
    def n(self) -> int:
        """Number of joints."""
        return self.tau.shape[1]

    def not_explained(self, predicted: Array, rows: Mask) -> Array:
        """Return the RMS residual over the RMS torque while each joint moves [-], shape (n,).

        NaN for a joint that never moves.

        Args:
            predicted: Predicted torque [N m], shape (M, n).
            rows: Mask of the compared rows, shape (M,).
        """
        used = rows[:, None] & self.moves
        error = np.sum(used * (self.tau - predicted) ** 2, axis=0)
        with np.errstate(invalid="ignore"):
            return np.asarray(np.sqrt(error / np.sum(used * self.tau**2, axis=0)))

    @cached_property
    def angle(self) -> Array:
        """Positions of the outputs of the gears [rad], shape (M, n); see `turns`."""
        return self.q @ self.turns.T

    @cached_property
    def speed(self) -> Array:
        """Speeds of the outputs of the gears [rad/s], shape (M, n)."""
        return self.v @ self.turns.T

    @cached_property
    def terms(self) -> list[tuple[Term, ...]]:
        """The terms of the columns of friction of each joint."""
        return list(map(terms_of, self.laws))

    @cached_property
    def augmented(self) -> list[Array]:
        """The columns [rigid, friction, tau - known] of each joint, shape (M, r + terms + 1)."""
        unknown = self.tau - self.known
        return [
            np.column_stack([self.rigid[:, k], self.friction[:, k], unknown[:, k]])
            for k in range(self.n)
        ]


def equations(
    robot: Robot,
    unknown: Unknown,
    parts: Sequence[tuple[int, bool | float, filtering.Stretch]],
    cutoff: float,
    candidates: Callable[[float], tuple[FrictionLaw, ...]] = laws,
    block: int = _BLOCK_SAMPLES,
) -> Equations:
    """Make the equations of recordings.

    Args:
        robot: The robot with its known parameters.
        unknown: The parameters to identify.
        parts: For each stretch, the index of its recording, the time from which it is held out
            [s] (inf: all is fitted), and the stretch.
        cutoff: Cut-off frequency of the compared torques [Hz].
        candidates: Function from a joint's largest speed [rad/s] to its candidate friction laws.
        block: Largest number of samples in memory at once.
    """
    motions = [filtering.smooth(stretch, cutoff) for *_, stretch in parts]
    slowest, fastest = slowest_and_fastest(robot, motions, cutoff)
    tried = tuple(candidates(speed) for speed in fastest)
    terms = tuple(map(terms_of, tried))
    rows = [
        [
            _rows(robot, unknown, some, cutoff, terms, slowest, at)
            for some, at in _blocks(m, cutoff, block)
        ]
        for m in motions
    ]
    every = [row for of_part in rows for row in of_part]
    columns = {name: np.concatenate([row[name] for row in every]) for name in every[0]}
    counts = [sum(len(row["time"]) for row in of_part) for of_part in rows]
    held_from = np.repeat([begin for _, begin, _ in parts], counts)
    return Equations(
        source=np.repeat([source for source, *_ in parts], counts),
        part=np.repeat(np.arange(len(parts)), counts),
        laws=tried,
        turns=robot.gear_coupling,
        fit=columns["time"] < held_from,
        **columns,
    )


def slowest_and_fastest(
    robot: Robot, motions: Sequence[Smooth], cutoff: float
) -> tuple[Array, Array]:
    """Return the smallest speed with a sure sign and the largest speed of each gear [rad/s].

    The former is inf for a gear at rest, whose speeds are more noise than motion.
    """
    speeds = [robot.gear_speed(m.v) for m in motions]
    fastest = np.max([np.abs(v).max(axis=0) for v in speeds], axis=0) + 1e-6
    periods = [m.period for m in motions]
    below = [
        filtering.zero_phase_low_pass(v, 2 * cutoff, h)
        for v, h in zip(speeds, periods, strict=True)
    ]
    motion = np.max([np.std(v, axis=0) for v in below], axis=0)
    noise = np.max([np.std(v - x, axis=0) for v, x in zip(speeds, below, strict=True)], axis=0)
    slowest = np.maximum(noise, _SLIDING_SPEED * fastest) + 1e-9
    return np.where(noise > motion, np.inf, slowest), fastest


def _blocks(motion: Smooth, cutoff: float, size: int) -> Iterator[tuple[Smooth, Index]]:
    """Yield a motion in overlapping blocks, each with the indices of its compared samples.

    The overlap is as long as the response of the filters.
    """
    count = len(motion.time)
    margin = int(_MARGIN / (cutoff * motion.period))
    for at in np.array_split(
        np.arange(count)[filtering.compared(count, cutoff, motion.period)], 1 + count // size
    ):
        first = max(0, at[0] - margin) if len(at) else 0
        block = slice(first, at[-1] + 1 + margin if len(at) else count)
        time, q, v, vd, tau = (
            x[block] for x in (motion.time, motion.q, motion.v, motion.vd, motion.tau)
        )
        yield Smooth(time, q, v, vd, tau, motion.period), at - first


def _rows(
    robot: Robot,
    unknown: Unknown,
    motion: Smooth,
    cutoff: float,
    terms: Sequence[Sequence[Term]],
    slowest: Array,
    at: Index,
) -> dict[str, Any]:
    """Return the fields of `Equations` that depend on the samples, by name."""
    columns = rigid_columns(robot, motion.q, motion.v, motion.vd)
    parameters = rigid_parameters(robot)
    is_known = np.ones(len(parameters), dtype=bool)
    is_known[unknown.columns] = False
    speed = robot.gear_speed(motion.v)
    friction = [
        np.column_stack([term.at(v, slow) for term in of_motor])
        for v, slow, of_motor in zip(speed.T, slowest, terms, strict=True)
    ]
    whole = {
        "q": motion.q,
        "v": motion.v,
        "vd": motion.vd,
        "tau": robot.gear_torque(motion.tau),
        "known": columns[:, :, is_known] @ parameters[is_known],
        "nominal": columns @ parameters + robot.gear_torque(robot.damping * motion.v),
        "rigid": columns[:, :, unknown.independent],
        "friction": np.stack(friction, axis=1),
        "moves": (np.abs(speed) > slowest).astype(float),
    }
    few = {  # one joint at a time, and copies, so that no large array stays in memory
        name: np.stack(
            [
                filtering.zero_phase_low_pass(x, cutoff, motion.period)[at]
                for x in values.swapaxes(0, 1)
            ],
            axis=1,
        )
        for name, values in whole.items()
    }
    return few | {"time": motion.time[at], "moves": few["moves"] > 0.5}
