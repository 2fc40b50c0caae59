"""Links that can be: the nearest to the robot's file that move as was measured.

The ten parameters of a body are those of some distribution of mass if and only if its
pseudo-inertia

    P = [Sigma h; h' m],  Sigma = trace(I) / 2 - I

is positive definite (Wensing, Kim, Slotine, "Linear matrix inequalities for physically consistent
inertial parameter identification", IEEE Robotics and Automation Letters 3(1), 2018). How far it is
from that of the file is measured by the entropic divergence of Lee, Wensing and Park, "Geometric
robot dynamic identification: a convex programming approach", IEEE Trans. Robotics 36(2), 2020,

    D = trace(P0^-1 P) - log det(P0^-1 P) - 4

which does not depend on frames and units. First, links that can be are found that leave the least
of the torques: those minimise (beta - beta_measured)' X'WX (beta - beta_measured). What a recording
decides is decided there, and the file has no say. Then, among all with base parameters within a
standard deviation of these, the links with the smallest

    sum of D + motors' (a / a0 - 1)² / 2

so that the file decides alone what the recording leaves open.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydrake.solvers import ClarabelSolver, MathematicalProgram

from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError
from sdt_drake.machine.identify.base_parameters import Unknown
from sdt_drake.machine.identify.regressor import Bodies
from sdt_drake.robot.robot import Robot
from sdt_drake.robot.sdf import SYMMETRIC, body_of, pseudo_inertia, symmetric

_LEAST = 1e-3  # of a motor's scale: rotors have inertia
_TOOL = (0.05, 0.1)  # of the robot's mass, and of its reach: what a light link may carry
_QUICK = 50.0  # rad/s², of a motor that turns nothing but itself; those of small joints are quicker


@dataclass(frozen=True, eq=False)
class Link:
    """A link of the robot's file.

    Attributes:
        name: of the link.
        body: joint that turns it, from 0.
        pseudo: pseudo-inertia in the frame of that body, shape (4, 4).
        to_link: pose of that frame in the frame of the link, shape (4, 4).
    """

    name: str
    body: int
    pseudo: Array
    to_link: Array

    def inertial(self, pseudo: Array) -> tuple[float, Array, Array]:
        """Mass [kg], centre [m], central inertia [kg m²] in the link's frame, of another pseudo."""
        return body_of(self.to_link @ pseudo @ self.to_link.T)


@dataclass(frozen=True, eq=False)
class Consistent:
    """What can be: links and motors, the nearest to what was measured.

    Attributes:
        links: those that were free.
        pseudo: their pseudo-inertias, each of shape (4, 4).
        motors: reflected inertia of every motor [kg m²], shape (n,).
        beta: base parameters of it, shape (r,).
    """

    links: list[Link]
    pseudo: list[Array]
    motors: Array
    beta: Array


def links_of(robot: Robot) -> list[Link]:
    """The moving links of a robot."""
    plant, context = robot.plant, robot.plant.CreateDefaultContext()
    links = []
    for k, name in enumerate(robot.joint_names):
        joint = plant.GetJointByName(name)
        frame = joint.frame_on_child()
        for link in plant.GetBodiesWeldedTo(joint.child_body()):
            inertia = plant.CalcSpatialInertia(context, frame, [link.index()])
            central = inertia.Shift(inertia.get_com()).CalcRotationalInertia()
            mass, com = inertia.get_mass(), inertia.get_com()
            pseudo = pseudo_inertia(mass, com, central.CopyToFullMatrix3())
            pose = frame.CalcPose(context, link.body_frame()).GetAsMatrix4()
            links.append(Link(link.name(), k, pseudo, pose))
    return links


def parameters_of(pseudo: Array) -> Array:
    """The ten parameters of `regressor` that a pseudo-inertia stands for; linear in it."""
    sigma = pseudo[:3, :3]
    moments = np.trace(sigma) * np.eye(3) - sigma
    return np.array([pseudo[3, 3], *pseudo[:3, 3], *moments[np.triu_indices(3)]])


