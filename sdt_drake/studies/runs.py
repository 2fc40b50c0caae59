"""Runs of a study: from the number of a row to its outcomes."""

from __future__ import annotations

import copy
import time
from collections.abc import Mapping

import numpy as np

from sdt_drake.analysis.tracking import stops_passed
from sdt_drake.io.errors import InputError
from sdt_drake.io.fields import check
from sdt_drake.io.resources import PACKAGE_PREFIX, models_dir
from sdt_drake.motion import Plan, load_commanded
from sdt_drake.robot.robot import Robot
from sdt_drake.run.design import Design, load_device, make_design, plan_of
from sdt_drake.run.kinds import load_controllers
from sdt_drake.run.scenario import Scenario
from sdt_drake.run.simulate import Recording, simulate
from sdt_drake.studies.fields import Value, field_names, find_field
from sdt_drake.studies.outcomes import InfeasibleError, outcomes_of
from sdt_drake.studies.study import Study
from sdt_drake.studies.table import Row

_CACHED = 16  # planned motions, with their robots, that a process keeps

Inputs = Mapping[str, Value]
"""Value of each variable of a row, by its name."""

_Planned = tuple[Robot, Plan]

FILE_FIELDS = tuple(field for field in map(find_field, field_names()) if field.file)
"""Fields of a scenario that name a file."""


def with_files(scenario: Scenario, places: Mapping[str, str]) -> Scenario:
    """A copy that has its files at other places; those without one stay."""
    scenario = copy.deepcopy(scenario)
    for field in FILE_FIELDS:
        name = field.get(scenario)
        field.put(scenario, places.get(name, name))
    return scenario


class Runner:
    """Runs rows of a study; keeps robots and planned motions that they share."""

    def __init__(
        self, study: Study, base: Scenario, places: Mapping[str, str] | None = None
    ) -> None:
        """Of a study and its base scenario; places: where files are that go by other names."""
        self.study, self.base, self._places = study, base, dict(places or {})
        self._plans: dict[tuple[str | float, ...], _Planned | InfeasibleError] = {}

    def scenario(self, number: int, inputs: Inputs | None = None) -> Scenario:
        """The scenario of a row, with its inputs as the study draws them by default.

        Raises:
            InputError: for values that their fields do not take.
        """
        if file := self.base.controller.file:  # the row may name what that registers
            load_controllers(self._places.get(file, file))
        scenario = self.study.scenario_of(self.base, inputs or self.study.inputs(number))
        scenario.name = f"{self.study.name}, row {number}"
        return with_files(scenario, self._places)

    def design(self, scenario: Scenario) -> tuple[Design, Plan]:
        """The design of a scenario of the study, and the plan of its motion.

        Raises:
            InfeasibleError: if the device cannot do the motion.
            InputError: for any other bad input.
        """
        check(scenario)  # before planning, which would call bad numbers infeasible
        robot, plan = self._planned(scenario)
        return make_design(scenario, robot=robot, motion=plan.motion), plan

    def _planned(self, scenario: Scenario) -> _Planned:
        """From the cache, which forgets the oldest."""
        how = (scenario.period, scenario.torque_margin, scenario.planner)
        device = (str(scenario.device), str(scenario.drive.n1), str(scenario.drive.n0))
        key = (scenario.robot, *device, scenario.motion, *how)
        if key not in self._plans:
            if len(self._plans) >= _CACHED:
                del self._plans[next(iter(self._plans))]
            self._plans[key] = _plan(scenario)
        planned = self._plans[key]
        if isinstance(planned, InfeasibleError):
            raise InfeasibleError(*planned.args)
        return planned

    def run(self, number: int, inputs: Inputs | None = None) -> Row:
        """Run a row: what becomes of it."""
        start = time.perf_counter()
        try:
            outcomes, _, wrong = self.repeat(number, inputs)
        except Exception as error:  # whatever it is, the study goes on
            return self._failed(number, error, time.perf_counter() - start)
        duration = time.perf_counter() - start
        if wrong:
            return Row(number, "failed", wrong, duration, ())
        return Row(number, "ok", "", duration, outcomes)

    def repeat(
        self, number: int, inputs: Inputs | None = None
    ) -> tuple[tuple[float, ...], Recording, str]:
        """Outcomes and recording of a row; and why it has failed all the same, "" if it has not.

        Raises:
            InputError: if it cannot be run.
        """
        design, plan = self.design(self.scenario(number, inputs))
        recording = simulate(design)
        commanded, pause = plan.commanded.duration, self.study.pause
        outcomes = outcomes_of(self.base, design, recording, commanded, pause)
        wrong = stops_passed(recording, design.robot.joint_names)
        if np.isinf(outcomes).any() or np.isnan(outcomes[: design.robot.n]).any():
            wrong = ["the speeds are not finite"]
        return outcomes, recording, "; ".join(wrong)

    def _failed(self, number: int, error: Exception, duration: float) -> Row:
        status = "infeasible" if isinstance(error, InfeasibleError) else "failed"
        reason = " ".join(str(error).split())
        if not isinstance(error, InputError):
            reason = f"{type(error).__name__}: {reason}"
        # Where a process has its files is its own business: rows are the same everywhere.
        for name, place in self._places.items():
            reason = reason.replace(place, name)
        reason = reason.replace(f"{models_dir()}/", PACKAGE_PREFIX)
        return Row(number, status, reason, duration, ())


def _plan(scenario: Scenario) -> _Planned | InfeasibleError:
    robot = load_device(scenario)
    try:
        return robot, plan_of(scenario, robot)
    except InputError as error:
        load_commanded(scenario.motion, robot, scenario.period)  # not the device's fault: raised
        return InfeasibleError(*error.args)
