"""The MultibodyPlant behind its gears. State: q and v of the joints."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.primitives import Gain

from sdt_drake.robot import Robot
from sdt_drake.systems.block import Block


def robot_plant_block(
    block: Block,
    *,
    robot: Robot,
    loaded: bool = True,
    without_rotor: NDArray[np.bool_] | None = None,
) -> None:
    """All joints moving at once, with the motors' inertia reflected through the gears.

        joint torque = r tau,    generalised force = -r load_torque

    tau and load_torque (what acts beside the plant's own dynamics: disturbance, friction) motor
    side [N m]. It does not limit the torques.

    .. pydrake_system::

        name: multibody_plant
        input_ports:
        - tau
        - load_torque
        output_ports:
        - state

    Args:
        robot: gives the plant and its gears.
        loaded: whether there is an input `load_torque`.
        without_rotor: joints whose motor turns apart from them (elastic joints), shape (n,).
    """
    plant = block.add(robot.make_plant())
    if without_rotor is not None:
        _remove_rotors(plant, without_rotor)
    gears = block.add(Gain(robot.gear_ratio), "gears")
    block.connect(gears.get_output_port(), plant.get_actuation_input_port())
    block.inputs["tau"] = gears.get_input_port()
    if loaded:
        opposed = block.add(Gain(-robot.gear_ratio), "opposed_gears")
        block.connect(opposed.get_output_port(), plant.get_applied_generalized_force_input_port())
        block.inputs["load_torque"] = opposed.get_input_port()
    block.outputs["state"] = plant.get_state_output_port()


def _remove_rotors(plant: MultibodyPlant, without_rotor: NDArray[np.bool_]) -> None:
    for k, index in enumerate(plant.GetJointActuatorIndices()):
        if without_rotor[k]:
            plant.get_joint_actuator(index).set_default_rotor_inertia(0.0)
