"""Elastic joints under a robot, against calculations by hand."""

import numpy as np
import pytest
from by_hand import GEAR, ROTORS
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource

from sdt_drake.robot.device import Elasticity, Springs
from sdt_drake.run.simulate import make_simulator
from sdt_drake.systems import ElasticJoints, RobotPlant, connect_by_name

HANGING = np.array([0.4, 0.15, 0.1, 0.7])  # rad; roll and pitch out of balance


def test_links_on_their_springs_swing_at_the_given_frequency(designed):
    """Motors held, and all other joints locked, where the inertia is largest; gravity helps."""
    omega, ratio, h = 70.0, 0.03, 1e-4
    design = designed("coupled_pi", {"plant.elasticity": Elasticity([omega] * 4, ratio)})
    plant, largest = design.robot.plant, design.torques.d_kk.argmax(axis=0)
    context = plant.CreateDefaultContext()

    def gravity(q):
        plant.SetPositions(context, q)
        return plant.CalcGravityGeneralizedForces(context)

    for k, (sample, e) in enumerate(zip(largest, h * np.eye(4), strict=True)):
        q = design.motion.q[sample]
        stiffness = design.springs.stiffness[k] - (gravity(q + e) - gravity(q - e))[k] / (2 * h)
        plant.SetPositions(context, q)
        inertia = plant.CalcMassMatrix(context)[k, k] - GEAR[k] ** 2 * ROTORS[k]
        assert np.sqrt(stiffness / inertia) == pytest.approx(omega, rel=1e-4)
        assert design.springs.damping[k] / (2 * omega * inertia) == pytest.approx(ratio, rel=1e-3)


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
