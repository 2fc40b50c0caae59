from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import Diagram, DiagramBuilder, InputPort, OutputPort
from pydrake.systems.primitives import Adder, Gain

from sdt_drake.io.arrays import Array
from sdt_drake.robot.robot import Robot
from sdt_drake.systems.coupled_rotors import CoupledRotors_
from sdt_drake.systems.wiring import build


class PlantPorts(NamedTuple):
    """The ports of a plant in a diagram; torques are motor side [N m]."""

    tau: InputPort
    load_torque: InputPort
    state: OutputPort


def robot_plant(*, robot: Robot, without_rotor: NDArray[np.bool_] | None = None) -> Diagram:
    """Make the coupled plant: all joints of a robot with reflected rotor inertia.

        joint torque = r tau,    generalised force = -r load_torque

    tau and load_torque (disturbance, friction) are motor side [N m]. State: q and v of the joints,
    joint side, of the nested "multibody_plant". Torques are not limited. If a motor turns with two
    joints, its rotor does, too; the torque tau acts on its own joint alone.

    Args:
        robot: simulated robot.
        without_rotor: True at joints whose motor is a separate inertia, shape (n,); False by
            default.

    .. pydrake_system::

        name: robot_plant
        input_ports: [tau, load_torque]
        output_ports: [state]
    """
    builder = DiagramBuilder()
    ports = add_robot_plant(builder, robot=robot, without_rotor=without_rotor)
    builder.ExportInput(ports.tau, "tau")
    builder.ExportInput(ports.load_torque, "load_torque")
    builder.ExportOutput(ports.state, "state")
    return build(builder, "robot_plant")


def add_robot_plant(
    builder: DiagramBuilder, *, robot: Robot, without_rotor: NDArray[np.bool_] | None = None
) -> PlantPorts:
    """Add the systems of a `robot_plant` to a builder: a nested diagram costs 5 % of a run."""
    plant = robot.make_plant()
    builder.AddNamedSystem("multibody_plant", plant)
    for k, index in enumerate(plant.GetJointActuatorIndices()):
        if without_rotor is not None and without_rotor[k]:
            plant.get_joint_actuator(index).set_default_rotor_inertia(0.0)
    gears = builder.AddNamedSystem("gears", Gain(robot.gear_ratio))
    load_gears = builder.AddNamedSystem("load_gears", Gain(-robot.gear_ratio))
    builder.Connect(gears.get_output_port(), plant.get_actuation_input_port())
    force = load_gears.get_output_port()
    if robot.is_coupled:
        rigid = np.ones(robot.n) if without_rotor is None else 1.0 - without_rotor
        shared = robot.shared_inertia * np.outer(rigid, rigid)
        force = _with_rotors(builder, plant, shared, gears.get_output_port(), force)
    builder.Connect(force, plant.get_applied_generalized_force_input_port())
    state = plant.get_state_output_port()
    return PlantPorts(gears.get_input_port(), load_gears.get_input_port(), state)


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
