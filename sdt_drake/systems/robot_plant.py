from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import Context, Diagram, DiagramBuilder, OutputPort
from pydrake.systems.primitives import Adder, Gain

from sdt_drake.io.arrays import Array
from sdt_drake.robot.robot import Robot
from sdt_drake.systems.coupled_rotors import CoupledRotors_


class RobotPlant(Diagram):
    """The coupled plant: all joints of a robot with reflected rotor inertia.

        joint torque = r tau,    generalised force = -r load_torque

    tau and load_torque (disturbance, friction) are motor side [N m]. State: q and v of the joints,
    joint side. Torques are not limited. If a motor turns with two joints, its rotor does, too; the
    torque tau acts on its own joint alone.

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
        builder.ExportInput(gears.get_input_port(), "tau")
        builder.ExportInput(opposed.get_input_port(), "load_torque")
        builder.Connect(gears.get_output_port(), self.plant.get_actuation_input_port())
        force = opposed.get_output_port()
        if robot.is_coupled:
            rigid = np.ones(robot.n) if without_rotor is None else 1.0 - without_rotor
            shared = robot.shared_inertia * np.outer(rigid, rigid)
            force = _with_rotors(builder, self.plant, shared, gears.get_output_port(), force)
        builder.Connect(force, self.plant.get_applied_generalized_force_input_port())
        builder.ExportOutput(self.plant.get_state_output_port(), "state")
        builder.BuildInto(self)

    def rest(self, context: Context, q: ArrayLike, v: ArrayLike) -> None:
        """Set the state to q [rad] and v [rad/s], joint side."""
        own = self.GetMutableSubsystemContext(self.plant, context)
        self.plant.SetPositionsAndVelocities(own, np.concatenate([q, v]))


def _with_rotors(
    builder: DiagramBuilder,
    plant: MultibodyPlant,
    shared_inertia: Array,
    driving: OutputPort,
    load: OutputPort,
) -> OutputPort:
    """Add the rotors of motors that turn with two joints; return load and their torque [N m]."""
    n, add = len(shared_inertia), builder.AddNamedSystem
    applied, rotors = add("applied", Adder(2, n)), CoupledRotors_[None](plant, shared_inertia)
    add("coupled_rotors", rotors)
    whole = add("with_rotors", Adder(2, n))
    for k, port in enumerate((driving, load)):
        builder.Connect(port, applied.get_input_port(k))
    builder.Connect(plant.get_state_output_port(), rotors.GetInputPort("state"))
    builder.Connect(applied.get_output_port(), rotors.GetInputPort("force"))
    builder.Connect(load, whole.get_input_port(0))
    builder.Connect(rotors.get_output_port(), whole.get_input_port(1))
    return whole.get_output_port()
