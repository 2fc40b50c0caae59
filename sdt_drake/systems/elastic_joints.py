"""Elastic joints. State: position and speed of the motors behind them."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from pydrake.systems.framework import Context, Diagram, DiagramBuilder
from pydrake.systems.primitives import LinearSystem, MatrixGain, Multiplexer

from sdt_drake.device import Springs
from sdt_drake.errors import checked_vector


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

        Raises:
            InputError: for inertias or ratios that are not > 0.
        """
        super().__init__()
        n = len(springs.stiffness)
        r = checked_vector(gear_ratio, n, "gear_ratio", positive=True)
        self._axes = axes = np.flatnonzero(springs.elastic)
        m = len(axes)
        inertia = checked_vector(rotor_inertia, n, "rotor_inertia")[axes]
        checked_vector(inertia, m, "rotor_inertia", positive=True)
        pick, one, zero = np.eye(n)[axes], np.eye(m), np.zeros((m, m))
        stiffness, damping = np.diag(springs.stiffness[axes]), np.diag(springs.damping[axes])
        reflected = np.diag(1 / (r[axes] ** 2 * inertia))
        rigid, back = np.diag(1.0 * ~springs.elastic), (pick / r).T
        k, c = stiffness @ pick, damping @ pick
        builder = DiagramBuilder()
        add, connect = builder.AddNamedSystem, builder.Connect

        # Inputs in the order tau, q, v; a state [theta, w] of the elastic joints alone.
        signals = add("inputs", Multiplexer([n, 2 * n]))
        forces = np.hstack([np.diag(r[axes]) @ pick, k, c])
        self._motors = add(
            "motors",
            LinearSystem(
                A=np.block([[zero, one], [-reflected @ stiffness, -reflected @ damping]]),
                B=np.vstack([np.zeros((m, 3 * n)), reflected @ forces]),
                C=np.eye(2 * m),
                D=np.zeros((2 * m, 3 * n)),
            ),
        )
        with_motors = add("with_motors", Multiplexer([3 * n, 2 * m]))
        springs_of_links = [rigid, -back @ k, -back @ c, back @ stiffness, back @ damping]
        tau_link = add("tau_link", MatrixGain(np.hstack(springs_of_links)))
        # The motors' state apart from tau, or Drake would take it for a function of tau.
        states = add("states", Multiplexer([2 * n, 2 * m]))
        both = np.hstack([np.kron(np.eye(2), rigid), np.kron(np.eye(2), pick.T)])
        motor_state = add("motor_state", MatrixGain(both))

        builder.ExportInput(signals.get_input_port(0), "tau")
        builder.ExportInput(signals.get_input_port(1), "state")
        builder.ConnectInput("state", states.get_input_port(0))
        connect(signals.get_output_port(), self._motors.get_input_port())
        connect(signals.get_output_port(), with_motors.get_input_port(0))
        connect(self._motors.get_output_port(), with_motors.get_input_port(1))
        connect(self._motors.get_output_port(), states.get_input_port(1))
        connect(with_motors.get_output_port(), tau_link.get_input_port())
        connect(states.get_output_port(), motor_state.get_input_port())
        builder.ExportOutput(tau_link.get_output_port(), "tau_link")
        builder.ExportOutput(motor_state.get_output_port(), "motor_state")
        builder.BuildInto(self)

    def rest(self, context: Context, q: ArrayLike, v: ArrayLike) -> None:
        """Start with motors at q [rad] with v [rad/s], joint side, of all n joints."""
        own = self.GetMutableSubsystemContext(self._motors, context)
        both = np.array([q, v])[:, self._axes]
        own.SetContinuousState(both.ravel())
