"""The Drake blocks, one file per kind.

A block is a LeafSystem, or a Diagram of Drake's own systems, with named ports and a keyword-only
constructor. Each works alone in any DiagramBuilder. Its docstring names its state, if it has one;
`rest(context, ...)` sets the initial state in the block's own context. Sizes and numbers that do
not fit raise an `InputError`. `connect_by_name` wires the blocks of a builder by the signals of
their ports. All are vectors of length n unless the table gives another length:

    reference            [q_ref, v_ref, vd_ref], joint side [rad, rad/s, rad/s²], length 3n
    speed_reference      reference with the commanded speed of a position loop, length 3n
    state                [q, v] of the plant, joint side [rad, rad/s], length 2n
    motor_state          [q, v] of the motors of elastic joints, joint side, length 2n
    measured             [q, v] as measured by an encoder, joint side, length 2n
    sampled_state        [q, v] sampled when the reference arrives, joint side, length 2n
    load_torque          load of the motors, motor side [N m]; for the reference, tau_LD of
                         Algorithm 1
    alleviating_torque   tau_alleviate of Algorithm 1, motor side [N m]
    disturbance          disturbance of the load torque, motor side [N m]
    friction             friction of the joints, motor side [N m]
    inertia_share        I_eff over its largest value [-]
    weighted_reference   reference with speeds times inertia_share, length 3n
    weighted_state       state with speeds times inertia_share, length 2n
    tau_fb               feedback torque, motor side [N m]
    tau_ff               feedforward torque, motor side [N m]
    tau_cmd              commanded torque, their sum, motor side [N m]
    tau_limited          commanded torque after saturation, motor side [N m]
    tau                  torque of the motors, motor side [N m]
    metered              integral of tau (`add_meter`) over 1e12 limits [s]
    tau_link             torque that an elastic joint transmits to its link, motor side [N m]

The observer of the pilot's orientation has ports of length 3 in axes of the head: inputs
specific_force [m/s²] and angular_rate [rad/s]; outputs, as felt, gravity [G], rate [rad/s] and
acceleration [m/s²].
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
from sdt_drake.systems.reference import (
    ReferenceSource,
    SignalTable,
    arrival,
    hold_of,
    sample_source,
)
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
    "add_meter", "arrival", "connect_by_name", "hold_of", "load_perception", "mean_torque",
    "sample_source",
]  # fmt: skip
