"""Base parameters: the combinations of parameters that determine the joint torques.

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

_SAMPLES = 200  # random states that reveal which columns are dependent
_MIN_COLUMN = 1e-4
"""Smallest independent part of a column of length 1. Robot files round pi / 2 to 1.5708, which
leaves 1e-5 of a column that is dependent in truth."""

_MIN_TIE = 1e-6
"""Smallest coefficient between columns of length 1."""


@dataclass(frozen=True, eq=False)
class BaseParameters:
    """The base parameters beta = combination @ phi of parameters phi.

    W phi = W[:, independent] beta for every matrix W of these columns.
    """

    names: tuple[str, ...]
    """Names of all p parameters."""
    independent: Index
    """Indices of the parameters that name the r base parameters, shape (r,)."""
    combination: Array
    """Coefficients of all parameters in beta, shape (r, p); 1 in the columns `independent`."""

    @cached_property
    def words(self) -> list[str]:
        """Each base parameter as a sum of parameters: "Izz of arm + 6.76 mass of gondola"."""
        return [
            self._sum(row, own) for row, own in zip(self.combination, self.independent, strict=True)
        ]

    def _sum(self, row: Array, own: int) -> str:
        others = (k for k in np.flatnonzero(np.abs(row) > 1e-5 * np.abs(row).max()) if k != own)
        return " ".join([self.names[own], *(_term(row[k], self.names[k]) for k in others)])

    @cached_property
    def identifiable(self) -> list[str]:
        """The identifiability of each parameter: "alone", "in combination" or "not at all"."""
        # Diagonal of the projection onto the row space: 1 where beta determines the parameter.
        own = np.diagonal(np.linalg.pinv(self.combination) @ self.combination)
        words = {True: "alone", False: "in combination"}
        return ["not at all" if x < 1e-6 else words[bool(x > 1 - 1e-6)] for x in own]


def rigid_columns(
    robot: Robot, q: Array, v: Array, vd: Array, gravity: Array | None = None
) -> Array:
    """Return the columns of the torques at the outputs of the gears, shape (N, n, 11 n).

    They are torques of the joints unless a motor turns with two. The first 10 n columns belong to
    the links, see `regressor` with its arguments. The last n belong to the reflected inertias
    r² I_m of the motors, each at its own gear. See `rigid_names` and `rigid_parameters`.
    """
    links = regressor(robot, q, v, vd, gravity)
    if robot.is_coupled:
        links = robot.gear_torque(links.swapaxes(1, 2)).swapaxes(1, 2)
    motors = robot.gear_speed(vd)[:, :, None] * np.eye(robot.n)
    return np.concatenate([links, motors], axis=2)


def rigid_names(robot: Robot) -> tuple[str, ...]:
    """Return the names of `rigid_columns`: "hx of gondola + payload", "motor inertia of roll"."""
    links = [f"{name} of {body}" for body in Bodies.of(robot).names for name in PARAMETERS]
    return (*links, *(f"motor inertia of {joint}" for joint in robot.joint_names))


def rigid_parameters(robot: Robot) -> Array:
    """Return the parameters of the robot's file in the order of `rigid_columns`, shape (11 n,)."""
    return np.concatenate([Bodies.of(robot).parameters.ravel(), motor_parameters(robot)])


def motor_parameters(robot: Robot) -> Array:
    """Return the reflected inertia r² I_m of each motor at its gear [kg m²], shape (n,)."""
    return robot.gear_ratio**2 * robot.rotor_inertia


@dataclass(frozen=True, eq=False)
class Unknown:
    """The selection of parameters to identify; the others keep the values of the robot's file."""

    columns: Index
    """Indices of the unknown columns of `rigid_columns`."""
    base: BaseParameters
    """Base parameters of the unknown columns."""

    @property
    def independent(self) -> Index:
        """The columns of `rigid_columns` that name the base parameters, shape (r,)."""
        return self.columns[self.base.independent]

    @staticmethod
    def everything(robot: Robot) -> Unknown:
        """Select the parameters of all links and motors."""
        # Masses come after other link parameters, which can express them; motors are last.
        links = np.arange(10 * robot.n)
        is_mass = links % 10 == 0
        order = [*links[~is_mass], *links[is_mass], *range(10 * robot.n, 11 * robot.n)]
        return _unknown(robot, np.arange(11 * robot.n), np.array(order))

    @staticmethod
    def body(robot: Robot, link: str) -> Unknown:
        """Select the ten parameters of the body that contains a link.

        Raises:
            InputError: if no joint turns such a link.
        """
        names = Bodies.of(robot).names
        found = [k for k, name in enumerate(names) if link in name.split(" + ")]
        if not found:
            there = "; ".join(names)
            raise InputError(f"{robot.path}: no moving link '{link}', expected one of {there}")
        columns = 10 * found[0] + np.arange(len(PARAMETERS))
        return _unknown(robot, columns, np.array([*range(1, 10), 0]))

    @staticmethod
    def nothing() -> Unknown:
        """Select no parameter: all keep the values of the file."""
        return Unknown(np.arange(0), BaseParameters((), np.arange(0), np.zeros((0, 0))))


def _unknown(robot: Robot, columns: Index, order: Index) -> Unknown:
    """Return the base parameters of these columns, by their dependence in random states."""
    q, v, vd = np.random.default_rng(0).uniform(-np.pi, np.pi, (3, _SAMPLES, robot.n))
    every = rigid_columns(robot, q, v, vd).reshape(-1, 11 * robot.n)
    names = tuple(rigid_names(robot)[i] for i in columns)
    return Unknown(columns, base_parameters_of(every[:, columns], names, order))


def base_parameters_of(columns: Array, names: tuple[str, ...], order: Index) -> BaseParameters:
    """Return the base parameters of any columns.

    Args:
        columns: W of torque = W phi, without noise, shape (rows, p), rows > p.
        names: Names of the parameters.
        order: Priority of the parameters as independent ones, shape (p,).
    """
    size = np.linalg.norm(columns, axis=0)
    scale = np.where(size > _MIN_COLUMN * size.max(), size, np.inf)  # others have no effect
    scaled = columns / scale
    # |R_ii| is the part of a column that is independent of those before it.
    is_free = np.abs(np.diagonal(np.linalg.qr(scaled[:, order], mode="r"))) > _MIN_COLUMN
    free, tied = order[is_free], order[~is_free]
    ties = np.linalg.lstsq(scaled[:, free], scaled[:, tied], rcond=None)[0]
    ties = np.where(np.abs(ties) > _MIN_TIE, ties, 0.0) * size[tied] / size[free, None]
    combination = np.zeros((len(free), len(names)))
    combination[:, free] = np.eye(len(free))
    combination[:, tied] = ties
    by_name = np.argsort(free)
    return BaseParameters(names, free[by_name], combination[by_name])


def _term(factor: float, name: str) -> str:
    size = "" if abs(abs(factor) - 1) < 1e-6 else f"{abs(factor):.4g} "
    return f"{'-' if factor < 0 else '+'} {size}{name}"
