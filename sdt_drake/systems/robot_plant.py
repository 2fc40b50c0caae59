"""The MultibodyPlant behind its gears. State: q and v of the joints."""

from __future__ import annotations

from pydrake.systems.primitives import Gain

from sdt_drake.robot import Robot
from sdt_drake.systems.block import Block


def robot_plant_block(block: Block, *, robot: Robot, disturbed: bool = True) -> None:
    """All joints moving at once, with the motors' inertia reflected through the gears.

        joint torque = r tau,    generalised force = -r disturbance

    tau and disturbance motor side [N m]. It does not limit the torques.

    .. pydrake_system::

        name: multibody_plant
        input_ports:
        - tau
        - disturbance
        output_ports:
        - state

    Args:
        robot: gives the plant and its gears.
        disturbed: whether there is an input `disturbance`.
    """
    plant = block.add(robot.make_plant())
    gears = block.add(Gain(robot.gear_ratio), "gears")
    block.connect(gears.get_output_port(), plant.get_actuation_input_port())
    block.inputs["tau"] = gears.get_input_port()
    if disturbed:
        opposed = block.add(Gain(-robot.gear_ratio), "opposed_gears")
        block.connect(opposed.get_output_port(), plant.get_applied_generalized_force_input_port())
        block.inputs["disturbance"] = opposed.get_input_port()
    block.outputs["state"] = plant.get_state_output_port()