def nearest_consistent(
    robot: Robot,
    unknown: Unknown,
    free: Sequence[str],
    beta: Array,
    misfit: Array,
    covariance: Array,
) -> Consistent:
    """The robot nearest to `robot` among those that can be and explain the torques best.

    Args:
        robot: of the file.
        unknown: what was measured.
        free: names of the links that may change; without the bodies that are unknown, none.
        beta: the measured base parameters, shape (r,).
        misfit: their covariance as least squares has it, in noise that is not coloured: its inverse
            tells how much more of the torques another beta leaves, shape (r, r).
        covariance: how sure they are, shape (r, r).

    Raises:
        InputError: if the solver finds none.
    """
    every = links_of(robot)
    links = [link for link in every if link.name in free and link.pseudo[3, 3] > 0]
    is_free = np.isin(10 * robot.n + np.arange(robot.n), unknown.columns)
    if not (links or is_free.any()):
        return Consistent([], [], robot.reflected_inertia, beta)
    fixed = np.zeros(11 * robot.n)
    for link in every:
        if link not in links:
            fixed[10 * link.body : 10 * link.body + 10] += parameters_of(link.pseudo)
    fixed[10 * robot.n :] = np.where(is_free, 0.0, robot.reflected_inertia)
    space = _Space(robot, unknown, links, is_free, fixed)
    best = unknown.base.combination @ space.explaining(beta, misfit)[unknown.columns]
    x, phi = space.nearest(best, covariance)
    pseudo = [
        _root(link.pseudo) @ symmetric(x[10 * i : 10 * i + 10]) @ _root(link.pseudo).T
        for i, link in enumerate(links)
    ]
    motors = phi[10 * robot.n :]
    return Consistent(links, pseudo, motors, unknown.base.combination @ phi[unknown.columns])


@dataclass(frozen=True, eq=False)
class _Space:
    """Links that can be, and motors.

    Attributes:
        robot: of the file.
        unknown: what was measured.
        links: the free ones.
        is_free: motors that are, shape (n,).
        fixed: what all parameters have of the others, shape (11 n,).
    """

    robot: Robot
    unknown: Unknown
    links: list[Link]
    is_free: NDArray[np.bool_]
    fixed: Array

    def explaining(self, beta: Array, misfit: Array) -> Array:
        """All parameters, shape (11 n,), that explain the torques best."""
        program, unknowns, effect, missed, _ = self._program(beta, misfit, near=False)
        program.Add2NormSquaredCost(np.eye(len(beta)), np.zeros(len(beta)), missed)
        return self.fixed + effect @ self._solved(program, unknowns)

    def nearest(self, beta: Array, covariance: Array) -> tuple[Array, Array]:
        """Variables, and all parameters, of the robot nearest to the file within a standard
        deviation of base parameters."""
        program, unknowns, effect, missed, one = self._program(beta, covariance, near=True)
        program.AddBoundingBoxConstraint(1, 1, one)
        program.AddLorentzConeConstraint(np.concatenate([one, missed]))
        x = self._solved(program, unknowns)
        return x, self.fixed + effect @ x

    def _program(
        self, beta: Array, covariance: Array, *, near: bool
    ) -> tuple[MathematicalProgram, Array, Array, Array, Array]:
        """A program, its variables, what they do to all parameters, and by how many standard
        deviations they miss beta: variables, so that the solver's tolerance is of these; `near`
        costs how far links are from those of the file."""
        program, robot = MathematicalProgram(), self.robot
        parts = [_add_link(program, robot, link, near=near) for link in self.links]
        if self.is_free.any():
            parts.append(_add_motors(program, robot, self.is_free, near=near))
        unknowns, maps = (list(x) for x in zip(*parts, strict=True))
        missed = program.NewContinuousVariables(len(beta))
        one = program.NewContinuousVariables(1)
        K, columns, sure = (
            self.unknown.base.combination,
            self.unknown.columns,
            _whitening(covariance),
        )
        effect = np.hstack(maps)
        program.AddLinearEqualityConstraint(
            np.hstack([sure @ K @ effect[columns], np.eye(len(beta))]),
            sure @ (beta - K @ self.fixed[columns]),
            np.concatenate([*unknowns, missed]),
        )
        return program, np.concatenate(unknowns), effect, missed, one

    def _solved(self, program: MathematicalProgram, unknowns: Array) -> Array:
        result = ClarabelSolver().Solve(program)
        if not result.is_success():
            raise InputError(
                f"{self.robot.path}: no links that can be have the measured parameters "
                f"({result.get_solution_result().name})"
            )
        return np.asarray(result.GetSolution(unknowns))


