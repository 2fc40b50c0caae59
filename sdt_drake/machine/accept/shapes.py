"""Shapes of test motions: positions of unit size over time, from rest at 0 to rest at 0."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sdt_drake.io.arrays import Array


@dataclass(frozen=True, eq=False)
class Shape:
    """The positions of a test, and its measured cycles."""

    p: Array
    """Positions at equal periods, shape (N,) or (N, n); acceleration of unit size for steps."""
    start: float
    """Start of the first measured cycle [s]."""
    cycle: float
    """Duration of a cycle [s]."""
    cycles: int
    """Number of measured cycles."""
    dwells: tuple[float, ...] = ()
    """Ends of rests at poses since the start of a cycle [s]."""


def eased(x: Array) -> Array:
    """Return the way of a turn from 0 to 1 while x goes from 0 to 1; its speed is 1 - cos."""
    x = np.clip(x, 0.0, 1.0)
    return x - np.sin(2 * np.pi * x) / (2 * np.pi)


def _times(duration: float, period: float) -> Array:
    return np.arange(np.ceil(duration / period - 1e-6) + 1) * period


def sine(cycle: float, cycles: int, period: float) -> Shape:
    """Return a sine that is faded in and out; if it is slow over half a cycle, else over 0.5 s."""
    start = cycle / 2 if cycle > 2 else cycle * (1 + np.ceil(1 / cycle))
    fade = min(start, max(cycle, start / 2))
    end = start + cycles * cycle + fade
    t = _times(end, period)
    p = np.sin(2 * np.pi * t / cycle) * eased(t / fade) * eased((end - t) / fade)
    return Shape(p, start, cycle, cycles)


def triangle(cycle: float, cycles: int, period: float) -> Shape:
    """Return a triangle with reversals that are rounded over an eighth of a cycle."""
    half = round(cycle / 16 / period)
    t = _times((cycles + 1.5) * cycle, period)
    raw = np.pad(2 / np.pi * np.arcsin(np.sin(2 * np.pi * t / cycle)), 2 * half)
    raw[-2 * half - 1 :] = 0.0
    p = np.convolve(raw, np.full(2 * half + 1, 1 / (2 * half + 1)), mode="same")
    return Shape(p, 2 * half * period + cycle, cycle, cycles)


def steps(time: float, cycles: int, period: float) -> Shape:
    """Return steps of acceleration from rest, up and down in turn, each after a rest.

    A cycle rests, moves on by time², rests, and moves back; each part takes `time` or twice that.
    """
    one = np.ones(round(time / period))
    rest = 0 * one
    a = np.tile(np.concatenate([rest, one, -one, rest, -one, one]), cycles)
    p = np.concatenate([[0.0, 0.0], np.cumsum(np.cumsum(a)) * period**2])
    return Shape(p, period, 6 * len(one) * period, cycles)


def turns(
    points: Array, duration: float, dwell: float, cycles: int, period: float, *, lead: bool = True
) -> Shape:
    """Return turns through points, again and again, from 0 and back to it.

    Args:
        points: positions, shape (m,) or (m, n); a cycle goes from the last one through all.
        duration: duration of a turn [s].
        dwell: rest at each point [s].
        cycles: number of measured cycles.
        period: period of the samples [s].
        lead: whether a first cycle is not measured.
    """
    flat = points.reshape(len(points), -1)
    zero = np.zeros((1, flat.shape[1]))
    leg = duration + dwell
    goals = np.vstack([zero, flat[-1:], *[flat] * (cycles + lead), zero])
    t = _times((len(goals) - 1) * leg, period)
    i = np.minimum((t / leg).astype(int), len(goals) - 2)
    way = eased((t - i * leg) / duration)[:, None]
    p = goals[i] + way * (goals[i + 1] - goals[i])
    dwells = tuple(leg * (k + 1) for k in range(len(flat)))
    start = leg * (1 + lead * len(flat))
    p = p.reshape(len(t), *points.shape[1:])
    return Shape(p, start, leg * len(flat), cycles, dwells)


def joined(shapes: Sequence[Array], rest: int) -> tuple[Array, list[int]]:
    """Join positions, each after `rest` samples at 0; return them and their first rows.

    Args:
        shapes: positions, shape (N, n) each.
        rest: samples of rest.
    """
    pause = np.zeros((rest, shapes[0].shape[1]))
    parts, first, at = [pause], [], rest
    for p in shapes:
        first.append(at)
        parts += [p, pause]
        at += len(p) + rest
    return np.vstack(parts), first
