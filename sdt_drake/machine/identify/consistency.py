"""Physically consistent links: the closest to the robot's file that explain the measurements.

Ten parameters belong to a distribution of mass if and only if the pseudo-inertia

    P = [Sigma h; h' m],  Sigma = trace(I) / 2 - I

is positive definite (Wensing, Kim, Slotine, "Linear matrix inequalities for physically consistent
inertial parameter identification", IEEE Robotics and Automation Letters 3(1), 2018). The distance
from the pseudo-inertia P0 of the file is the entropic divergence of Lee, Wensing and Park,
"Geometric robot dynamic identification: a convex programming approach", IEEE Trans. Robotics 36(2),
2020,

    D = trace(P0^-1 P) - log det(P0^-1 P) - 4

which does not depend on frames and units. The calculation has two steps:

1. Find the consistent links with the smallest residual torques. They minimise
   (beta - beta_measured)' X'WX (beta - beta_measured). The file has no influence here.
2. Among all consistent links within a standard deviation of these base parameters, minimise the sum
   of D and of (a / a0 - 1)² / 2 of the motors. The file decides only what the recording leaves
   open.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydrake.solvers import ClarabelSolver, MathematicalProgram

from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError
from sdt_drake.machine.identify.base_parameters import Unknown, motor_parameters
from sdt_drake.machine.identify.regressor import Bodies
from sdt_drake.robot.robot import Robot
from sdt_drake.robot.rotors import assumed_inertia
from sdt_drake.robot.sdf import SYMMETRIC, body_of, pseudo_inertia, symmetric

_MIN_MOTOR = 1e-9  # smallest reflected inertia over its scale
_MIN_EIGENVALUE = 1e-8  # of the pseudo-inertia of a written link over that of the file
_MAX_SENSITIVITY = 1e6  # standard deviations of beta by which a change of a whole link shows
_TOOL = (0.05, 0.1)  # tool that a light link may carry: share of the robot's mass and reach


@dataclass(frozen=True, eq=False)
class Link:
    """A link of the robot's file."""

    name: str
    """The link's name."""
    body: int
    """The joint that turns it, from 0."""
    pseudo: Array
    """Pseudo-inertia in the frame of the joint's body, shape (4, 4)."""
    to_link: Array
    """Pose of the body's frame in the link's frame, shape (4, 4)."""

    def inertial(self, pseudo: Array) -> tuple[float, Array, Array]:
        """Return mass [kg], centre [m] and central inertia [kg m²] in the link's frame.

        Args:
            pseudo: Pseudo-inertia in the frame of the joint's body, shape (4, 4).
        """
        return body_of(self.to_link @ pseudo @ self.to_link.T)


@dataclass(frozen=True, eq=False)
class Consistent:
    """The physically consistent links and motors that are closest to the measurements."""

    links: list[Link]
    """The links that were free."""
    pseudo: list[Array]
    """Identified pseudo-inertias of these links, each of shape (4, 4)."""
    motors: Array
    """Reflected inertia of every motor [kg m²], shape (n,)."""
    beta: Array
    """Base parameters of these links and motors, shape (r,)."""


