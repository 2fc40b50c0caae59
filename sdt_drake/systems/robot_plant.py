from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import Context, Diagram, DiagramBuilder
from pydrake.systems.primitives import Gain

from sdt_drake.robot.robot import Robot


class RobotPlant(Diagram):
    """The coupled plant: all joints of a robot with reflected rotor inertia.

        joint torque = r tau,    generalised force = -r load_torque

    tau and load_torque (disturbance, friction) are motor side [N m]. State: q and v of the joints,
    joint side. Torques are not limited.

    Args:
        robot: simulated robot.
        without_rotor: True at joints whose motor is a separate inertia, shape (n,); False by
            default.

    .. pydrake_system::

        name: RobotPlant
        input_ports: [tau, load_torque]
        output_ports: [state]

    """

    plant: MultibodyPlant
    """Drake's plant of the robot."""

    def __init__(self, *, robot: Robot, without_rotor: NDArray[np.bool_] | None = None) -> None:
        super().__init__()
        builder = DiagramBuilder()
        self.plant = robot.make_plant()
        builder.AddNamedSystem("plant", self.plant)
        for k, index in enumerate(self.plant.GetJointActuatorIndices()):
            if without_rotor is not None and without_rotor[k]:
                self.plant.get_joint_actuator(index).set_default_rotor_inertia(0.0)
        gears = builder.AddNamedSystem("gears", Gain(robot.gear_ratio))
        opposed = builder.AddNamedSystem("opposed_gears", Gain(-robot.gear_ratio))
        force = self.plant.get_applied_generalized_force_input_port()
        builder.ExportInput(gears.get_input_port(), "tau")
        builder.ExportInput(opposed.get_input_port(), "load_torque")
        builder.Connect(gears.get_output_port(), self.plant.get_actuation_input_port())
        builder.Connect(opposed.get_output_port(), force)
        builder.ExportOutput(self.plant.get_state_output_port(), "state")
        builder.BuildInto(self)

    def rest(self, context: Context, q: ArrayLike, v: ArrayLike) -> None:
        """Set the state to q [rad] and v [rad/s], joint side."""
        own = self.GetMutableSubsystemContext(self.plant, context)
        self.plant.SetPositionsAndVelocities(own, np.concatenate([q, v]))
