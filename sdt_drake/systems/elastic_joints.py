from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from pydrake.systems.framework import Context
from pydrake.systems.primitives import LinearSystem, MatrixGain, Multiplexer

from sdt_drake.io.errors import checked_positive
from sdt_drake.robot.device import Springs
from sdt_drake.systems.wiring import Wired


class ElasticJoints(Wired):
    """Springs and dampers between the motors and the links, where a joint is elastic.

        r I_m dw/dt = tau - tau_link,    dtheta/dt = w
        r tau_link  = k (theta - q) + c (w - v)

    Torques and I_m motor side; theta, w of the motors, q, v of the links, k and c joint side. The
    plant behind it must not have the rotor inertia of an elastic joint once more. At rigid joints
    tau_link is tau, and the motor has the state of the link. State: theta and w of the others.

    Args:
        springs: of n joints, at least one of them elastic.
        rotor_inertia: I_m, motor side [kg m²], shape (n,), > 0 at elastic joints.
        gear_ratio: r [-], shape (n,), > 0.

    .. pydrake_system::

        name: ElasticJoints
        input_ports: [tau, state]
        output_ports: [tau_link, motor_state]
    """

    symbol = "elastic\njoints"

    def __init__(
        self, *, springs: Springs, rotor_inertia: ArrayLike, gear_ratio: ArrayLike
    ) -> None:
        super().__init__()
        n = len(springs.stiffness)
        r = checked_positive(gear_ratio, "gear_ratio", n)
        self._axes = axes = np.flatnonzero(springs.elastic)
        m, reflected = len(axes), np.diag(1 / (r**2 * np.asarray(rotor_inertia))[axes])
        pick, rigid = np.eye(n)[axes], np.diag(1.0 * ~springs.elastic)
        both, back = np.kron(np.eye(2), pick), (pick / r).T  # of [q, v]; to the motors' side
        wound = np.hstack([np.diag(springs.stiffness[axes]), np.diag(springs.damping[axes])])
        # Inputs in the order tau, q, v; a state [theta, w] of the elastic joints alone.
        motors = LinearSystem(
            A=np.vstack([np.eye(2 * m)[m:], -reflected @ wound]),
            B=np.vstack([np.zeros((m, 3 * n)), reflected @ np.hstack([pick * r, wound @ both])]),
            C=np.eye(2 * m),
            D=np.zeros((2 * m, 3 * n)),
        )
        to_links = np.hstack([rigid, -back @ wound @ both, back @ wound])
        of_motors = np.hstack([np.kron(np.eye(2), rigid), both.T])

        self.add("inputs", Multiplexer([n, 2 * n]), "tau", "state", "inputs")
        self._motors = self.add("motors", motors, "inputs", "motors")
        self.add("with_motors", Multiplexer([3 * n, 2 * m]), "inputs", "motors", "with_motors")
        self.add("tau_link", MatrixGain(to_links), "with_motors", "tau_link")
        # The motors' state apart from tau, or Drake would take it for a function of tau.
        self.add("states", Multiplexer([2 * n, 2 * m]), "state", "motors", "states")
        self.add("motor_state", MatrixGain(of_motors), "states", "motor_state")
        self.build("tau_link", "motor_state")

    def rest(self, context: Context, q: ArrayLike, v: ArrayLike) -> None:
        """Start with motors at q [rad] with v [rad/s], joint side, of all n joints."""
        self.set_state(context, self._motors, np.array([q, v])[:, self._axes].ravel())
