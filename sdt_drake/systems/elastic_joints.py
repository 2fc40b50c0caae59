import numpy as np
from numpy.typing import ArrayLike
from pydrake.systems.framework import Context, Diagram, DiagramBuilder, System
from pydrake.systems.primitives import LinearSystem, MatrixGain, Multiplexer

from sdt_drake.io.arguments import positives
from sdt_drake.io.arrays import Array
from sdt_drake.robot.device import Springs
from sdt_drake.systems.wiring import build, set_state


def elastic_joints(
    *,
    springs: Springs,
    rotor_inertia: ArrayLike,
    gear_ratio: ArrayLike,
    shared_inertia: ArrayLike = 0.0,
) -> Diagram:
    """Make springs and dampers between motors and links, at elastic joints.

        r I_m dw/dt = tau - tau_link,    dtheta/dt = w
        r tau_link  = k (theta - q) + c (w - v)

    Torques and I_m are motor side. theta and w of the motors, q and v of the links, k and c are
    joint side. The plant behind this block must be without the rotor inertia of elastic joints. At
    rigid joints tau_link is tau, and the motor has the state of the link. The deflection is
    theta - q. With rotors that turn with two joints, r² I_m is a matrix. State: theta and w of the
    elastic joints, of the nested system "motors".

    Args:
        springs: springs of n joints, at least one of them elastic.
        rotor_inertia: I_m, motor side [kg m²], shape (n,), > 0 at elastic joints.
        gear_ratio: r [-], shape (n,), > 0.
        shared_inertia: `Robot.shared_inertia` of motors that turn with two joints [kg m²], shape
            (n, n); 0 by default.

    .. pydrake_system::

        name: elastic_joints
        input_ports: [tau, state]
        output_ports: [tau_link, motor_state, deflection]
    """
    builder = DiagramBuilder()
    add, connect = builder.AddNamedSystem, builder.Connect
    n = len(springs.stiffness)
    r = positives(gear_ratio, "gear_ratio", n)
    axes = np.flatnonzero(springs.elastic)
    rotors: Array = np.diag(r**2 * np.asarray(rotor_inertia)) + np.asarray(shared_inertia)
    m, reflected = len(axes), np.linalg.inv(rotors[np.ix_(axes, axes)])
    pick, rigid = np.eye(n)[axes], np.diag(1.0 * ~springs.elastic)
    both, back = np.kron(np.eye(2), pick), (pick / r).T  # select of [q, v]; to motor side
    spring = np.hstack([np.diag(springs.stiffness[axes]), np.diag(springs.damping[axes])])
    to_links = np.hstack([rigid, -back @ spring @ both, back @ spring])
    of_motors = np.hstack([np.kron(np.eye(2), rigid), both.T])

    inputs = add("inputs", Multiplexer([n, 2 * n]))
    # Inputs in the order tau, q, v; state [theta, w] of the elastic joints alone.
    motors = add("motors", LinearSystem(
        A=np.vstack([np.eye(2 * m)[m:], -reflected @ spring]),
        B=np.vstack([np.zeros((m, 3 * n)), reflected @ np.hstack([pick * r, spring @ both])]),
        C=np.eye(2 * m),
        D=np.zeros((2 * m, 3 * n)),
    ))  # fmt: skip
    with_motors = add("with_motors", Multiplexer([3 * n, 2 * m]))
    tau_link = add("tau_link", MatrixGain(to_links))
    # A multiplexer without tau: Drake would otherwise treat motor_state as a function of tau.
    states = add("states", Multiplexer([2 * n, 2 * m]))
    motor_state = add("motor_state", MatrixGain(of_motors))
    wound = np.hstack([-pick.T @ both[:m], pick.T, np.zeros((n, m))])  # theta - q
    deflection = add("deflection", MatrixGain(wound))

    builder.ExportInput(inputs.get_input_port(0), "tau")
    builder.ExportInput(inputs.get_input_port(1), "state")
    builder.ConnectInput("state", states.get_input_port(0))
    connect(inputs.get_output_port(), motors.get_input_port())
    connect(inputs.get_output_port(), with_motors.get_input_port(0))
    connect(motors.get_output_port(), with_motors.get_input_port(1))
    connect(motors.get_output_port(), states.get_input_port(1))
    connect(with_motors.get_output_port(), tau_link.get_input_port())
    connect(states.get_output_port(), motor_state.get_input_port())
    connect(states.get_output_port(), deflection.get_input_port())
    builder.ExportOutput(tau_link.get_output_port(), "tau_link")
    builder.ExportOutput(motor_state.get_output_port(), "motor_state")
    builder.ExportOutput(deflection.get_output_port(), "deflection")
    return build(builder, "elastic_joints")


def set_motor_state(
    joints: System, context: Context, q: ArrayLike, v: ArrayLike, *, springs: Springs
) -> None:
    """Set the state of all n motors to q [rad] and v [rad/s], joint side, shape (n,) each."""
    set_state(joints, context, "motors", np.array([q, v])[:, springs.elastic].ravel())
