"""Whether learning converges, told before anybody flies."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sdt_drake.arrays import Array
from sdt_drake.errors import InputError
from sdt_drake.learning.filter import LearningFilter
from sdt_drake.learning.loops import LoopSet


@dataclass(frozen=True, eq=False)
class Convergence:
    """The share of an error that is left by a flight, |Q (1 - L G)|, of the worst loop of a set.

    Attributes:
        loops: the set.
        share: of each joint alone, over the filter's frequencies [-], shape (m, n).
        together: of all joints with what they do to each other: the spectral radius [-], (m,).
    """

    loops: LoopSet
    share: Array
    together: Array

    @property
    def largest(self) -> float:
        """Below 1, every error shrinks [-]."""
        return float(max(self.share.max(), self.together.max()))


def convergence(filter_: LearningFilter, loops: LoopSet) -> Convergence:
    """How a filter does on loops that are linear, and that all flights share."""
    share = np.zeros((len(filter_.omega), len(filter_.bandwidth)))
    together = np.zeros(len(filter_.omega))
    for response in loops.responses:
        left = filter_.contraction(response)
        share = np.maximum(share, np.abs(np.einsum("mkk->mk", left)))
        together = np.maximum(together, np.abs(np.linalg.eigvals(left)).max(axis=1))
    return Convergence(loops, share, together)


def refuse_divergence(checks: Sequence[Convergence], filter_: LearningFilter) -> None:
    """Raise InputError if an error could grow: naming the loops, the joint and the frequency; or if
    motors of the one device that is going to fly would saturate, whatever is learned."""
    for check in checks:
        name = check.loops.name
        if check.largest >= 1:
            i = int(np.maximum(check.share.max(axis=1), check.together).argmax())
            k = int(check.share[i].argmax())
            who = f"joint {k + 1}" if check.share[i, k] >= 1 else "the joints together"
            raise InputError(
                f"learning does not converge for {name}: {who} would keep {check.largest:.3g} of "
                f"an error at {filter_.omega[i] / (2 * np.pi):.3g} Hz, expected less than 1: a "
                "lower --bandwidth, or a better model"
            )
        k = int(check.loops.demand.max(axis=0).argmax())
        demand = check.loops.demand[:, k].max()
        if check.loops.devices == 1 and demand > 1:
            raise InputError(
                f"learning does not converge for {name}: the motion takes {100 * demand:.1f} % of "
                f"the torque of motor {k + 1}, which saturates whatever is learned; expected a "
                "slower motion, or a lower torque_margin"
            )
