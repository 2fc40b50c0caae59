"""Linear systems as matrices, continuous or sampled."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import compress
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from pydrake.systems.analysis import DiscreteTimeApproximation
from pydrake.systems.primitives import AffineSystem, LinearSystem

from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import needing
from sdt_drake.io.shown import Shown, Summary

if TYPE_CHECKING:
    import control

_ROUND_OFF = 1e-14
"""Share of a step that a mode which is connected by round-off alone does not exceed [-]."""

_GONE = 1e-4
"""Share of a mode after one sample at which it counts as gone [-]. Round-off moves a threefold
eigenvalue 0 of A to about 1e-5."""

_FINITE = 1000.0
"""Largest zero over the fastest mode [-]; round-off makes larger ones of zeros at infinity."""


@dataclass(frozen=True, eq=False)
class StateSpace:
    """A linear system: y = C x + D u with x' = A x + B u, or sampled x[i + 1] = A x[i] + B u[i]."""

    A: Array
    B: Array
    C: Array
    D: Array
    period: float = 0.0
    """Sample period [s]; 0 for a continuous system."""
    states: tuple[str, ...] = ()
    """Names of the states."""

    @classmethod
    def of(cls, system: AffineSystem, states: tuple[str, ...] = ()) -> StateSpace:
        """Return the linear part of a linear or affine system of Drake, without offsets."""
        A, B, C, D = system.A(), system.B(), system.C(), system.D()
        return StateSpace(A, B, C, D, system.time_period(), states)

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
            return StateSpace.of(DiscreteTimeApproximation(continuous, period), self.states)
        A, B = np.eye(len(self.A)), np.zeros_like(self.B)
        for _ in range(round(period / self.period)):
            A, B = self.A @ A, self.A @ B + self.B
        return replace(self, A=A, B=B, period=period)

    def close_loop(self, outputs: slice, inputs: slice) -> StateSpace:
        """Return the system with `outputs` connected to `inputs`, which are removed.

        None of these inputs may have direct feedthrough to these outputs.
        """
        C, D = self.C[outputs], np.delete(self.D[outputs], inputs, axis=1)
        into, at_once = self.B[:, inputs], self.D[:, inputs]
        return replace(
            self,
            A=self.A + into @ C,
            B=np.delete(self.B, inputs, axis=1) + into @ D,
            C=self.C + at_once @ C,
            D=np.delete(self.D, inputs, axis=1) + at_once @ D,
        )

    def by_differences(self, before: Sequence[str]) -> StateSpace:
        """Return the system with n of its outputs replaced by differences of the n ahead of them.

        The first n outputs stay, the next n become their differences per period. The system has n
        additional states at the end, named `before`: the first n outputs at the previous sample.
        """
        n = len(before)
        first, none = self.C[:n], np.zeros((len(self.A), n))
        C = np.hstack([self.C, np.zeros((len(self.C), n))])
        C[n : 2 * n] = np.hstack([first, -np.eye(n)]) / self.period
        A = np.block([[self.A, none], [first, np.zeros((n, n))]])
        B, states = np.vstack([self.B, self.D[:n]]), (*self.states, *before)
        return replace(self, A=A, B=B, C=C, states=states)

    def structurally_minimal(self) -> StateSpace:
        """Return the system with the states on a path from an input to an output, by A, B, C != 0.

        All other states are uncontrollable or unobservable.
        """
        n = len(self.A)
        leads = np.linalg.matrix_power((self.A != 0) | np.eye(n, dtype=bool), n)  # column to row
        x = (leads @ (self.B != 0).any(axis=1)) & ((self.C != 0).any(axis=0) @ leads)
        states = tuple(compress(self.states, x))
        return replace(self, A=self.A[np.ix_(x, x)], B=self.B[x], C=self.C[:, x], states=states)

    def modes(self) -> NDArray[np.complex128]:
        """Return the eigenvalues [1/s]; for a sampled system, their continuous equivalents.

        Those of a mode that is gone after one sample (deadbeat) are -inf.
        """
        return self._as_continuous(np.linalg.eigvals(self.A))

    def zeros(self) -> NDArray[np.complex128]:
        """Return the transmission zeros of a system with as many outputs as inputs [1/s].

        Those of a sampled system are its continuous equivalents, as for `modes`. Zeros that are
        1000 times faster than the fastest mode count as infinite, and are left out.
        """
        import scipy.linalg  # only here, as it takes a while to load

        n = len(self.A)
        pencil = np.block([[self.A, self.B], [self.C, self.D]])
        top, bottom = scipy.linalg.eigvals(
            pencil, np.diag(np.arange(len(pencil)) < n).astype(float), homogeneous_eigvals=True
        )
        fastest = np.abs(np.linalg.eigvals(self.A)).max(initial=0.0)
        finite = np.abs(top) <= _FINITE * fastest * np.abs(bottom)
        return self._as_continuous(top[finite] / bottom[finite])

    def modes_between(self) -> NDArray[np.complex128]:
        """Return the modes [1/s] that the one input moves and the one output shows.

        Round-off alone connects the input to the other modes, such as those of joints that a
        controller decouples. The share of such a mode in the output after a step of 1, its residue
        over its rate, is at most `_ROUND_OFF`. Modes that grow are always returned.
        """
        import scipy.linalg  # only here, as it takes a while to load

        eigenvalues, left, right = scipy.linalg.eig(self.A, left=True, right=True)
        moved, shown = (left.conj().T @ self.B)[:, 0], (self.C @ right)[0]
        paired = np.abs(np.sum(left.conj() * right, axis=0))  # 0 for a Jordan block
        rate = np.abs(eigenvalues - (1 if self.period else 0))
        modes = self._as_continuous(eigenvalues)
        return modes[(np.abs(moved * shown) > _ROUND_OFF * paired * rate) | (modes.real > 0)]

    def _as_continuous(self, eigenvalues: NDArray[Any]) -> NDArray[np.complex128]:
        """Return the modes [1/s] of eigenvalues of A."""
        z = eigenvalues.astype(complex)
        if not self.period:
            return z
        size = np.where(np.abs(z) > _GONE, np.abs(z), 0.0)
        with np.errstate(divide="ignore"):
            decay = np.log(size) / self.period
        modes: NDArray[np.complex128] = decay + 1j * np.angle(z) / self.period
        return modes

    def step(self, duration: float, samples: int) -> Array:
        """Return outputs, (N + 1, outputs), at even times after a step of the one input.

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
        outputs: Array = np.hstack([system.C, system.D]) @ x_u[:, : count + 1]
        return outputs.T


@dataclass(frozen=True, eq=False, repr=False)
class LinearModel(Shown, StateSpace):
    """A closed loop in state space, with names `name_k` for joint k.

    Speeds, angles and their references are joint side, torques motor side.
    """

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
