"""Likely orders of a recording's columns, by the torques of the file's links.

Every column is tried at every joint, and the columns are assigned to the joints with the least
residual in all. A residual is what the file's links and any friction leave of a torque, over the
torque; its logarithms are added. With other positions the torques of the links change. So for
these the assignment starts from the order of the file, from the reverse, from that of the joints'
names (as ROS publishes them) and from the sizes of the torques, and two joints are swapped as long
as that leaves less.
"""

from itertools import combinations

import numpy as np
from scipy.optimize import linear_sum_assignment

from sdt_drake.io.arrays import Array, Index, Mask
from sdt_drake.machine.diagnose import constants as c
from sdt_drake.machine.diagnose import explained
from sdt_drake.robot.dynamics import inverse_dynamics
from sdt_drake.robot.robot import Robot


def likely_orders(
    robot: Robot, q: Array, v: Array, vd: Array, tau: Array, moves: Mask
) -> tuple[Index, Index, Index]:
    """Return likely orders of the torques, of the positions, and of all columns.

    An order has the column of each joint, from 0, shape (n,).

    Args:
        robot: The robot of the file.
        q, v, vd: Motion as it was read [rad, rad/s, rad/s²], shape (M, n).
        tau: Torques as they were read [N m], shape (M, n).
        moves: Mask of the joints that move, shape (M, n).
    """
    few = np.unique(np.linspace(0, len(q) - 1, c.ORDER_ROWS).astype(int))
    search = _Search(robot, q[few], v[few], vd[few], tau[few], moves[few])
    plain = np.arange(robot.n)
    torques, _ = search.assigned(plain)
    sizes = np.argsort(np.argsort(-robot.effort_limit))
    starts = [
        plain,
        plain[::-1],
        np.argsort(np.argsort(robot.joint_names)),
        np.argsort(-np.abs(tau).max(axis=0))[sizes],
    ]
    whole = min((search.best(start, start) for start in starts), key=lambda x: x[1])[0]
    return torques, search.best(plain, None)[0], whole


class _Search:
    """A search for the order with the least residual."""

    def __init__(self, robot: Robot, q: Array, v: Array, vd: Array, tau: Array, moves: Mask):
        self.robot, self.motion, self.tau, self.moves = robot, (q, v, vd), tau, moves
        self.known: dict[tuple[int, ...], Array] = {}

    def left(self, places: Index) -> Array:
        """Return the logarithm of the residual of each torque at each joint, shape (n, n).

        Positions are in the order `places`. A row is for a joint, a column for a torque.
        """
        key = tuple(places.tolist())
        if key not in self.known:
            self.known[key] = self._left(places)
        return self.known[key]

    def _left(self, places: Index) -> Array:
        q, v, vd = (x[:, places] for x in self.motion)
        links, moves = inverse_dynamics(self.robot, q, v, vd), self.moves[:, places]
        speed = explained.over_largest(self.robot.gear_speed(v))
        left = np.zeros(2 * links.shape[1:])
        for k in range(len(places)):
            used = moves[:, k, None].astype(float)
            known = explained.basis(used * explained.like_friction(speed[:, k], c.FRICTION_WIDTHS))
            torque = explained.without(known, used * self.tau)
            off = torque - explained.without(known, used[:, 0] * links[:, k])[:, None]
            size = np.maximum(np.linalg.norm(torque, axis=0), 1e-300)
            left[k] = np.log(np.linalg.norm(off, axis=0) / size + c.RESIDUAL_FLOOR)
        return left

    def assigned(self, places: Index) -> tuple[Index, float]:
        """Return the order of the torques that leaves least with positions in an order."""
        left = self.left(places)
        rows, order = linear_sum_assignment(left)
        return order, float(left[rows, order].sum())

    def score(self, places: Index, order: Index | None) -> float:
        """Return the residual of an order of positions and torques; None: as read."""
        left, rows = self.left(places), np.arange(len(places))
        return float(left[rows, rows if order is None else order].sum())

    def best(self, places: Index, order: Index | None) -> tuple[Index, float]:
        """Return the order of positions, and torques with them, from a start, and its residual."""
        now = self.score(places, order)
        while True:
            tried = [_swapped(places, *pair) for pair in combinations(range(len(places)), 2)]
            if order is not None:
                tried.append(self.assigned(places)[0])
            scores = [self.score(x, None if order is None else x) for x in tried]
            k = int(np.argmin(scores))
            if scores[k] >= now - 1e-9:
                return places, now
            places, now = tried[k], scores[k]
            order = None if order is None else places


def _swapped(order: Index, j: int, k: int) -> Index:
    other = order.copy()
    other[[j, k]] = order[[k, j]]
    return other
