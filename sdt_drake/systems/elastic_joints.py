import numpy as np
import pydrake.symbolic as sym
from numpy.typing import ArrayLike
from pydrake.systems.framework import Context, Diagram, DiagramBuilder, System
from pydrake.systems.primitives import Adder, Gain, LinearSystem, MatrixGain, Multiplexer

from sdt_drake.io.arguments import positives
from sdt_drake.io.arrays import Array, Index
from sdt_drake.robot.device import Springs
from sdt_drake.systems.symbolic import Symbols, symbolic_law
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

    With backlash b the spring is wound by delta - clip(delta, -b/2, b/2), delta = theta - q, and
    the damper acts outside the play alone: fully from b / 100 beyond its ends.

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
    has_play = np.any(springs.backlash)
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

    tau, linked = inputs.get_input_port(0), tau_link.get_output_port()
    if has_play:  # the torque by which straight springs exceed springs with play
        play = add("play", _play(springs, r, axes))
        minus, at_motor, at_link = (
            add("minus", Gain(-1.0, n)),
            *(add(name, Adder(2, n)) for name in ("at_motor", "at_link")),
        )
        connect(states.get_output_port(), play.get_input_port())
        connect(play.get_output_port(), at_motor.get_input_port(1))
        connect(play.get_output_port(), minus.get_input_port())
        connect(minus.get_output_port(), at_link.get_input_port(1))
        connect(at_motor.get_output_port(), tau)
        connect(linked, at_link.get_input_port(0))
        tau, linked = at_motor.get_input_port(0), at_link.get_output_port()
    builder.ExportInput(tau, "tau")
    builder.ExportInput(inputs.get_input_port(1), "state")
    builder.ConnectInput("state", states.get_input_port(0))
    connect(inputs.get_output_port(), motors.get_input_port())
    connect(inputs.get_output_port(), with_motors.get_input_port(0))
    connect(motors.get_output_port(), with_motors.get_input_port(1))
    connect(motors.get_output_port(), states.get_input_port(1))
    connect(with_motors.get_output_port(), tau_link.get_input_port())
    connect(states.get_output_port(), motor_state.get_input_port())
    connect(states.get_output_port(), deflection.get_input_port())
    builder.ExportOutput(linked, "tau_link")
    builder.ExportOutput(motor_state.get_output_port(), "motor_state")
    builder.ExportOutput(deflection.get_output_port(), "deflection")
    return build(builder, "elastic_joints")


def _play(springs: Springs, r: Array, axes: Index) -> Diagram:
    """Make the torque that springs and dampers lack within the play, motor side [N m].

    Input `states`: q and v of the links, theta and w of the elastic joints.
    """
    n, m = len(springs.stiffness), len(axes)
    half = np.broadcast_to(springs.backlash, n) / 2

    def law(states: Symbols) -> list[sym.Expression]:
        zero, one = sym.Expression(0.0), sym.Expression(1.0)
        lacking = [zero] * n
        for i, k in enumerate(axes.tolist()):
            if not half[k]:
                continue
            wound, rate = states[2 * n + i] - states[k], states[2 * n + m + i] - states[n + k]
            beyond = sym.max(wound - half[k], zero) - sym.max(-wound - half[k], zero)
            distance = sym.max(wound - half[k], zero) + sym.max(-wound - half[k], zero)
            loose = one - sym.min(distance / (half[k] / 50), one)
            spring = springs.stiffness[k] * (wound - beyond)
            lacking[k] = (spring + springs.damping[k] * rate * loose) / r[k]
        return lacking

    return symbolic_law(inputs={"states": 2 * (n + m)}, output="play", law=law, name="play")


def set_motor_state(
    joints: System, context: Context, q: ArrayLike, v: ArrayLike, *, springs: Springs
) -> None:
    """Set the state of all n motors to q [rad] and v [rad/s], joint side, shape (n,) each."""
    set_state(joints, context, "motors", np.array([q, v])[:, springs.elastic].ravel())
