"""Elastic joints. State: position and speed of the motors behind them."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from pydrake.systems.primitives import LinearSystem, MatrixGain, Multiplexer

from sdt_drake.device import Springs
from sdt_drake.errors import checked_vector
from sdt_drake.systems.block import Block


def elastic_joints_block(
    block: Block, *, springs: Springs, rotor_inertia: ArrayLike, gear_ratio: ArrayLike
) -> None:
    """Springs and dampers between the motors and the links, where a joint is elastic.

        r I_m dw/dt = tau - tau_link,    dtheta/dt = w
        r tau_link  = k (theta - q) + c (w - v)

    Torques and I_m motor side; theta, w of the motors, q, v of the links, k and c joint side. The
    plant behind it must not have the rotor inertia of an elastic joint once more. At rigid joints
    tau_link is tau, and the motor has the state of the link.

    .. pydrake_system::

        name: elastic_joints
        input_ports:
        - tau
        - state
        output_ports:
        - tau_link
        - motor_state

    Args:
        springs: of n joints, at least one of them elastic.
        rotor_inertia: I_m, motor side [kg m²], shape (n,), > 0 at elastic joints.
        gear_ratio: r [-], shape (n,), > 0.

    Raises:
        InputError: for inertias or ratios that are not > 0.
    """
    n = len(springs.stiffness)
    r = checked_vector(gear_ratio, n, "gear_ratio", positive=True)
    axes = np.flatnonzero(springs.elastic)
    m = len(axes)
    inertia = checked_vector(
        checked_vector(rotor_inertia, n, "rotor_inertia")[axes], m, "rotor_inertia", positive=True
    )
    pick, one, zero = np.eye(n)[axes], np.eye(m), np.zeros((m, m))
    stiffness, damping = np.diag(springs.stiffness[axes]), np.diag(springs.damping[axes])
    reflected = np.diag(1 / (r[axes] ** 2 * inertia))

    # Inputs in the order tau, q, v; a state [theta, w] of the elastic joints alone.
    forces = np.hstack([np.diag(r[axes]) @ pick, stiffness @ pick, damping @ pick])
    signals = block.add(Multiplexer([n, 2 * n]), "inputs")
    motors = block.add(
        LinearSystem(
            A=np.block([[zero, one], [-reflected @ stiffness, -reflected @ damping]]),
            B=np.vstack([np.zeros((m, 3 * n)), reflected @ forces]),
            C=np.eye(2 * m),
            D=np.zeros((2 * m, 3 * n)),
        )
    )
    rigid = np.diag(1.0 * ~springs.elastic)
    back = (pick / r).T
    with_motors = block.add(Multiplexer([3 * n, 2 * m]), "with_motors")
    tau_link = block.add(
        MatrixGain(
            np.hstack([
                rigid,
                -back @ stiffness @ pick,
                -back @ damping @ pick,
                back @ stiffness,
                back @ damping,
            ])
        ),
        "tau_link",
    )  # fmt: skip
    # The motors' state apart from tau, or Drake would take it for a function of tau.
    states = block.add(Multiplexer([2 * n, 2 * m]), "states")
    into_both = np.kron(np.eye(2), pick.T)
    motor_state = block.add(
        MatrixGain(np.hstack([np.kron(np.eye(2), rigid), into_both])), "motor_state"
    )
    link_state = block.add(MatrixGain(np.eye(2 * n)), "link_state")

    block.connect(link_state.get_output_port(), signals.get_input_port(1))
    block.connect(link_state.get_output_port(), states.get_input_port(0))
    block.connect(signals.get_output_port(), motors.get_input_port())
    block.connect(signals.get_output_port(), with_motors.get_input_port(0))
    block.connect(motors.get_output_port(), with_motors.get_input_port(1))
    block.connect(motors.get_output_port(), states.get_input_port(1))
    block.connect(with_motors.get_output_port(), tau_link.get_input_port())
    block.connect(states.get_output_port(), motor_state.get_input_port())
    block.inputs["tau"] = signals.get_input_port(0)
    block.inputs["state"] = link_state.get_input_port()
    block.outputs["tau_link"] = tau_link.get_output_port()
    block.outputs["motor_state"] = motor_state.get_output_port()
