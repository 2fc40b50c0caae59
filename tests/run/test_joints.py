"""Friction and elastic joints under a robot or axes, against calculations by hand."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from by_hand import GEAR, ROTORS
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource

from sdt_drake.robot.device import Elasticity, FrictionParameters, Springs
from sdt_drake.run.loop import make_loop
from sdt_drake.run.simulate import make_simulator
from sdt_drake.systems import (
    ElasticJoints,
    JointFriction,
    RobotPlant,
    connect_by_name,
)

HANGING = np.array([0.4, 0.15, 0.1, 0.7])  # rad; roll and pitch out of balance

# --- friction --------------------------------------------------------------------------------

STICKY = FrictionParameters(
    coulomb=np.array([500.0, 400.0, 300.0, 100.0]),
    viscous=np.array([40.0, 5.0, 2.0, 1.0]),
    breakaway=np.array([700.0, 500.0, 300.0, 130.0]),
    stribeck_speed=0.02,
    presliding=1e-5,
    offset=np.zeros(4),
)


class Free:
    """The plant with friction, without torque of the motors, at HANGING."""

    def __init__(self, robot, friction, *, v=(0, 0, 0, 0), accuracy=1e-4):
        builder = DiagramBuilder()
        self.block = builder.AddNamedSystem("plant", RobotPlant(robot=robot))
        joints = JointFriction(friction=friction, gear_ratio=GEAR)
        self.joints = builder.AddNamedSystem("joints", joints)
        builder.AddNamedSystem("no_torque", ConstantVectorSource(np.zeros(4)))
        connect_by_name(builder, {("plant", "load_torque"): "friction", ("no_torque", "y0"): "tau"})
        self.simulator = make_simulator(builder.Build(), period=0.001, accuracy=accuracy)
        root = self.simulator.get_mutable_context()
        self.block.rest(self.block.GetMyMutableContextFromRoot(root), HANGING, v)
        self.plant = self.block.plant

    @property
    def context(self):
        return self.plant.GetMyContextFromRoot(self.simulator.get_context())

    def q_at(self, time):
        self.simulator.AdvanceTo(time)
        return self.plant.GetPositions(self.context)


def test_friction_holds_the_plant_under_a_load_and_lets_go_under_a_larger_one(robot):
    held = Free(robot, STICKY)
    load = np.abs(held.plant.CalcGravityGeneralizedForces(held.context))
    assert load.max() > 200 and np.all(load < 0.9 * STICKY.coulomb)
    np.testing.assert_allclose(held.q_at(3.0), HANGING, rtol=0, atol=1e-4)
    weak = dataclasses.replace(STICKY, coulomb=STICKY.coulomb / 10, breakaway=STICKY.breakaway / 10)
    assert np.abs(Free(robot, weak).q_at(1.0) - HANGING).max() > 0.05


def test_energy_of_the_plant_with_friction_never_rises(robot):
    """Kinetic, potential, and stored in the bristles, at every step of the integrator."""
    free = Free(robot, STICKY, v=[0.05, -1.5, 1.0, 2.0], accuracy=1e-7)
    energies, speeds = [], []

    def see(root):
        bristles = free.joints.GetMyContextFromRoot(root).get_continuous_state_vector()
        z = 100 * bristles.CopyToVector()
        stored = np.where(np.abs(z) > 1, np.abs(z) - 0.5, z**2 / 2)
        context, plant = free.plant.GetMyContextFromRoot(root), free.plant
        v = plant.GetVelocities(context)
        # CalcKineticEnergy leaves out the rotors.
        kinetic = v @ plant.CalcMassMatrix(context) @ v / 2
        in_bristles = STICKY.coulomb @ stored * STICKY.presliding
        energies.append(kinetic + plant.CalcPotentialEnergy(context) + in_bristles)
        speeds.append(np.abs(v).max())

    free.simulator.set_monitor(see)
    free.simulator.AdvanceTo(6.0)
    assert len(energies) > 1000 and speeds[-1] < 1e-4  # at rest in the end
    assert np.diff(energies).max() < 1e-6 * (energies[0] - energies[-1])


# --- elastic joints --------------------------------------------------------------------------


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


class Elastic:
    """A process behind springs, without torque of the motors."""

    def __init__(self, process, springs):
        builder, zero = DiagramBuilder(), ConstantVectorSource(np.zeros(4))
        joints = ElasticJoints(springs=springs, rotor_inertia=ROTORS, gear_ratio=GEAR)
        self.process = builder.AddNamedSystem("process", process)
        self.joints = builder.AddNamedSystem("joints", joints)
        builder.AddNamedSystem("no_torque", zero)
        aliases = {("process", "tau"): "tau_link", ("process", "load_torque"): "none"}
        connect_by_name(builder, aliases | {("joints", "tau"): "none", ("no_torque", "y0"): "none"})
        self.diagram = builder.Build()

    def start(self, q, v, q_motor, v_motor, accuracy):
        simulator = make_simulator(self.diagram, period=0.001, accuracy=accuracy)
        root = simulator.get_mutable_context()
        self.process.rest(self.process.GetMyMutableContextFromRoot(root), q, v)
        self.joints.rest(self.joints.GetMyMutableContextFromRoot(root), q_motor, v_motor)
        return simulator

    def states(self, simulator):
        """q, v, theta, w."""
        root = simulator.get_context()
        return [
            part
            for block, name in ((self.process, "state"), (self.joints, "motor_state"))
            for part in np.split(
                block.GetOutputPort(name).Eval(block.GetMyContextFromRoot(root)), 2
            )
        ]


def test_energy_of_the_elastic_plant_is_kept_without_damping(robot):
    springs = Springs(
        np.array([True, True, False, True]), np.array([4e6, 2e5, 0.0, 1e5]), np.zeros(4)
    )
    elastic = Elastic(RobotPlant(robot=robot, without_rotor=springs.elastic), springs)
    plant = elastic.process.plant
    wound = HANGING + np.array([0.002, -0.001, 0, 0.003])
    simulator = elastic.start(HANGING, [0.3, -1.0, 0.8, 1.5], wound, [0.5, -1.2, 0, 1.0], 1e-7)
    seen = []
    for time in np.linspace(0, 0.4, 101):
        simulator.AdvanceTo(time)
        q, v, theta, w = elastic.states(simulator)
        context = plant.GetMyContextFromRoot(simulator.get_context())
        seen.append([
            v @ plant.CalcMassMatrix(context) @ v / 2,
            (GEAR**2 * ROTORS * springs.elastic) @ w**2 / 2,
            plant.CalcPotentialEnergy(context),
            springs.stiffness @ (theta - q) ** 2 / 2,
        ])  # fmt: skip
    swings = np.ptp(np.array(seen), axis=0)
    assert np.all(swings > 5), swings  # every part takes part
    assert np.ptp(np.sum(seen, axis=1)) < 1e-4 * swings.min()
