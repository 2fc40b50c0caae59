"""Robots with friction alone: rest stays rest, and energy only falls."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource
from strategies import GENERATORS, robots

from sdt_drake.robot.device import FrictionParameters
from sdt_drake.systems import JointFriction, RobotPlant, connect_by_name


def with_friction(robot, coulomb):
    """A robot that friction alone brakes; its plant, its friction and a simulator."""
    n, builder = robot.n, DiagramBuilder()
    strengths = coulomb, 0.1 * coulomb, 1.2 * coulomb  # with viscous friction and breakaway
    parameters = FrictionParameters(*strengths, 0.02, 1e-5, np.zeros(n))
    plant = builder.AddNamedSystem("plant", RobotPlant(robot=robot))
    friction = JointFriction(friction=parameters, gear_ratio=robot.gear_ratio)
    builder.AddNamedSystem("friction", friction)
    builder.AddNamedSystem("motors", ConstantVectorSource(np.zeros(n)))
    names = {("motors", "y0"): "tau", ("friction", "friction"): "load_torque"}
    connect_by_name(builder, names)
    simulator = Simulator(builder.Build())
    simulator.get_mutable_integrator().set_maximum_step_size(1e-3)
    return plant, friction, simulator


@settings(max_examples=6)
@given(robot=robots(), rng=GENERATORS)
def test_energy_falls_with_friction_and_rest_stays_rest(robot, rng):
    n = robot.n
    q = rng.uniform(-2, 2, n)
    robot.plant.SetPositions(context := robot.plant.CreateDefaultContext(), q)
    gravity = robot.plant.CalcGravityGeneralizedForces(context)
    for at_rest in (False, True):
        coulomb = np.full(n, 1.1 * np.abs(gravity).max() + 1) if at_rest else np.full(n, 5.0)
        plant, friction, simulator = with_friction(robot, coulomb)
        context = simulator.get_mutable_context()
        v = np.zeros(n) if at_rest else rng.uniform(-1, 1, n)
        plant.rest(plant.GetMyMutableContextFromRoot(context), q, v)
        friction.rest(friction.GetMyMutableContextFromRoot(context), v)
        own, inner = plant.plant, plant.plant.GetMyContextFromRoot(context)
        energy = [np.inf]
        for k in range(6):
            simulator.AdvanceTo(0.02 * k)
            energy.append(own.EvalKineticEnergy(inner) + own.EvalPotentialEnergy(inner))
        stored = 1e-5 * coulomb.sum()  # bristles [J]
        assert np.all(np.diff(energy) <= stored + 1e-6 * np.abs(energy[1]))
        if at_rest:
            assert np.all(np.abs(own.GetPositions(inner) - q) < 2e-5)
