"""Linear systems as matrices, continuous or sampled."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from pydrake.systems.analysis import DiscreteTimeApproximation
from pydrake.systems.primitives import AffineSystem, LinearSystem

from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import needing
from sdt_drake.io.shown import Shown, Summary

if TYPE_CHECKING:
    import control


@dataclass(frozen=True, eq=False)
class StateSpace:
    """x' = A x + B u (or, sampled, x of the next period), y = C x + D u.

    Attributes:
        period: sampling period [s]; 0: continuous.
    """

    A: Array
    B: Array
    C: Array
    D: Array
    period: float = 0.0

    @classmethod
    def of(cls, system: AffineSystem) -> StateSpace:
        """The linear part of a linear or affine system of Drake's, its offsets left out."""
        return StateSpace(system.A(), system.B(), system.C(), system.D(), system.time_period())

    def response(self, omega: Array) -> NDArray[np.complex128]:
        """Frequency response at `omega` [rad/s], shape (len(omega), outputs, inputs)."""
        s = np.exp(1j * omega * self.period) if self.period else 1j * omega
        resolvent = s[:, None, None] * np.eye(len(self.A)) - self.A
        moving: NDArray[np.complex128] = self.C @ np.linalg.solve(resolvent, self.B + 0j)
        return moving + self.D

    def sampled(self, period: float) -> StateSpace:
        """The system behind zero-order holds, at their samples.

        Of a system that is sampled itself, `period` is a multiple of its own.
        """
        if not self.period:
            continuous = LinearSystem(self.A, self.B, self.C, self.D)
            return StateSpace.of(DiscreteTimeApproximation(continuous, period))
        A, B = np.eye(len(self.A)), np.zeros_like(self.B)
        for _ in range(round(period / self.period)):
            A, B = self.A @ A, self.A @ B + self.B
        return StateSpace(A, B, self.C, self.D, period)

    def fed_back(self, outputs: slice, inputs: slice) -> StateSpace:
        """The system with outputs connected to as many inputs, which are then gone.

        No such input may reach such an output at once.
        """
        C, D = self.C[outputs], np.delete(self.D[outputs], inputs, axis=1)
        into, at_once = self.B[:, inputs], self.D[:, inputs]
        return StateSpace(
            A=self.A + into @ C,
            B=np.delete(self.B, inputs, axis=1) + into @ D,
            C=self.C + at_once @ C,
            D=np.delete(self.D, inputs, axis=1) + at_once @ D,
            period=self.period,
        )

    def by_differences(self, n: int) -> StateSpace:
        """The system with outputs n to 2n replaced by differences of the first n per period.

        It has n states more, the last: those outputs at the sample before.
        """
        first, none = self.C[:n], np.zeros((len(self.A), n))
        C = np.hstack([self.C, np.zeros((len(self.C), n))])
        C[n : 2 * n] = np.hstack([first, -np.eye(n)]) / self.period
        A = np.block([[self.A, none], [first, np.zeros((n, n))]])
        return StateSpace(A, np.vstack([self.B, self.D[:n]]), C, self.D, self.period)

    def between(self) -> StateSpace:
        """The system without the states that no input reaches or no output shows."""
        x = self.is_between()
        return replace(self, A=self.A[np.ix_(x, x)], B=self.B[x], C=self.C[:, x])

    def is_between(self) -> NDArray[np.bool_]:
        """Whether an input reaches a state, and an output shows it, by what is 0 in A, B, C."""
        n = len(self.A)
        leads = np.linalg.matrix_power((self.A != 0) | np.eye(n, dtype=bool), n)  # column to row
        return (leads @ (self.B != 0).any(axis=1)) & ((self.C != 0).any(axis=0) @ leads)

    def modes(self) -> NDArray[np.complex128]:
        """Eigenvalues [1/s]; of a sampled system, the continuous ones that they stand for."""
        eigenvalues = np.linalg.eigvals(self.A).astype(complex)
        if not self.period:
            return eigenvalues
        with np.errstate(divide="ignore"):
            return np.log(eigenvalues) / self.period

    def step(self, duration: float, samples: int) -> tuple[Array, Array]:
        """Outputs after a step of the one input: time [s] (N + 1,) and y (N + 1, outputs).

        N is `samples`; of a sampled system less, if it has fewer periods, or up to twice as many.
        """
        system = self if self.period else self.sampled(duration / samples)
        every = max(1, round(duration / system.period) // samples)
        count = round(duration / system.period / every)
        n = len(system.A)
        one_period = np.block([[system.A, system.B], [np.zeros((1, n)), np.ones((1, 1))]])
        onwards = np.linalg.matrix_power(one_period, every)
        x_u = np.append(np.zeros(n), 1.0)[:, None]
        while x_u.shape[1] <= count:  # twice as many samples each time
            x_u = np.hstack([x_u, onwards @ x_u])
            onwards = onwards @ onwards
        y = np.hstack([system.C, system.D]) @ x_u[:, : count + 1]
        return np.arange(count + 1, dtype=float) * every * system.period, y.T


@dataclass(frozen=True, eq=False, repr=False)
class LinearModel(Shown, StateSpace):
    """A closed loop in state space, with names; speeds, angles and their references joint side,
    torques motor side.

    Attributes:
        states, inputs, outputs: names, `name_k` for joint k.
    """

    states: tuple[str, ...] = ()
    inputs: tuple[str, ...] = ()
    outputs: tuple[str, ...] = ()

    def summary(self) -> Summary:
        kind = f"sampled every {1000 * self.period:.6g} ms" if self.period else "continuous"
        rows = []
        for part in ("states", "inputs", "outputs"):
            names = getattr(self, part)
            stems = dict.fromkeys(f"{name.rpartition('_')[0]}_k" for name in names)
            rows.append((part, f"{len(names)}", ", ".join(stems)))
        return Summary(kind, ("", "number", "names"), rows)

    def to_control(self) -> control.StateSpace:
        """The model as a StateSpace of python-control, with the same names.

        Raises:
            InputError: where that is not installed.
        """
        with needing("to_control needs python-control", "sdt_drake[exchange]"):
            import control
        names = {name: list(getattr(self, name)) for name in ("states", "inputs", "outputs")}
        return control.ss(self.A, self.B, self.C, self.D, self.period, **names)
