"""Recordings as equations: what was measured, and what each unknown parameter has to do with it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from sdt_drake.io.arrays import Array, Index, Mask
from sdt_drake.machine.identify.base_parameters import Unknown, rigid_columns, rigid_parameters
from sdt_drake.machine.identify.filtering import (
    Smooth,
    Stretch,
    compared,
    smooth,
    zero_phase_low_pass,
)
from sdt_drake.machine.identify.friction import FrictionLaw, Term, laws, terms_of
from sdt_drake.robot.robot import Robot

_BLOCK = 20_000  # samples, each of which has hundreds of numbers in columns
_MARGIN = 8.0  # periods of the cut-off, after which a filter has forgotten all but 1e-8

_SLOW = 0.01
"""Of the largest speed: below that, nobody takes a joint to slide."""


@dataclass(frozen=True, eq=False)
class Equations:
    """tau = known + rigid beta + friction, below a cut-off frequency; M rows for each joint.

    All joint side.

    Attributes:
        time: [s], shape (M,).
        source: which recording a row is of, shape (M,).
        part: which stretch of them all, shape (M,).
        q, v, vd: [rad, rad/s, rad/s²], shape (M, n).
        tau: measured [N m], shape (M, n).
        known: what the robot's file says of that, without friction [N m], shape (M, n).
        nominal: the torque that the whole file predicts, with its damping [N m], shape (M, n).
        rigid: columns of the base parameters, shape (M, n, r).
        laws: of friction, which each joint may follow.
        friction: their columns, shape (M, n, terms).
        moves: whether a joint moves, shape (M, n); where it rests, friction may be anything.
        fit: whether a row is for fitting, or held out, shape (M,).
    """

    time: Array
    source: Index
    part: Index
    q: Array
    v: Array
    vd: Array
    tau: Array
    known: Array
    nominal: Array
    rigid: Array
    laws: tuple[tuple[FrictionLaw, ...], ...]
    friction: Array
    moves: Mask
    fit: Mask

    @property
    def n(self) -> int:
        """Number of joints."""
        return self.tau.shape[1]

    @cached_property
    def terms(self) -> list[tuple[Term, ...]]:
        """Which columns of friction belong to each joint."""
        return list(map(terms_of, self.laws))

    @cached_property
    def augmented(self) -> list[Array]:
        """For each joint [rigid, friction, what they have to explain], shape (M, r + terms + 1)."""
        left = self.tau - self.known
        return [
            np.column_stack([self.rigid[:, k], self.friction[:, k], left[:, k]])
            for k in range(self.n)
        ]


def equations(
    robot: Robot,
    unknown: Unknown,
    parts: Sequence[tuple[int, bool | float, Stretch]],
    cutoff: float,
    candidates: Callable[[float], tuple[FrictionLaw, ...]] = laws,
) -> Equations:
    """The equations of recordings.

    Args:
        robot: gives what is known, and the nominal torque.
        unknown: what is not.
        parts: of each stretch the number of its recording, the time at which what is held out
            begins [s] (inf: all is for fitting), and itself.
        cutoff: below which torques are compared [Hz].
        candidates: laws of friction for joints that move at up to a speed [rad/s].
    """
    motions = [smooth(stretch, cutoff) for *_, stretch in parts]
    slowest, fastest = slowest_and_fastest(motions, cutoff)
    tried = tuple(candidates(speed) for speed in fastest)
    terms = tuple(map(terms_of, tried))
    rows = [
        [
            _rows(robot, unknown, block, cutoff, terms, slowest, at)
            for block, at in _blocks(m, cutoff)
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
        fit=columns["time"] < held_from,
        **columns,
    )


def slowest_and_fastest(motions: Sequence[Smooth], cutoff: float) -> tuple[Array, Array]:
    """Of each joint the speed below which nobody knows its sign, and the largest [rad/s]; the
    former is inf where speeds are more noise than motion: such a joint rests."""
    fastest = np.max([np.abs(m.v).max(axis=0) for m in motions], axis=0) + 1e-6
    below = [zero_phase_low_pass(m.v, 2 * cutoff, m.period) for m in motions]
    motion = np.max([np.std(v, axis=0) for v in below], axis=0)
    noise = np.max([np.std(m.v - v, axis=0) for m, v in zip(motions, below, strict=True)], axis=0)
    slowest = np.maximum(noise, _SLOW * fastest) + 1e-9
    return np.where(noise > motion, np.inf, slowest), fastest


def _blocks(motion: Smooth, cutoff: float) -> Iterator[tuple[Smooth, Index]]:
    """A motion in blocks that memory holds as columns, and the samples of each that are compared;
    blocks overlap by as much as filters have to know."""
    count = len(motion.time)
    margin = int(_MARGIN / (cutoff * motion.period))
    for at in np.array_split(
        np.arange(count)[compared(count, cutoff, motion.period)], 1 + count // _BLOCK
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
    """The fields of `Equations` that some samples of a motion have, by name; of friction (M, n,
    terms)."""
    columns = rigid_columns(robot, motion.q, motion.v, motion.vd)
    parameters = rigid_parameters(robot)
    is_known = np.ones(len(parameters), dtype=bool)
    is_known[unknown.columns] = False
    friction = [
        np.column_stack([term.at(v, slow) for term in of_joint])
        for v, slow, of_joint in zip(motion.v.T, slowest, terms, strict=True)
    ]
    whole = {
        "q": motion.q,
        "v": motion.v,
        "vd": motion.vd,
        "tau": motion.tau,
        "known": columns[:, :, is_known] @ parameters[is_known],
        "nominal": columns @ parameters + robot.damping * motion.v,
        "rigid": columns[:, :, unknown.independent],
        "friction": np.stack(friction, axis=1),
        "moves": (np.abs(motion.v) > slowest).astype(float),
    }
    few = {  # a joint at a time, and copies: what filters make of all samples is large
        name: np.stack(
            [zero_phase_low_pass(x, cutoff, motion.period)[at] for x in values.swapaxes(0, 1)],
            axis=1,
        )
        for name, values in whole.items()
    }
    return few | {"time": motion.time[at], "moves": few["moves"] > 0.5}
