"""The Drake blocks, one file per kind.

A block is a LeafSystem, or a Diagram of Drake's own systems, with named ports and a keyword-only
constructor; each works alone in any DiagramBuilder. It has no state but what it tells of;
`rest(context, ...)` sets what that starts with, and `context` is its own. Sizes and
numbers that do not fit are an `InputError`. `connect_by_name` wires the blocks of a builder by the
signals of their ports, all vectors of length n unless said otherwise:

    reference            [q_ref, v_ref, vd_ref], joint side [rad, rad/s, rad/s²], length 3n
    speed_reference      the same with the speed that a position loop asks for
    state                [q, v] of the plant, joint side [rad, rad/s], length 2n
    motor_state          the same of the motors, behind elastic joints; joint side
    measured             the same as an encoder sees it
    sampled_state        the same, sampled at the instants of the reference
    load_torque          what the motors turn against, motor side [N m]; of the reference, tau_LD
                         of Algorithm 1
    alleviating_torque   tau_alleviate of Algorithm 1, motor side [N m]
    disturbance          what disturbs the load torque, motor side [N m]
    friction             of the joints, motor side [N m]
    inertia_share        I_eff over its largest [-]; weighted_reference, weighted_state: of the
                         speeds that share
    tau_fb tau_ff tau_cmd tau_limited tau
                         torque of the motors, motor side [N m]: feedback, feedforward, their sum,
                         after saturation, as the drives really give it
    metered              integral of the motors' torque (`add_meter`), over 1e12 limits [s]
    tau_link             what an elastic joint passes on, motor side [N m]

The observer of the pilot's orientation stands beside the loop, with ports of length 3 in axes of
the head: specific_force [m/s²] and angular_rate [rad/s], which it feels as gravity [G], rate
[rad/s] and acceleration [m/s²].
"""

from sdt_drake.systems.axis_process import AxisProcess
from sdt_drake.systems.disturbance import Disturbance
from sdt_drake.systems.elastic_joints import ElasticJoints
from sdt_drake.systems.encoder import Encoder
from sdt_drake.systems.feedforward import CtcFeedforward
from sdt_drake.systems.friction import JointFriction
from sdt_drake.systems.gain_schedule import GainSchedule
from sdt_drake.systems.inverse_dynamics import InverseDynamicsController
from sdt_drake.systems.load_torque import LoadTorque, ReferenceTorque
from sdt_drake.systems.meter import add_meter, mean_torque
from sdt_drake.systems.orientation import InternalModel, OrientationObserver, load_perception
from sdt_drake.systems.pi import PiSpeedController
from sdt_drake.systems.position_loop import PositionLoop
from sdt_drake.systems.reference import ReferenceSource, SignalTable, hold_of, sample_source
from sdt_drake.systems.robot_drawing import RobotDrawing
from sdt_drake.systems.robot_plant import RobotPlant
from sdt_drake.systems.saturation import DynamicSaturation
from sdt_drake.systems.symbolic import SymbolicLaw
from sdt_drake.systems.torque_loop import TorqueLoop
from sdt_drake.systems.wiring import connect_by_name

__all__ = [
    "AxisProcess", "CtcFeedforward", "Disturbance", "DynamicSaturation", "ElasticJoints", "Encoder",
    "GainSchedule", "InternalModel", "InverseDynamicsController", "JointFriction", "LoadTorque",
    "OrientationObserver", "PiSpeedController", "PositionLoop", "ReferenceSource",
    "ReferenceTorque", "RobotDrawing", "RobotPlant", "SignalTable", "SymbolicLaw", "TorqueLoop",
    "add_meter", "connect_by_name", "hold_of", "load_perception", "mean_torque", "sample_source",
]  # fmt: skip
