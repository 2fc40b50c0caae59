"""Elastic joints. State: position and speed of the motors behind them."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from pydrake.systems.framework import Context, Diagram
from pydrake.systems.primitives import LinearSystem, MatrixGain, Multiplexer

from sdt_drake.device import Springs
from sdt_drake.errors import checked_positive
from sdt_drake.systems.wiring import Wiring


class ElasticJoints(Diagram):
    """Springs and dampers between the motors and the links, where a joint is elastic.

        r I_m dw/dt = tau - tau_link,    dtheta/dt = w
        r tau_link  = k (theta - q) + c (w - v)

    Torques and I_m motor side; theta, w of the motors, q, v of the links, k and c joint side. The
    plant behind it must not have the rotor inertia of an elastic joint once more. At rigid joints
    tau_link is tau, and the motor has the state of the link.

    .. pydrake_system::

        name: ElasticJoints
        input_ports:
        - tau
        - state
        output_ports:
        - tau_link
        - motor_state
    """

    symbol = "elastic\njoints"

    def __init__(
        self, *, springs: Springs, rotor_inertia: ArrayLike, gear_ratio: ArrayLike
    ) -> None:
        """Of n joints.

        Args:
            springs: of n joints, at least one of them elastic.
            rotor_inertia: I_m, motor side [kg m²], shape (n,), > 0 at elastic joints.
            gear_ratio: r [-], shape (n,), > 0.
        """
        super().__init__()
        n = len(springs.stiffness)
        r = checked_positive(gear_ratio, "gear_ratio", n)
        self._axes = axes = np.flatnonzero(springs.elastic)
        m = len(axes)
        pick, one, zero = np.eye(n)[axes], np.eye(m), np.zeros((m, m))
        stiffness, damping = np.diag(springs.stiffness[axes]), np.diag(springs.damping[axes])
        reflected = np.diag(1 / (r**2 * np.asarray(rotor_inertia))[axes])
        rigid, back = np.diag(1.0 * ~springs.elastic), (pick / r).T
        k, c = stiffness @ pick, damping @ pick
        forces = np.hstack([np.diag(r[axes]) @ pick, k, c])
        # Inputs in the order tau, q, v; a state [theta, w] of the elastic joints alone.
        motors = LinearSystem(
            A=np.block([[zero, one], [-reflected @ stiffness, -reflected @ damping]]),
            B=np.vstack([np.zeros((m, 3 * n)), reflected @ forces]),
            C=np.eye(2 * m),
            D=np.zeros((2 * m, 3 * n)),
        )
        to_links = np.hstack([rigid, -back @ k, -back @ c, back @ stiffness, back @ damping])
        of_motors = np.hstack([np.kron(np.eye(2), rigid), np.kron(np.eye(2), pick.T)])

        wiring = Wiring()
        wiring.add("inputs", Multiplexer([n, 2 * n]), "tau", "state", "inputs")
        self._motors = wiring.add("motors", motors, "inputs", "motors")
        wiring.add("with_motors", Multiplexer([3 * n, 2 * m]), "inputs", "motors", "with_motors")
        wiring.add("tau_link", MatrixGain(to_links), "with_motors", "tau_link")
        # The motors' state apart from tau, or Drake would take it for a function of tau.
        wiring.add("states", Multiplexer([2 * n, 2 * m]), "state", "motors", "states")
        wiring.add("motor_state", MatrixGain(of_motors), "states", "motor_state")
        wiring.build_into(self, ("tau", "state"), ("tau_link", "motor_state"))

    def rest(self, context: Context, q: ArrayLike, v: ArrayLike) -> None:
        """Start with motors at q [rad] with v [rad/s], joint side, of all n joints."""
        own = self.GetMutableSubsystemContext(self._motors, context)
        both = np.array([q, v])[:, self._axes]
        own.SetContinuousState(both.ravel())
