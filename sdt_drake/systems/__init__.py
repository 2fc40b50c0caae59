"""The Drake blocks, one file per kind.

A block is a LeafSystem, or a small Diagram of Drake's own primitives, with named ports. Signals on
the wires, all vectors of length n unless said otherwise:

    reference            [q_ref, v_ref, vd_ref], joint side [rad, rad/s, rad/s²], length 3n
    state                [q, v] of the plant, joint side [rad, rad/s], length 2n
    load_torque          tau_LD of Algorithm 1, motor side [N m]
    alleviating_torque   tau_alleviate of Algorithm 1, motor side [N m]
    disturbance          what disturbs the load torque, motor side [N m]
    tau_fb tau_ff tau_cmd tau
                         torque of the motors, motor side [N m]: feedback, feedforward, their sum,
                         after saturation
"""

from sdt_drake.systems.axis_process import axis_process_block
from sdt_drake.systems.block import Block, make_block, place_boxed, place_flat
from sdt_drake.systems.disturbance import disturbance_block, true_load_block
from sdt_drake.systems.feedforward import ctc_feedforward_block
from sdt_drake.systems.load_torque import LoadTorque, load_torque_block
from sdt_drake.systems.logs import add_logs, read_logs
from sdt_drake.systems.pi import pi_speed_controller_block
from sdt_drake.systems.reference import (
    constant_block,
    load_torque_table_block,
    reference_source_block,
    zero_order_hold_block,
)
from sdt_drake.systems.robot_plant import robot_plant_block
from sdt_drake.systems.saturation import dynamic_saturation_block

__all__ = [
    "Block",
    "LoadTorque",
    "add_logs",
    "axis_process_block",
    "constant_block",
    "ctc_feedforward_block",
    "disturbance_block",
    "dynamic_saturation_block",
    "load_torque_block",
    "load_torque_table_block",
    "make_block",
    "pi_speed_controller_block",
    "place_boxed",
    "place_flat",
    "read_logs",
    "reference_source_block",
    "robot_plant_block",
    "true_load_block",
    "zero_order_hold_block",
]
