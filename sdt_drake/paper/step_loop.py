"""A single linear speed loop with a step as its reference (Figure 4)."""

import numpy as np
from pydrake.systems.framework import Diagram, DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource

from sdt_drake.systems import axis_process, pi_speed_controller
from sdt_drake.systems.gains import SpeedGains
from sdt_drake.systems.wiring import build


def make_step_loop(*, gains: SpeedGains, i_eff: float, setpoint_weight: float) -> Diagram:
    """Make one linear speed loop without load or limit (Figures 4 and 5).

    The reference is a step to 1 rad/s at time 0. Output: `state`.

    Args:
        gains: gains of one controller, motor side; arrays of length 1.
        i_eff: inertia of the axis, motor side [kg m²].
        setpoint_weight: b [-]: 1 is PI on the error, 0 is I-P (Figure 5).
    """
    builder = DiagramBuilder()
    # q_ref, v_ref, vd_ref
    step = builder.AddNamedSystem("step_reference", ConstantVectorSource(np.array([0.0, 1.0, 0.0])))
    pi = pi_speed_controller(gains=gains, gear_ratio=[1.0], setpoint_weight=setpoint_weight)
    builder.AddNamedSystem("pi_speed_controller", pi)
    no_load = builder.AddNamedSystem("no_load", ConstantVectorSource(np.zeros(1)))
    process = axis_process(i_eff=[i_eff], gear_ratio=[1.0])
    builder.AddNamedSystem("axis_process", process)
    builder.Connect(step.get_output_port(), pi.GetInputPort("reference"))
    builder.Connect(process.get_output_port(), pi.GetInputPort("measured"))
    builder.Connect(pi.get_output_port(), process.GetInputPort("tau"))
    builder.Connect(no_load.get_output_port(), process.GetInputPort("load_torque"))
    builder.ExportOutput(process.get_output_port(), "state")
    return build(builder, "step_loop")
