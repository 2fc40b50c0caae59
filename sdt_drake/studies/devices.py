"""Uncertain devices drawn from a study, combined with another design's controller and motion."""

from dataclasses import replace
from typing import Any

from sdt_drake.io.errors import InputError
from sdt_drake.run.design import Design
from sdt_drake.run.options import ControllerOptions
from sdt_drake.run.scenario import Scenario
from sdt_drake.studies.study import Study


def devices_of(design: Design, study: Study, base: Scenario, draws: int) -> list[Design]:
    """Return a design for each of a study's first rows, with one controller and motion for all.

    Args:
        design: design whose controller and motion are used.
        study: study whose variables are the uncertainty; those of the controller are left out.
        base: base scenario of the study. Its deviation and friction are used where the design's
            plant has none, since variables may scale them.
        draws: maximum number of rows.

    Raises:
        InputError: if the study varies only the controller, or a variable does not fit.
    """
    fixed = [v for v in study.variables if all(x.type is not ControllerOptions for x in v.targets)]
    if not fixed:
        raise InputError(
            f"{study.name}: variables: vary only the controller, expected a field of the plant"
        )
    plant, changes = design.scenario.plant, dict[str, Any](learned="")
    if plant.deviation.exact:
        changes["plant.deviation"] = base.plant.deviation
    if plant.friction.is_none:
        changes["plant.friction"] = base.plant.friction
    scenario, unlearned = design.scenario.changed(changes), replace(design, learned=None)
    uncertain = replace(study, variables=fixed, accuracy=scenario.accuracy)
    uncertain.validate(scenario)
    rows = map(uncertain.inputs, range(min(len(uncertain), draws)))
    return [unlearned.variant(scenario.changed(uncertain.changes(scenario, row))) for row in rows]
