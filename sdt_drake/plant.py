"""What of a plant follows from its motion: inertia of the axes, springs of the joints."""

from __future__ import annotations

import numpy as np

from sdt_drake.arrays import Array
from sdt_drake.device import FrictionParameters, Springs, friction_parameters, springs_of
from sdt_drake.dynamics import (
    InertiaRange,
    TorqueGroups,
    effective_inertia,
    gravity_stiffness,
    where_largest,
)
from sdt_drake.errors import InputError
from sdt_drake.motion import Motion
from sdt_drake.robot import Robot
from sdt_drake.scenario import Scenario


def plant_along(
    scenario: Scenario, robot: Robot, motion: Motion, torques: TorqueGroups
) -> tuple[InertiaRange, Array, Springs | None, FrictionParameters | None]:
    """Inertia along the motion, that of the axis process, springs and friction of the joints."""
    plant = scenario.plant
    inertia = InertiaRange.of(effective_inertia(robot, torques.d_kk))
    i_eff = inertia.maximum if plant.i_eff is None else np.array(plant.i_eff)
    springs = _springs(scenario, robot, motion, torques, i_eff)
    friction = None if plant.friction.is_none else friction_parameters(plant.friction, robot.n)
    return inertia, i_eff, springs, friction


def _springs(
    scenario: Scenario, robot: Robot, motion: Motion, torques: TorqueGroups, i_eff: Array
) -> Springs | None:
    """The springs, from the inertia that each sees where it is largest along the motion."""
    elasticity = scenario.plant.elasticity
    if elasticity.is_rigid:
        return None
    if scenario.plant.kind == "axis":
        links = robot.gear_ratio**2 * (i_eff - robot.rotor_inertia)
        k_g = np.zeros(robot.n)
    else:
        links = torques.d_kk.max(axis=0)
        at = motion.q[where_largest(torques.d_kk)]  # a row for each joint
        k_g = np.array([gravity_stiffness(robot, at[k])[k, k] for k in range(robot.n)])
    elastic = np.array(elasticity.natural_frequency) > 0
    for k in np.flatnonzero(elastic):
        if robot.rotor_inertia[k] <= 0 or links[k] <= 0:
            raise InputError(
                f"plant.elasticity: joint {k + 1} has the rotor inertia {robot.rotor_inertia[k]:g} "
                f"kg m² (motor side) and the link inertia {links[k]:g} kg m² (joint side); an "
                "elastic joint needs both > 0"
            )
    return springs_of(elasticity, links, k_g)
