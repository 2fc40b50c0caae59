"""Devices that the variables of a study draw, for another design than the study's own."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import replace

from sdt_drake.io.errors import InputError
from sdt_drake.run.design import Design
from sdt_drake.run.scenario import ControllerChoice, Scenario
from sdt_drake.studies.study import Study


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
