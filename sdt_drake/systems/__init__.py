"""The Drake blocks, one file per kind.

A block is a LeafSystem, or a small Diagram of Drake's own primitives, with named ports. Signals on
the wires, all vectors of length n unless said otherwise:

    q_ref v_ref vd_ref   reference, joint side [rad, rad/s, rad/s²]
    state                q and v of the plant, joint side, length 2n
    load_torque          tau_LD of Algorithm 1, motor side [N m]
    alleviating_torque   tau_alleviate of Algorithm 1, motor side [N m]
    disturbance          what disturbs the load torque, motor side [N m]
    tau_fb tau_ff tau_cmd tau
                         torque of the motors, motor side [N m]: feedback, feedforward, their sum,
                         after saturation
"""

from sdt_drake.systems.axis_process import make_axis_process
from sdt_drake.systems.disturbance import make_disturbance
from sdt_drake.systems.feedforward import make_ctc_feedforward
from sdt_drake.systems.load_torque import LoadTorque, make_load_torque_table
from sdt_drake.systems.logs import add_logs, read_logs
from sdt_drake.systems.pi import make_pi_speed_controller
from sdt_drake.systems.reference import make_reference_source, make_zero_order_hold
from sdt_drake.systems.saturation import make_dynamic_saturation

__all__ = [
    "LoadTorque",
    "add_logs",
    "make_axis_process",
    "make_ctc_feedforward",
    "make_disturbance",
    "make_dynamic_saturation",
    "make_load_torque_table",
    "make_pi_speed_controller",
    "make_reference_source",
    "make_zero_order_hold",
    "read_logs",
]
