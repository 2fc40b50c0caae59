"""Symbols of this package's blocks in block diagrams."""

from __future__ import annotations

from pydrake.systems.framework import System

from sdt_drake.show.diagrams import Symbols


def _encoder(block: System) -> str:
    timing = block.GetUniquePeriodicDiscreteUpdateAttribute()
    assert timing is not None  # all holds of an encoder have the same period
    return f"encoder\n{1e3 * timing.period_sec():g} ms"


def _saturation(block: System) -> str:
    return "saturation" if block.num_input_ports() == 1 else "dynamic\nsaturation"


SYMBOLS: Symbols = {
    "AxisProcess": "1 / (I_eff s)",
    "Disturbance": "A sin(omega_D t)",
    "DynamicSaturation": _saturation,
    "ElasticJoints": "elastic\njoints",
    "Encoder": _encoder,
    "GainSchedule": "speeds x\nI_eff / I_eff,max",
    "InverseDynamicsController": "feedback\nlinearisation",
    "JointFriction": "friction",
    "PiSpeedController.asked": "1/K_PS",
    "PiSpeedController.given": "1/K_PS",
    "PiSpeedController.integral": "1/s",
    "PiSpeedController.motor_speed": "r",
    "PiSpeedController.motor_speed_ref": "r",
    "PositionLoop": "v_ref +\nK_V (q_ref - q)",
    "ReferenceSource": "planner",
    "ReferenceTorque": "inverse\ndynamics",
    "RobotDrawing": "Meshcat",
    "RobotPlant": "Multibody\nPlant",
    "SignalTable": "table",
    "TorqueLoop": "torque\nloop",
}
"""Symbols by class, in the form of `sdt_drake.show.diagrams.walk`."""