def links_of(robot: Robot) -> list[Link]:
    """Return the moving links of a robot."""
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
    """Return the ten parameters of `regressor` of a pseudo-inertia; linear in it."""
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
    """Return the consistent links and motors closest to `robot` that explain the torques best.

    Args:
        robot: The robot of the file.
        unknown: The parameters that were measured.
        free: Names of the links that may change.
        beta: Measured base parameters, shape (r,).
        misfit: Covariance of beta for white noise, shape (r, r). Its inverse weights deviations
            from beta by the residual torque that they add.
        covariance: Covariance of beta for coloured noise, shape (r, r).

    Raises:
        InputError: The solver finds no consistent links.
    """
    every = links_of(robot)
    links = [link for link in every if link.name in free and link.pseudo[3, 3] > 0]
    is_free = np.isin(10 * robot.n + np.arange(robot.n), unknown.columns)
    if not (links or is_free.any()):
        return Consistent([], [], motor_parameters(robot), beta)
    fixed = np.zeros(11 * robot.n)
    for link in every:
        if link not in links:
            fixed[10 * link.body : 10 * link.body + 10] += parameters_of(link.pseudo)
    fixed[10 * robot.n :] = np.where(is_free, 0.0, motor_parameters(robot))
    space = _Space(robot, unknown, links, is_free, fixed)
    fitted = space.closest(beta, misfit, near=False)
    if fitted is None:
        raise InputError(
            f"{robot.path}: no physically consistent links are found that have such torques"
        )
    best = unknown.base.combination @ fitted[1][unknown.columns]
    # Where hardly any others are as good, the solver may find none; the fitted ones are left.
    x, phi = space.closest(best, covariance, near=True) or fitted
    pseudo = [
        _root(link.pseudo) @ symmetric(x[10 * i : 10 * i + 10]) @ _root(link.pseudo).T
        for i, link in enumerate(links)
    ]
    motors = phi[10 * robot.n :]
    return Consistent(links, pseudo, motors, unknown.base.combination @ phi[unknown.columns])


@dataclass(frozen=True, eq=False)
class _Space:
    """The set of consistent links and motors."""

    robot: Robot
    """The robot of the file."""
    unknown: Unknown
    """The parameters that were measured."""
    links: list[Link]
    """The free links."""
    is_free: NDArray[np.bool_]
    """Mask of the free motors, shape (n,)."""
    fixed: Array
    """Contribution of fixed links and motors to all parameters, shape (11 n,)."""

    def closest(self, beta: Array, covariance: Array, *, near: bool) -> tuple[Array, Array] | None:
        """Find consistent links and motors whose base parameters are close to beta.

        Variables are the entries SYMMETRIC of Z of each link, 1 for the link of the file, and the
        free motors over their scale.

        Args:
            beta: Base parameters, shape (r,).
            covariance: Covariance of beta, shape (r, r).
            near: True for the closest to the file within a standard deviation of beta, False for
                the smallest deviation from beta.

        Returns:
            The variables of the program, and all parameters, shape (11 n,); None if the solver
            finds none.
        """
        program, robot, n = MathematicalProgram(), self.robot, self.robot.n
        K, columns = self.unknown.base.combination, self.unknown.columns
        sure = _whitening(covariance)
        effects = [effect_of(robot, link, _root(link.pseudo)) for link in self.links]
        unknowns = []
        for _ in self.links:
            Z = program.NewSymmetricContinuousVariables(4)
            if near:
                program.AddMaximizeLogDeterminantCost(Z)
                program.AddLinearCost(Z[0, 0] + Z[1, 1] + Z[2, 2] + Z[3, 3])
            else:
                program.AddPositiveSemidefiniteConstraint(Z)
            unknowns.append(np.array([Z[i, j] for i, j in SYMMETRIC]))
        if self.is_free.any():
            scale = motor_scale(robot)
            motors = program.NewContinuousVariables(int(self.is_free.sum()))
            program.AddBoundingBoxConstraint(_MIN_MOTOR, np.inf, motors)
            if near:
                was = (motor_parameters(robot) / scale)[self.is_free]
                program.AddQuadraticErrorCost(np.eye(len(was)), was, motors)
            effects.append(np.vstack([np.zeros((10 * n, n)), np.diag(scale)])[:, self.is_free])
            unknowns.append(motors)
        missed = program.NewContinuousVariables(len(beta))  # deviation in standard deviations
        one = program.NewContinuousVariables(1)
        variables, effect = np.concatenate(unknowns), np.hstack(effects)
        # Exact data determine links to 1e-9, the solver to 1e-6 of those of the file. Only what is
        # known better may deviate by more than its standard deviation.
        sensitivity = np.abs(sure @ K @ effect[columns]).max(axis=1, initial=0.0)
        sensitivity = sensitivity if near else sensitivity.max(initial=0.0)
        sure = (sure.T * np.minimum(1.0, _MAX_SENSITIVITY / np.maximum(sensitivity, 1e-300))).T
        program.AddLinearEqualityConstraint(
            np.hstack([sure @ K @ effect[columns], np.eye(len(beta))]),
            sure @ (beta - K @ self.fixed[columns]),
            np.concatenate([variables, missed]),
        )
        if near:
            program.AddBoundingBoxConstraint(1, 1, one)
            program.AddLorentzConeConstraint(np.concatenate([one, missed]))
        else:
            program.Add2NormSquaredCost(np.eye(len(beta)), np.zeros(len(beta)), missed)
        result = ClarabelSolver().Solve(program)
        if not result.is_success():
            return None
        x = np.asarray(result.GetSolution(variables))
        first = 10 * len(self.links)
        for at in range(0, first, 10):
            x[at : at + 10] = _possible(x[at : at + 10])
        x[first:] = np.maximum(x[first:], _MIN_MOTOR)  # which the solver misses by its tolerance
        return x, self.fixed + effect @ x


