import numpy as np
from numpy.typing import ArrayLike
from pydrake.systems.controllers import InverseDynamicsController
from pydrake.systems.framework import Diagram, DiagramBuilder
from pydrake.systems.primitives import Adder, Demultiplexer, Gain, MatrixGain, Multiplexer

from sdt_drake.io.arguments import positives
from sdt_drake.robot.robot import Robot
from sdt_drake.systems.wiring import build


def inverse_dynamics_controller(*, model: Robot, omega_n: ArrayLike, zeta: ArrayLike) -> Diagram:
    """Make computed torque control: state feedback makes every joint a double integrator.

        r tau_fb = M(q) (vd_ref + 2 zeta omega_n (v_ref - v) + omega_n² (q_ref - q)) + bias(q, v)

    This is feedback linearisation. The paper calls "computed torque control" the feedforward of the
    load torque that `pi_ctc` adds to its speed loops.

    M includes the rotor inertia, and bias gravity. q and v are joint side, tau_fb motor side [N m].
    The state must be sampled at the instants of the reference, as for the position loop. There is
    no integral action (its gain in Drake's controller is 0): an inexact model leaves an error at
    rest.

    Args:
        model: controller's model.
        omega_n: natural frequency of the error [rad/s], shape (n,), > 0.
        zeta: damping ratio of the error [-], shape (n,), > 0.

    .. pydrake_system::

        name: inverse_dynamics_controller
        input_ports: [reference, sampled_state]
        output_ports: [tau_fb]
    """
    # Checked here: Drake's controller ends the process at lengths that do not fit.
    omega_n = positives(omega_n, "omega_n", n := model.n)
    zeta = positives(zeta, "zeta", n)
    builder = DiagramBuilder()
    reference = builder.AddNamedSystem("reference", Demultiplexer([2 * n, n]))
    law = InverseDynamicsController(
        model.make_plant(),
        kp=omega_n**2,
        ki=np.zeros(n),
        kd=2 * zeta * omega_n,
        has_reference_acceleration=True,
    )
    builder.AddNamedSystem("law", law)
    gears = builder.AddNamedSystem("gears", Gain(1 / model.gear_ratio))
    builder.ExportInput(reference.get_input_port(), "reference")
    builder.ExportInput(law.get_input_port_estimated_state(), "sampled_state")
    builder.Connect(reference.get_output_port(0), law.get_input_port_desired_state())
    builder.Connect(reference.get_output_port(1), law.get_input_port_desired_acceleration())
    torque = law.get_output_port_control()
    if model.is_coupled:
        both = builder.AddNamedSystem("both", Multiplexer([3 * n, 2 * n]))
        by_error = np.hstack([np.diag(omega_n**2), np.diag(2 * zeta * omega_n)])
        wanted = np.hstack([by_error, np.eye(n), -by_error])  # acceleration that the law asks
        rotors = builder.AddNamedSystem("rotors", MatrixGain(model.shared_inertia @ wanted))
        whole = builder.AddNamedSystem("with_rotors", Adder(2, n))
        builder.ConnectInput("reference", both.get_input_port(0))
        builder.ConnectInput("sampled_state", both.get_input_port(1))
        builder.Connect(both.get_output_port(), rotors.get_input_port())
        builder.Connect(torque, whole.get_input_port(0))
        builder.Connect(rotors.get_output_port(), whole.get_input_port(1))
        torque = whole.get_output_port()
    builder.Connect(torque, gears.get_input_port())
    builder.ExportOutput(gears.get_output_port(), "tau_fb")
    return build(builder, "inverse_dynamics_controller")
