"""Symbols of this package's blocks in block diagrams."""

from pydrake.systems.framework import System

from sdt_drake.show.diagrams import Symbols


def _encoder(block: System) -> str:
    timing = block.GetUniquePeriodicDiscreteUpdateAttribute()
    if timing is None:  # an ideal one, not drawn
        return ""
    return f"encoder\n{1e3 * timing.period_sec():g} ms"


SYMBOLS: Symbols = {
    "axis_process": "1 / (I_eff s)",
    "device": "",
    "disturbance": "A sin(omega_D t)",
    "drawing": "Meshcat",
    "dynamic_saturation": lambda block: "dynamic\n" * (block.num_input_ports() > 1) + "saturation",
    "elastic_joints": "elastic\njoints",
    "encoder.drives": _encoder,
    "encoder.samples": _encoder,
    "feedforward": "",
    "feedforward_table": "table",
    "friction": "friction",
    "gain_schedule": "speeds x\nI_eff / I_eff,max",
    "gears": "r",
    "inertia_table": "table",
    "inverse_dynamics": "feedback\nlinearisation",
    "load_gears": "r",
    "load_torque_table": "table",
    "multibody_plant": "Multibody\nPlant",
    "pi_speed_controller.command": "1/K_PS",
    "pi_speed_controller.integral": "1/s",
    "pi_speed_controller.minus_motor_speed": "r",
    "pi_speed_controller.motor_speed_ref": "r",
    "pi_speed_controller.saturated": "1/K_PS",
    "position_loop": "v_ref +\nK_V (q_ref - q)",
    "reference_source": "planner",
    "torque_loop": "torque\nloop",
    "ReferenceTorque": "inverse\ndynamics",
}
"""Symbols by name of the system or class, in the form of `sdt_drake.show.diagrams.walk`."""
