"""Gains and torque feedforward of a scenario's controller, from the controller's model."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from sdt_drake.io.arrays import Array
from sdt_drake.motion import Motion
from sdt_drake.robot.device import friction_parameters, sliding_friction
from sdt_drake.robot.dynamics import TorqueGroups
from sdt_drake.robot.robot import Robot
from sdt_drake.run.scenario import Scenario
from sdt_drake.systems.gains import SpeedGains, feedforward_torque, tune

FeedforwardLaw = Callable[[Sequence[Array], Array, Array], Array]
"""Function that returns the torque feedforward, motor side [N m].

Arguments: torque groups of a model [N m], v_ref [rad/s] and vd_ref [rad/s²], joint side."""


class Feedforward(NamedTuple):
    """A torque feedforward, motor side; none by default."""

    along: Array | None = None
    """Torque at the samples of the motion [N m], shape (N + 1, n); None without feedforward."""
    steady: Array | float = 0.0
    """Torque in steady motion at the initial speed, where a run starts [N m], shape (n,)."""


def gains_of(scenario: Scenario, i_eff_max: Array, robot: Robot) -> SpeedGains:
    """Return the gains that the scenario gives, or tune them to the largest inertia.

    Args:
        scenario: gives kp and ki, or omega_r, omega_ratio and zeta.
        i_eff_max: largest effective inertia, motor side [kg m²], shape (n,).
        robot: scales omega_r by its `frequency_factor`.
    """
    controller = scenario.controller
    if controller.kp is not None and controller.ki is not None:
        return SpeedGains(kp=np.array(controller.kp), ki=np.array(controller.ki))
    zeta = 1.0 if controller.zeta is None else controller.zeta
    omega_r = (controller.omega_r or 0.0) * robot.frequency_factor
    return tune(i_eff_max, omega_r, zeta, controller.omega_ratio)


def feedforward_of(scenario: Scenario, model: Robot) -> FeedforwardLaw | None:
    """Return the law gain feedforward_torque + friction(v_ref) / r; None if both are off."""
    choice, friction = scenario.controller, scenario.plant.friction
    kind = choice.feedforward_in_use
    if kind == "none" and not choice.friction_compensation:
        return None
    gain = 1.0 if choice.feedforward_gain is None else np.array(choice.feedforward_gain)
    parameters = friction_parameters(friction, model.n)

    def law(groups: Sequence[Array], v: Array, vd: Array) -> Array:
        tau_ff = gain * feedforward_torque(kind, model, groups, vd, scenario.algorithm)
        if choice.friction_compensation:
            tau_ff = tau_ff + sliding_friction(parameters, v) / model.gear_ratio
        return tau_ff

    return law


def law_along(law: FeedforwardLaw, torques: TorqueGroups, motion: Motion) -> Array:
    """Return the torque of a law along a motion, motor side [N m], shape (N + 1, n)."""
    groups = (torques.inertial, torques.reaction, torques.velocity, torques.gravity)
    return law(groups, motion.v, motion.vd)
