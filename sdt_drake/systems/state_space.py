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
    """A linear system: y = C x + D u with x' = A x + B u, or sampled x[i + 1] = A x[i] + B u[i]."""

    A: Array
    B: Array
    C: Array
    D: Array
    period: float = 0.0
    """Sample period [s]; 0 for a continuous system."""

    @classmethod
    def of(cls, system: AffineSystem) -> StateSpace:
        """Return the linear part of a linear or affine system of Drake, without offsets."""
        return StateSpace(system.A(), system.B(), system.C(), system.D(), system.time_period())

    def response(self, omega: Array) -> NDArray[np.complex128]:
        """Return the frequency response at `omega` [rad/s], shape (len(omega), outputs, inputs)."""
        s = np.exp(1j * omega * self.period) if self.period else 1j * omega
        resolvent = s[:, None, None] * np.eye(len(self.A)) - self.A
        moving: NDArray[np.complex128] = self.C @ np.linalg.solve(resolvent, self.B + 0j)
        return moving + self.D

    def sampled(self, period: float) -> StateSpace:
        """Return the system behind zero-order holds of `period` [s], at their samples.

        For a sampled system, `period` must be a multiple of its own.
        """
        if not self.period:
            continuous = LinearSystem(self.A, self.B, self.C, self.D)
            return StateSpace.of(DiscreteTimeApproximation(continuous, period))
        A, B = np.eye(len(self.A)), np.zeros_like(self.B)
        for _ in range(round(period / self.period)):
            A, B = self.A @ A, self.A @ B + self.B
        return StateSpace(A, B, self.C, self.D, period)

    def fed_back(self, outputs: slice, inputs: slice) -> StateSpace:
        """Return the system with `outputs` connected to `inputs`, which are removed.

        None of these inputs may have direct feedthrough to these outputs.
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
        """Return the system with outputs n to 2n replaced by differences of the first n per period.

        It has n additional states at the end: the first n outputs at the previous sample.
        """
        first, none = self.C[:n], np.zeros((len(self.A), n))
        C = np.hstack([self.C, np.zeros((len(self.C), n))])
        C[n : 2 * n] = np.hstack([first, -np.eye(n)]) / self.period
        A = np.block([[self.A, none], [first, np.zeros((n, n))]])
        return StateSpace(A, np.vstack([self.B, self.D[:n]]), C, self.D, self.period)

    def between(self) -> StateSpace:
        """Return the system without uncontrollable and unobservable states (structurally)."""
        x = self.is_between()
        return replace(self, A=self.A[np.ix_(x, x)], B=self.B[x], C=self.C[:, x])

    def is_between(self) -> NDArray[np.bool_]:
        """Return True for states on a path from an input to an output, by A, B, C != 0."""
        n = len(self.A)
        leads = np.linalg.matrix_power((self.A != 0) | np.eye(n, dtype=bool), n)  # column to row
        return (leads @ (self.B != 0).any(axis=1)) & ((self.C != 0).any(axis=0) @ leads)

    def modes(self) -> NDArray[np.complex128]:
        """Return the eigenvalues [1/s]; for a sampled system, their continuous equivalents."""
        eigenvalues = np.linalg.eigvals(self.A).astype(complex)
        if not self.period:
            return eigenvalues
        with np.errstate(divide="ignore"):
            return np.log(eigenvalues) / self.period

    def step(self, duration: float, samples: int) -> tuple[Array, Array]:
        """Return time [s], (N + 1,), and outputs, (N + 1, outputs), after a step of the one input.

        N is `samples`. For a sampled system it is the number of periods if that is smaller, and may
        be up to twice `samples`.
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
    """A closed loop in state space, with names `name_k` for joint k.

    Speeds, angles and their references are joint side, torques motor side.
    """

    states: tuple[str, ...] = ()
    """Names of the states."""
    inputs: tuple[str, ...] = ()
    """Names of the inputs."""
    outputs: tuple[str, ...] = ()
    """Names of the outputs."""

    def summary(self) -> Summary:
        """Return the numbers and names of states, inputs and outputs."""
        kind = f"sampled every {1000 * self.period:.6g} ms" if self.period else "continuous"
        rows = []
        for part in ("states", "inputs", "outputs"):
            names = getattr(self, part)
            stems = dict.fromkeys(f"{name.rpartition('_')[0]}_k" for name in names)
            rows.append((part, f"{len(names)}", ", ".join(stems)))
        return Summary(kind, ("", "number", "names"), rows)

    def to_control(self) -> control.StateSpace:
        """Return the model as a StateSpace of python-control, with the same names.

        Raises:
            InputError: if python-control is not installed.
        """
        with needing("to_control needs python-control", "sdt_drake[exchange]"):
            import control
        names = {name: list(getattr(self, name)) for name in ("states", "inputs", "outputs")}
        return control.ss(self.A, self.B, self.C, self.D, self.period, **names)
