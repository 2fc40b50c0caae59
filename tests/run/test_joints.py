"""Elastic joints under a robot, against calculations by hand."""

from __future__ import annotations

import numpy as np
import pytest
from by_hand import GEAR, ROTORS
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource

from sdt_drake.robot.device import Elasticity, Springs
from sdt_drake.run.loop import make_loop
from sdt_drake.run.simulate import make_simulator
from sdt_drake.systems import ElasticJoints, RobotPlant, connect_by_name

HANGING = np.array([0.4, 0.15, 0.1, 0.7])  # rad; roll and pitch out of balance


@pytest.mark.parametrize("k", range(4))
def test_link_on_its_spring_swings_at_the_given_frequency(designed, k):
    """Motor held, other joints locked: the force on joint k by its angle, in the loop itself."""
    omega = 70.0
    springs = Elasticity([omega if j == k else 0.0 for j in range(4)], damping_ratio=0.03)
    design = designed("coupled_pi", {"plant.elasticity": springs})
    diagram = make_loop(design)
    root = diagram.CreateDefaultContext()
    plant = diagram.GetSubsystemByName("multibody_plant").plant
    joints = diagram.GetSubsystemByName("elastic_joints")
    own = plant.GetMyMutableContextFromRoot(root)
    q = design.motion.q[design.torques.d_kk[:, k].argmax()]
    joints.rest(joints.GetMyMutableContextFromRoot(root), q, np.zeros(4))  # the motor, held

    def force(shift, v=0.0):
        """On the links of joint k, with all other joints held still by their own motors."""
        plant.SetPositionsAndVelocities(own, [*(q + shift * np.eye(4)[k]), *(v * np.eye(4)[k])])
        vd = plant.EvalTimeDerivatives(own).CopyToVector()[4:]
        return (plant.CalcMassMatrix(own) @ vd)[k]

    h = 1e-4
    stiffness, damping = (force(-h) - force(h)) / (2 * h), (force(0, -h) - force(0, h)) / (2 * h)
    plant.SetPositions(own, q)
    inertia = plant.CalcMassMatrix(own)[k, k]
    whole = design.robot.plant.CreateDefaultContext()
    design.robot.plant.SetPositions(whole, q)
    rotor = design.robot.plant.CalcMassMatrix(whole)[k, k] - inertia  # which is not in it
    assert rotor == pytest.approx(GEAR[k] ** 2 * ROTORS[k], rel=1e-9)
    assert np.sqrt(stiffness / inertia) == pytest.approx(omega, rel=1e-3)
    assert damping / (2 * omega * inertia) == pytest.approx(0.03, rel=1e-3)


def test_energy_of_the_elastic_plant_is_kept_without_damping(robot):
    elastic, stiffness = np.array([True, True, False, True]), np.array([4e6, 2e5, 0.0, 1e5])
    builder = DiagramBuilder()
    process = RobotPlant(robot=robot, without_rotor=elastic)
    joints = ElasticJoints(
        springs=Springs(elastic, stiffness, np.zeros(4)), rotor_inertia=ROTORS, gear_ratio=GEAR
    )
    builder.AddNamedSystem("process", process)
    builder.AddNamedSystem("joints", joints)
    builder.AddNamedSystem("no_torque", ConstantVectorSource(np.zeros(4)))
    aliases = {("process", "tau"): "tau_link", ("process", "load_torque"): "none"}
    connect_by_name(builder, aliases | {("joints", "tau"): "none", ("no_torque", "y0"): "none"})
    simulator = make_simulator(builder.Build(), period=0.001, accuracy=1e-7)
    root = simulator.get_mutable_context()
    inner = process.plant.GetMyContextFromRoot(root)
    process.rest(process.GetMyMutableContextFromRoot(root), HANGING, [0.3, -1.0, 0.8, 1.5])
    wound = HANGING + np.array([0.002, -0.001, 0, 0.003])
    joints.rest(joints.GetMyMutableContextFromRoot(root), wound, [0.5, -1.2, 0, 1.0])
    seen = []
    for time in np.linspace(0, 0.4, 101):
        simulator.AdvanceTo(time)
        q, v = np.split(process.plant.GetPositionsAndVelocities(inner), 2)
        motors = joints.GetOutputPort("motor_state").Eval(joints.GetMyContextFromRoot(root))
        theta, w = np.split(motors, 2)
        seen.append([
            v @ process.plant.CalcMassMatrix(inner) @ v / 2,
            (GEAR**2 * ROTORS * elastic) @ w**2 / 2,
            process.plant.CalcPotentialEnergy(inner),
            stiffness @ (theta - q) ** 2 / 2,
        ])  # fmt: skip
    swings = np.ptp(np.array(seen), axis=0)
    assert np.all(swings > 5), swings  # every part takes part
    assert np.ptp(np.sum(seen, axis=1)) < 1e-4 * swings.min()
