"""Base parameters: the combinations of parameters that the torques of the joints can tell.

Gautier and Khalil, "Direct calculation of minimum set of inertial parameters of serial robots",
IEEE Trans. Robotics and Automation 6(3), 1990; by QR as in Gautier, "Numerical calculation of the
base inertial parameters of robots", J. Robotic Systems 8(4), 1991.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from sdt_drake.io.arrays import Array, Index
from sdt_drake.io.errors import InputError
from sdt_drake.machine.identify.regressor import PARAMETERS, Bodies, regressor
from sdt_drake.robot.robot import Robot

_SAMPLES = 200
_NOTHING = 1e-4
"""Of a column that is scaled to one, what no recording could show: files of robots say pi / 2 as
1.5708, which ties parameters to 1e-5 that are tied for good."""

_TIE = 1e-6
"""Smallest tie between columns that are scaled to one."""


@dataclass(frozen=True, eq=False)
class BaseParameters:
    """W phi = W[:, independent] beta with beta = combination @ phi, for every W of these columns.

    Attributes:
        names: of all p parameters.
        independent: those that the r base parameters beta are named after, shape (r,).
        combination: what beta is of all parameters, shape (r, p); 1 in the columns `independent`.
    """

    names: tuple[str, ...]
    independent: Index
    combination: Array

    @cached_property
    def words(self) -> list[str]:
        """Each base parameter as the sum that it is: "Izz of arm + 6.76 mass of gondola"."""
        return [
            self._sum(row, own) for row, own in zip(self.combination, self.independent, strict=True)
        ]

    def _sum(self, row: Array, own: int) -> str:
        others = (k for k in np.flatnonzero(np.abs(row) > 1e-5 * np.abs(row).max()) if k != own)
        return " ".join([self.names[own], *(_term(row[k], self.names[k]) for k in others)])

    @cached_property
    def identifiable(self) -> list[str]:
        """How each parameter can be identified, shape (p,): "alone", "in combination" or "not at
        all"."""
        # Its own part of its projection onto the row space: 1 where beta determines it.
        own = np.diagonal(np.linalg.pinv(self.combination) @ self.combination)
        said = {True: "alone", False: "in combination"}
        return ["not at all" if x < 1e-6 else said[bool(x > 1 - 1e-6)] for x in own]


def rigid_columns(
    robot: Robot, q: Array, v: Array, vd: Array, gravity: Array | None = None
) -> Array:
    """Columns of the torques of links and motors, joint side, shape (N, n, 11 n).

    Those of `regressor`, and for each motor that of its reflected inertia r² I_m; see
    `rigid_names` and `rigid_parameters`. Arguments as of `regressor`.
    """
    motors = vd[:, :, None] * np.eye(robot.n)
    return np.concatenate([regressor(robot, q, v, vd, gravity), motors], axis=2)


def rigid_names(robot: Robot) -> tuple[str, ...]:
    """Names of `rigid_columns`: "hx of gondola + payload", "motor inertia of roll"."""
    links = [f"{name} of {body}" for body in Bodies.of(robot).names for name in PARAMETERS]
    return (*links, *(f"motor inertia of {joint}" for joint in robot.joint_names))


def rigid_parameters(robot: Robot) -> Array:
    """The parameters of the robot's file, for `rigid_columns`, shape (11 n,)."""
    return np.concatenate([Bodies.of(robot).parameters.ravel(), robot.reflected_inertia])


@dataclass(frozen=True, eq=False)
class Unknown:
    """Which of `rigid_columns` are unknown; the others are those of the robot's file.

    Attributes:
        columns: the unknown ones.
        base: base parameters of these.
    """

    columns: Index
    base: BaseParameters

    @property
    def independent(self) -> Index:
        """The columns that the base parameters are named after."""
        return self.columns[self.base.independent]

    @staticmethod
    def everything(robot: Robot) -> Unknown:
        """Links and motors."""
        # Masses are last: they are what can be said by others; motors after them.
        links = np.arange(10 * robot.n)
        is_mass = links % 10 == 0
        order = [*links[~is_mass], *links[is_mass], *range(10 * robot.n, 11 * robot.n)]
        return _unknown(robot, np.arange(11 * robot.n), np.array(order))

    @staticmethod
    def body(robot: Robot, link: str) -> Unknown:
        """The ten parameters of the body that a link is part of.

        Raises:
            InputError: if no joint turns such a link.
        """
        names = Bodies.of(robot).names
        found = [k for k, name in enumerate(names) if link in name.split(" + ")]
        if not found:
            there = "; ".join(names)
            raise InputError(f"{robot.path}: no link '{link}' that moves, expected one of {there}")
        columns = 10 * found[0] + np.arange(len(PARAMETERS))
        return _unknown(robot, columns, np.array([*range(1, 10), 0]))

    @staticmethod
    def nothing() -> Unknown:
        """All is known."""
        return Unknown(np.arange(0), BaseParameters((), np.arange(0), np.zeros((0, 0))))


def _unknown(robot: Robot, columns: Index, order: Index) -> Unknown:
    """The unknown columns, tied as in random motions: what is tied there is tied always."""
    q, v, vd = np.random.default_rng(0).uniform(-np.pi, np.pi, (3, _SAMPLES, robot.n))
    every = rigid_columns(robot, q, v, vd).reshape(-1, 11 * robot.n)
    names = tuple(rigid_names(robot)[i] for i in columns)
    return Unknown(columns, base_parameters_of(every[:, columns], names, order))


def base_parameters_of(columns: Array, names: tuple[str, ...], order: Index) -> BaseParameters:
    """Base parameters of any columns, links and motors or not.

    Args:
        columns: W of torque = W phi, without noise, shape (rows, p), rows > p.
        names: of the parameters.
        order: in which parameters are taken for independent where they are, shape (p,).
    """
    size = np.linalg.norm(columns, axis=0)
    scale = np.where(size > _NOTHING * size.max(), size, np.inf)  # the rest has no effect at all
    scaled = columns / scale
    # |R_ii| is what of a column those before it do not say.
    is_free = np.abs(np.diagonal(np.linalg.qr(scaled[:, order], mode="r"))) > _NOTHING
    free, tied = order[is_free], order[~is_free]
    ties = np.linalg.lstsq(scaled[:, free], scaled[:, tied], rcond=None)[0]
    ties = np.where(np.abs(ties) > _TIE, ties, 0.0) * size[tied] / size[free, None]
    combination = np.zeros((len(free), len(names)))
    combination[:, free] = np.eye(len(free))
    combination[:, tied] = ties
    by_name = np.argsort(free)
    return BaseParameters(names, free[by_name], combination[by_name])


def _term(factor: float, name: str) -> str:
    size = "" if abs(abs(factor) - 1) < 1e-6 else f"{abs(factor):.4g} "
    return f"{'-' if factor < 0 else '+'} {size}{name}"
