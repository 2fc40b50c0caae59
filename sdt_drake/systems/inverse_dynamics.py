"""Feedback linearisation with Drake's InverseDynamicsController. State: an integral without use."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from pydrake.systems import controllers
from pydrake.systems.framework import Diagram, DiagramBuilder
from pydrake.systems.primitives import Demultiplexer, Gain

from sdt_drake.errors import checked_vector
from sdt_drake.robot import Robot


class InverseDynamicsController(Diagram):
    """Computed torque from the whole state: every joint becomes a double integrator.

        r tau_fb = M(q) (vd_ref + 2 zeta omega_n (v_ref - v) + omega_n² (q_ref - q)) + bias(q, v)

    with the inertia of the motors in M, and gravity in bias; q, v joint side, tau_fb motor side
    [N m]. It has no integral: a wrong model leaves an error at rest. The state must be sampled at
    the instants of the reference, as for the position loop.

    .. pydrake_system::

        name: InverseDynamicsController
        input_ports:
        - reference
        - sampled_state
        output_ports:
        - tau_fb
    """

    symbol = "feedback\nlinearisation"

    def __init__(self, *, model: Robot, omega_n: ArrayLike, zeta: ArrayLike) -> None:
        """Of the errors' poles.

        Args:
            model: what the controller takes the robot for.
            omega_n: natural frequency of the error [rad/s], shape (n,), > 0.
            zeta: its damping ratio [-], shape (n,), > 0.

        Raises:
            InputError: for values that are not finite and > 0.
        """
        super().__init__()
        n = model.n
        omega_n = checked_vector(omega_n, n, "omega_n", positive=True)
        zeta = checked_vector(zeta, n, "zeta", positive=True)
        builder = DiagramBuilder()
        split = builder.AddNamedSystem("reference", Demultiplexer([2 * n, n]))
        law = builder.AddNamedSystem(
            "law",
            controllers.InverseDynamicsController(
                model.make_plant(),
                kp=omega_n**2,
                ki=np.zeros(n),
                kd=2 * zeta * omega_n,
                has_reference_acceleration=True,
            ),
        )
        gears = builder.AddNamedSystem("gears", Gain(1 / model.gear_ratio))
        builder.ExportInput(split.get_input_port(), "reference")
        builder.ExportInput(law.get_input_port_estimated_state(), "sampled_state")
        builder.Connect(split.get_output_port(0), law.get_input_port_desired_state())
        builder.Connect(split.get_output_port(1), law.get_input_port_desired_acceleration())
        builder.Connect(law.get_output_port_control(), gears.get_input_port())
        builder.ExportOutput(gears.get_output_port(), "tau_fb")
        builder.BuildInto(self)
