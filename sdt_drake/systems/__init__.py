"""The Drake blocks, one file per kind.

A block is a LeafSystem, or a small Diagram of Drake's own primitives, with named ports. Signals on
the wires, all vectors of length n unless said otherwise:

    reference            [q_ref, v_ref, vd_ref], joint side [rad, rad/s, rad/s²], length 3n
    state                [q, v] of the plant, joint side [rad, rad/s], length 2n
    motor_state          the same of the motors, behind elastic joints; joint side
    load_torque          what the motors turn against, motor side [N m]; of the reference, tau_LD
                         of Algorithm 1
    alleviating_torque   tau_alleviate of Algorithm 1, motor side [N m]
    disturbance          what disturbs the load torque, motor side [N m]
    friction             of the joints, motor side [N m]
    inertia_share        I_eff over its largest [-]
    tau_fb tau_ff tau_cmd tau_limited tau
                         torque of the motors, motor side [N m]: feedback, feedforward, their sum,
                         after saturation, as the drives really give it
    tau_link             what an elastic joint passes on, motor side [N m]
"""

from sdt_drake.systems.axis_process import axis_process_block
from sdt_drake.systems.block import Block, make_block, place_boxed, place_flat
from sdt_drake.systems.disturbance import disturbance_block, true_load_block
from sdt_drake.systems.elastic_joints import elastic_joints_block
from sdt_drake.systems.encoder import encoder_block
from sdt_drake.systems.feedforward import ctc_feedforward_block
from sdt_drake.systems.friction import STRETCH_UNIT, friction_block
from sdt_drake.systems.gain_schedule import gain_schedule_block
from sdt_drake.systems.inverse_dynamics import inverse_dynamics_block
from sdt_drake.systems.logs import add_logs, read_logs
from sdt_drake.systems.pi import pi_speed_controller_block
from sdt_drake.systems.position_loop import position_loop_block
from sdt_drake.systems.reference import (
    constant_block,
    reference_source_block,
    table_block,
    zero_order_hold_block,
)
from sdt_drake.systems.reference_torque import (
    ReferenceTorque,
    feedforward_torque_block,
    load_torque_block,
)
from sdt_drake.systems.robot_plant import robot_plant_block
from sdt_drake.systems.saturation import Envelope, dynamic_saturation_block
from sdt_drake.systems.torque_loop import torque_loop_block, torque_unit

__all__ = [
    "STRETCH_UNIT",
    "Block",
    "Envelope",
    "ReferenceTorque",
    "add_logs",
    "axis_process_block",
    "constant_block",
    "ctc_feedforward_block",
    "disturbance_block",
    "dynamic_saturation_block",
    "elastic_joints_block",
    "encoder_block",
    "feedforward_torque_block",
    "friction_block",
    "gain_schedule_block",
    "inverse_dynamics_block",
    "load_torque_block",
    "make_block",
    "pi_speed_controller_block",
    "place_boxed",
    "place_flat",
    "position_loop_block",
    "read_logs",
    "reference_source_block",
    "robot_plant_block",
    "table_block",
    "torque_loop_block",
    "torque_unit",
    "true_load_block",
    "zero_order_hold_block",
]
