"""Runs of a study: from the number of a row to its outcomes."""

import time
from collections.abc import Mapping

import numpy as np

from sdt_drake.analysis.tracking import stops_passed
from sdt_drake.io.errors import InputError
from sdt_drake.io.names import value_of
from sdt_drake.io.resources import PACKAGE_PREFIX, models_dir
from sdt_drake.motion import Plan, load_commanded
from sdt_drake.robot.robot import Robot
from sdt_drake.run.design import Design, load_device, make_design, plan_of
from sdt_drake.run.options import load_controllers
from sdt_drake.run.recording import Recording
from sdt_drake.run.scenario import Scenario
from sdt_drake.run.simulate import simulate
from sdt_drake.studies.fields import field_names, find_field
from sdt_drake.studies.outcomes import InfeasibleError, outcomes_of, stop_outcomes
from sdt_drake.studies.study import Study
from sdt_drake.studies.table import Row, Value

Inputs = Mapping[str, Value]
"""Values of the variables of a row, by name."""

_Planned = tuple[Robot, Plan]

FILE_FIELDS = tuple(field for field in map(find_field, field_names()) if field.file)
"""Fields of a scenario that name a file."""


def moved(scenario: Scenario, places: Mapping[str, str]) -> dict[str, str]:
    """Return the new paths of the files in `places` that a scenario names, by dotted name."""
    names = {field.name: value_of(scenario, field.name) for field in FILE_FIELDS}
    return {field: places[name] for field, name in names.items() if name in places}


class Runner:
    """A runner of a study's rows. It keeps the robots and planned motions that rows share."""

    def __init__(
        self,
        study: Study,
        base: Scenario,
        places: Mapping[str, str] | None = None,
        *,
        plans: int = 16,
    ) -> None:
        """Make a runner.

        Args:
            study: the study.
            base: its base scenario.
            places: paths of files by their names in study and base.
            plans: largest number of planned motions, with their robots, that are kept.
        """
        self._most = plans
        self.study, self.base, self._places = study, base, dict(places or {})
        self._plans: dict[tuple[object, ...], _Planned | InfeasibleError] = {}

    def scenario(self, number: int, inputs: Inputs | None = None) -> Scenario:
        """Return the scenario of a row; by default with the inputs that the study draws.

        Raises:
            InputError: for values that their fields do not accept.
        """
        if file := self.base.controller.file:  # rows may name controllers that it registers
            load_controllers(self._places.get(file, file))
        changes = moved(self.base, self._places) | {"name": f"{self.study.name}, row {number}"}
        changes |= self.study.changes(self.base, inputs or self.study.inputs(number))
        files = {field.name for field in FILE_FIELDS}
        at = {name: self._places.get(x, x) for name, x in changes.items() if name in files}
        return self.base.changed(changes | at)

    def design(self, scenario: Scenario) -> tuple[Design, Plan]:
        """Return the design of a scenario of the study, and the plan of its motion.

        Raises:
            InfeasibleError: if the motion is beyond the limits of the device.
            InputError: for any other bad input.
        """
        robot, plan = self._planned(scenario)
        return make_design(scenario, robot=robot, motion=plan.motion), plan

    def _planned(self, scenario: Scenario) -> _Planned:
        """Return robot and plan from the cache, which drops the oldest plan when it is full."""
        planning = (scenario.motion, scenario.period, scenario.torque_margin, scenario.planner)
        device = (scenario.robot, scenario.hold, scenario.tip, scenario.device)
        key = (*device, scenario.drive.n1, scenario.drive.n0, *planning)
        if key not in self._plans:
            if len(self._plans) >= self._most:
                del self._plans[next(iter(self._plans))]
            self._plans[key] = _plan(scenario)
        planned = self._plans[key]
        if isinstance(planned, InfeasibleError):
            raise InfeasibleError(*planned.args)
        return planned

    def run(self, number: int, inputs: Inputs | None = None) -> Row:
        """Run a row and return it; an error becomes its status and reason."""
        start = time.perf_counter()
        try:
            outcomes, _, wrong = self.repeat(number, inputs)
        except Exception as error:  # an error of a row does not end the study
            return self._failed(number, error, time.perf_counter() - start)
        duration = time.perf_counter() - start
        if wrong:
            return Row(number, "failed", wrong, duration, ())
        return Row(number, "ok", "", duration, outcomes)

    def repeat(
        self, number: int, inputs: Inputs | None = None
    ) -> tuple[tuple[float, ...], Recording, str]:
        """Run a row; return its outcomes, its recording, and the reason of a failure or "".

        Raises:
            InputError: if the row cannot be run.
        """
        design, plan = self.design(self.scenario(number, inputs))
        recording = simulate(design)
        commanded, pause = plan.commanded.duration, self.study.pause
        outcomes = outcomes_of(self.base, design, recording, commanded, pause)
        wrong = stops_passed(recording, design.device.simulated.joint_names)
        if np.isinf(outcomes).any() or np.isnan(outcomes[: design.device.simulated.n]).any():
            wrong = ["the speeds are not finite"]
        else:
            outcomes += stop_outcomes(self.study.stops, design, recording)
        return outcomes, recording, "; ".join(wrong)

    def _failed(self, number: int, error: Exception, duration: float) -> Row:
        status = "infeasible" if isinstance(error, InfeasibleError) else "failed"
        reason = " ".join(str(error).split())
        if not isinstance(error, InputError):
            reason = f"{type(error).__name__}: {reason}"
        # Paths of this process are replaced: rows must be equal on all machines.
        for name, place in self._places.items():
            reason = reason.replace(place, name)
        reason = reason.replace(f"{models_dir()}/", PACKAGE_PREFIX)
        return Row(number, status, reason, duration, ())


def _plan(scenario: Scenario) -> _Planned | InfeasibleError:
    """Return robot and plan; an InfeasibleError if only the device's limits are the problem."""
    robot = load_device(scenario)
    try:
        return robot, plan_of(scenario, robot)
    except InputError as error:
        load_commanded(scenario.motion, robot, scenario.period)  # raises for a bad motion file
        return InfeasibleError(*error.args)