def _add_link(
    program: MathematicalProgram, robot: Robot, link: Link, *, near: bool
) -> tuple[Array, Array]:
    """Variables Z of a link, 1 for that of the file, and what they do to all parameters."""
    Z = program.NewSymmetricContinuousVariables(4)
    if near:
        program.AddMaximizeLogDeterminantCost(Z)
        program.AddLinearCost(Z[0, 0] + Z[1, 1] + Z[2, 2] + Z[3, 3])
    else:
        program.AddPositiveSemidefiniteConstraint(Z)
    entries = np.array([Z[i, j] for i, j in SYMMETRIC])
    return entries, effect_of(robot, link, _root(link.pseudo))


def _add_motors(
    program: MathematicalProgram, robot: Robot, is_free: NDArray[np.bool_], *, near: bool
) -> tuple[Array, Array]:
    """Variables of the free motors, and what they do to all parameters."""
    scale = motor_scale(robot)
    motors = program.NewContinuousVariables(int(is_free.sum()))
    program.AddBoundingBoxConstraint(_LEAST, np.inf, motors)
    was = (robot.reflected_inertia / scale)[is_free]
    if near:
        program.AddQuadraticErrorCost(np.eye(len(was)), was, motors)
    effect = np.vstack([np.zeros((10 * robot.n, robot.n)), np.diag(scale)])
    return motors, effect[:, is_free]


def effect_of(robot: Robot, link: Link, factor: Array) -> Array:
    """What the ten entries SYMMETRIC of Z do to all parameters, shape (11 n, 10), where a link has
    the pseudo-inertia F Z F' in the frame of its body, F the factor of shape (4, 4)."""
    effect = np.zeros((11 * robot.n, 10))
    units = map(symmetric, np.eye(10))
    own = [parameters_of(factor @ unit @ factor.T) for unit in units]
    effect[10 * link.body : 10 * link.body + 10] = np.column_stack(own)
    return effect


def motor_scale(robot: Robot) -> Array:
    """How large reflected inertias of motors are: those of the file, or where it gives none what
    the largest torque turns at `_QUICK`, as wrists' motors have more than their links [kg m²],
    shape (n,)."""
    given = robot.reflected_inertia
    return np.asarray(np.where(given > 0, given, robot.effort_limit / _QUICK))


def rigid_scale(robot: Robot) -> Array:
    """How large the parameters of links and motors are, in the order of `rigid_columns`, shape
    (11 n,): by mass and radius of gyration about the joint's frame."""
    bodies = Bodies.of(robot)
    own, trace = bodies.parameters[:, 0], bodies.parameters[:, [4, 7, 9]].sum(axis=1) / 2
    mass = np.maximum(own, _TOOL[0] * own.sum())
    reach = np.linalg.norm(bodies.position, axis=1).sum()
    gyration = np.maximum(trace / np.maximum(own, 1e-9), (_TOOL[1] * reach) ** 2)  # m²
    # Of mass, first moments and inertias.
    links = np.repeat(mass * gyration ** np.array([[0], [0.5], [1]]), [1, 3, 6], axis=0).T
    return np.concatenate([links.ravel(), motor_scale(robot)])


def _root(pseudo: Array) -> Array:
    """L of P = L L', of a body that has some extent in all directions."""
    sigma = pseudo[:3, :3] - np.outer(pseudo[:3, 3], pseudo[:3, 3]) / pseudo[3, 3]
    least = 1e-4 * max(float(np.linalg.eigvalsh(sigma)[-1]), 1e-6 * pseudo[3, 3])
    values, vectors = np.linalg.eigh(sigma)
    body = pseudo.copy()
    body[:3, :3] += vectors @ np.diag(np.maximum(least - values, 0.0)) @ vectors.T
    return np.asarray(np.linalg.cholesky(body), dtype=np.float64)


def _whitening(covariance: Array) -> Array:
    """W of S^-1 = W' W."""
    size = np.sqrt(np.diagonal(covariance))
    values, vectors = np.linalg.eigh(covariance / np.outer(size, size))
    return (vectors / np.sqrt(np.maximum(values, 1e-12))).T / size
