"""The loops that learning has to do with: as known, as simulated, as uncertain."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from sdt_drake.arrays import Array
from sdt_drake.design import Design
from sdt_drake.device import Friction, sliding_friction
from sdt_drake.dynamics import inverse_dynamics
from sdt_drake.errors import InputError
from sdt_drake.learning.response import Complex, position_response
from sdt_drake.scenario import ControllerChoice, Scenario
from sdt_drake.studies.study import Study

POINTS = 300
"""Of frequency."""

_LOWEST = 0.1  # rad/s
_HIGHEST = 0.9  # of the Nyquist frequency, where samples can command no speed


@dataclass(frozen=True, eq=False)
class LoopSet:
    """Responses of loops that go by one name.

    Attributes:
        name: for people.
        devices: how many devices they are of.
        responses: each over `frequencies`, of a device in a pose.
        demand: largest share of each motor's torque that the motion takes of a device [-], shape
            (devices, n).
    """

    name: str
    responses: tuple[Complex, ...]
    demand: Array

    @property
    def devices(self) -> int:
        """How many they are of."""
        return len(self.demand)


def loop_set(name: str, designs: Sequence[Design], of: str) -> LoopSet:
    """The loops of some devices to what is learned, in their poses."""
    every = [response for design in designs for response in responses(design, of)]
    return LoopSet(name, tuple(every), np.stack([demand(design) for design in designs]))


def demand(design: Design) -> Array:
    """Largest share of the motors' torque that the planned motion takes of what moves [-], (n,).

    With sliding friction, and the disturbance at its worst. Where it is above 1 motors saturate,
    whatever the reference: linear models end there, and with them learning.
    """
    motion, robot = design.wanted, design.robot
    torque = inverse_dynamics(robot, motion.q, motion.v, motion.vd)
    if design.friction is not None:
        torque = torque + sliding_friction(design.friction, motion.v)
    load = design.scenario.disturbance.amplitude * design.loads.load_torque * robot.gear_ratio
    return np.asarray(np.max((np.abs(torque) + np.abs(load)) / robot.effort_limit, axis=0))


def loops_of(
    design: Design, of: str, *, uncertainty: tuple[Study, Scenario] | None = None, draws: int = 20
) -> list[LoopSet]:
    """The loops that a filter has to converge for; first the one that it is made of.

    Args:
        design: of the loop.
        of: what is learned, one of `LEARNED`.
        uncertainty: a study, of which only the variables of the device count, and its base.
        draws: how many devices of the study, at most.

    Raises:
        InputError: for variables that do not fit the scenario.
    """
    known = known_loop(design)
    sets = [loop_set("the model", [known], of)]
    plant = design.scenario.plant
    is_known = plant.deviation == design.scenario.controller.model and plant.friction.is_none
    if not is_known or design.scenario.disturbance.amplitude > 0:
        sets.append(loop_set("the simulated device", [design], of))
    if uncertainty is not None:
        study, base = uncertainty
        devices = devices_of(design, study, base, draws)
        sets.append(loop_set(f"the devices of {study.name}", devices, of))
    return sets


def responses(design: Design, of: str) -> tuple[Complex, ...]:
    """Of a device to what is learned, in its poses."""
    omega = frequencies(design)
    return tuple(position_response(design, pose, omega, of=of) for pose in poses(design))


def devices_of(design: Design, study: Study, base: Scenario, draws: int) -> list[Design]:
    """Designs of the first rows of a study, with the controller and the motion of a design.

    Args:
        design: of the loop.
        study: its variables are the uncertainty, but for controllers.
        base: of the study; what its variables change and the design does not have is of it.
        draws: how many rows, at most.

    Raises:
        InputError: for variables that do not fit the scenario.
    """
    fixed = [v for v in study.variables if not _is_of_controller(v.targets)]
    if not fixed:
        raise InputError(f"{study.name}: varies nothing but the controller, expected a device")
    scenario = copy.deepcopy(design.scenario)
    scenario.learned = ""
    if scenario.plant.deviation.exact:
        scenario.plant.deviation = base.plant.deviation
    if scenario.plant.friction.is_none:
        scenario.plant.friction = base.plant.friction
    uncertain = replace(study, variables=fixed, accuracy=scenario.accuracy)
    uncertain.validate(scenario)
    count = min(len(uncertain), draws)
    return [
        design.variant(uncertain.scenario_of(scenario, uncertain.inputs(row)))
        for row in range(count)
    ]


def _is_of_controller(targets: Sequence[object]) -> bool:
    return any(getattr(target, "type", None) is ControllerChoice for target in targets)


def frequencies(design: Design) -> Array:
    """At which loops are known [rad/s]: below the Nyquist frequency, shape (POINTS,)."""
    return np.geomspace(_LOWEST, _HIGHEST * np.pi / design.motion.period, POINTS)


def known_loop(design: Design) -> Design:
    """The loop as its engineer knows it: what moves is the controller's model of it."""
    scenario = copy.deepcopy(design.scenario)
    scenario.plant.deviation = scenario.controller.model
    scenario.plant.friction, scenario.controller.friction_compensation = Friction(), False
    scenario.learned = ""
    return design.variant(scenario)


def poses(design: Design) -> list[int]:
    """Samples of the motion at which the inertia of any joint is largest or smallest."""
    d_kk = design.torques.d_kk
    return sorted({*d_kk.argmax(axis=0).tolist(), *d_kk.argmin(axis=0).tolist()})