def effect_of(robot: Robot, link: Link, factor: Array) -> Array:
    """Return the effect of the entries SYMMETRIC of Z on all parameters, shape (11 n, 10).

    The link has the pseudo-inertia F Z F' in the frame of its body, with the factor F, shape
    (4, 4).
    """
    effect = np.zeros((11 * robot.n, 10))
    units = map(symmetric, np.eye(10))
    own = [parameters_of(factor @ unit @ factor.T) for unit in units]
    effect[10 * link.body : 10 * link.body + 10] = np.column_stack(own)
    return effect


def motor_scale(robot: Robot) -> Array:
    """Return the typical reflected inertia of each motor [kg m²], shape (n,).

    It is that of the file. Where the file has none, it is the assumed one.
    """
    given = motor_parameters(robot)
    return np.asarray(np.where(given > 0, given, assumed_inertia(robot)))


def rigid_scale(robot: Robot) -> Array:
    """Return the typical size of each parameter of `rigid_columns`, shape (11 n,).

    Sizes of links follow from the mass and the radius of gyration about the joint's frame.
    """
    bodies = Bodies.of(robot)
    own, trace = bodies.parameters[:, 0], bodies.parameters[:, [4, 7, 9]].sum(axis=1) / 2
    mass = np.maximum(own, _TOOL[0] * own.sum())
    reach = np.linalg.norm(bodies.position, axis=1).sum()
    gyration = np.maximum(trace / np.maximum(own, 1e-9), (_TOOL[1] * reach) ** 2)  # m²
    # One column of mass, three of first moments, six of inertias.
    links = np.repeat(mass * gyration ** np.array([[0], [0.5], [1]]), [1, 3, 6], axis=0).T
    return np.concatenate([links.ravel(), motor_scale(robot)])


def _root(pseudo: Array) -> Array:
    """Return L of P = L L', for the body made at least slightly extended in all directions."""
    sigma = pseudo[:3, :3] - np.outer(pseudo[:3, 3], pseudo[:3, 3]) / pseudo[3, 3]
    least = 1e-4 * max(float(np.linalg.eigvalsh(sigma)[-1]), 1e-6 * pseudo[3, 3])
    values, vectors = np.linalg.eigh(sigma)
    body = pseudo.copy()
    body[:3, :3] += vectors @ np.diag(np.maximum(least - values, 0.0)) @ vectors.T
    return np.asarray(np.linalg.cholesky(body), dtype=np.float64)


def _possible(entries: Array) -> Array:
    """Return the entries SYMMETRIC of Z without eigenvalues that the solver left below 0."""
    values, vectors = np.linalg.eigh(symmetric(entries))
    Z = (vectors * np.maximum(values, _MIN_EIGENVALUE)) @ vectors.T
    return np.array([Z[i, j] for i, j in SYMMETRIC])


def _whitening(covariance: Array) -> Array:
    """Return W of S^-1 = W' W for a covariance S."""
    size = np.sqrt(np.diagonal(covariance))
    values, vectors = np.linalg.eigh(covariance / np.outer(size, size))
    return (vectors / np.sqrt(np.maximum(values, 1e-12))).T / size
