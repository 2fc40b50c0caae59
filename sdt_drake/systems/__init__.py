"""The Drake blocks, one file per kind.

A block is a Diagram of Drake's own systems, made by a function, or a LeafSystem, with named ports
and keyword-only arguments. Each works alone in any DiagramBuilder. Its docstring names its state,
if it has one; the function `set_...` beside it sets that state in the block's own context. Sizes
and numbers that do not fit raise an `InputError`. Ports have the names of their signals. All are
vectors of length n unless the table gives another length:

    reference            [q_ref, v_ref, vd_ref], joint side [rad, rad/s, rad/s²], length 3n
    speed_reference      reference with the commanded speed of a position loop [rad, rad/s, rad/s²],
                         length 3n
    state                [q, v] of the plant, joint side [rad, rad/s], length 2n
    motor_state          [q, v] of the motors of elastic joints, joint side [rad, rad/s], length 2n
    measured             [q, v] as measured by an encoder, joint side [rad, rad/s], length 2n
    sampled_state        [q, v] sampled when the reference arrives, joint side [rad, rad/s],
                         length 2n
    load_torque          load of the motors, motor side [N m]; for the reference, tau_LD of
                         Algorithm 1
    alleviating_torque   tau_alleviate of Algorithm 1, motor side [N m]
    disturbance          disturbance of the load torque, motor side [N m]
    friction             friction of the joints, motor side [N m]
    gear_loss            losses of gears, a torque against the motion, motor side [N m]
    ripple               ripple of the motors' torque, motor side [N m]
    stop_torque          torque of joints against their stops, motor side [N m]
    inertia_share        I_eff over its largest value [-]
    weighted_reference   reference with speeds times inertia_share, length 3n
    weighted_measured    measured with speeds times inertia_share, length 2n
    tau_fb               feedback torque, motor side [N m]
    tau_ff               feedforward torque, motor side [N m]
    tau_cmd              commanded torque, their sum, motor side [N m]
    tau_limited          commanded torque after saturation, motor side [N m]
    tau                  torque of the motors, motor side [N m]
    metered              integral of tau (`add_meter`) over 1e12 limits [s]
    winding_temperature  temperature of the motors' windings [°C]
    tau_link             torque that an elastic joint transmits to its link, motor side [N m]
    deflection           angle of the motor of an elastic joint ahead of its link, joint side [rad]
"""

import re

from sdt_drake.systems.axis_process import axis_process
from sdt_drake.systems.disturbance import disturbance
from sdt_drake.systems.disturbance_observer import disturbance_observer
from sdt_drake.systems.elastic_joints import elastic_joints
from sdt_drake.systems.encoder import encoder
from sdt_drake.systems.friction import joint_friction
from sdt_drake.systems.gain_schedule import gain_schedule
from sdt_drake.systems.gear_loss import gear_loss
from sdt_drake.systems.inverse_dynamics import inverse_dynamics_controller
from sdt_drake.systems.joint_stops import joint_stops
from sdt_drake.systems.load_torque import LoadTorque, ReferenceTorque
from sdt_drake.systems.meter import add_meter, mean_torque
from sdt_drake.systems.motor_windings import motor_windings
from sdt_drake.systems.pi import pi_speed_controller
from sdt_drake.systems.position_loop import position_loop
from sdt_drake.systems.reference import (
    arrival,
    hold_of,
    reference_source,
    sample_source,
    signal_table,
)
from sdt_drake.systems.robot_drawing import robot_drawing
from sdt_drake.systems.robot_plant import robot_plant
from sdt_drake.systems.saturation import dynamic_saturation
from sdt_drake.systems.symbolic import symbolic_law
from sdt_drake.systems.torque_loop import torque_loop
from sdt_drake.systems.torque_ripple import torque_ripple

_ROWS = re.findall(r"\n    (\w+) +((?:.|\n {5})*)", __doc__ or "")
UNITS = {name: found[-1] for name, row in _ROWS if (found := re.findall(r"\[(.*?)\]", row))}
"""Units of outputs by the name of the port, as above; several for equal parts of a vector."""
