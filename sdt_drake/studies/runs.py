"""Runs of a study: from the number of a row to its outcomes."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from sdt_drake.analysis.tracking import felt_of, motor_use, stops_passed, track
from sdt_drake.design import Design, load_device, load_plan, make_design
from sdt_drake.dynamics import TorqueGroups, torque_groups
from sdt_drake.errors import InputError
from sdt_drake.fields import check
from sdt_drake.motion import Plan
from sdt_drake.pilot import has_head
from sdt_drake.resources import PACKAGE_PREFIX, models_dir
from sdt_drake.robot import Robot
from sdt_drake.scenario import Scenario
from sdt_drake.simulate import Recording, simulate
from sdt_drake.studies.fields import find_field
from sdt_drake.studies.journal import Row
from sdt_drake.studies.motor_load import has_motor_loads, motor_load_names, motor_loads
from sdt_drake.studies.study import Study

_TRACKING = (
    "max_abs_speed_error",
    "rms_speed_error",
    "constant_speed_error",
    "saturated_fraction",
    "max_abs_position_error",
)
_MOTORS = ("peak_torque_share", "rms_torque_share")
_CACHED = 16  # robots and motions that a process keeps

FILE_FIELDS = tuple(map(find_field, ("robot", "motion", "device.catalogue", "controller.file")))
"""Fields of a scenario that name a file."""


def outcome_names(base: Scenario, n: int) -> tuple[str, ...]:
    """Of the numbers that a run ends with: joint k's of n are called name_k."""
    names = [f"{name}_{k + 1}" for name in (*_TRACKING, *_MOTORS) for k in range(n)]
    loads = motor_load_names(n) if has_motor_loads(base) else ()
    return (*names, "felt_share", *loads)


class Runner:
    """Runs rows of a study; keeps robots and planned motions that they share."""

    def __init__(
        self, study: Study, base: Scenario, places: Mapping[str, str] | None = None
    ) -> None:
        """Of a study and its base scenario; places: where files are that go by other names."""
        self._study, self._base, self._places = study, base, dict(places or {})
        self._robots: dict[str, Robot] = {}
        self._plans: dict[tuple, tuple[Plan, TorqueGroups] | InputError] = {}

    def scenario(self, number: int) -> Scenario:
        """Of a row.

        Raises:
            InputError: for values that their fields do not take.
        """
        scenario = self._study.scenario_of(self._base, self._study.inputs(number))
        scenario.name = f"{self._study.name}, row {number}"
        for field in FILE_FIELDS:
            name = field.get(scenario)
            if name in self._places:
                field.set(scenario, self._places[name])
        return scenario

    def design(self, scenario: Scenario) -> tuple[Design, Plan]:
        """Of a scenario of the study; and the plan of its motion.

        Raises:
            InfeasibleError: if the device cannot do the motion.
            InputError: for any other bad input.
        """
        check(scenario)  # before planning, which would call bad numbers infeasible
        robot = self._robot(scenario)
        plan, torques = self._plan(scenario, robot)
        return make_design(scenario, robot=robot, motion=plan.motion, torques=torques), plan

    def _robot(self, scenario: Scenario) -> Robot:
        key = f"{scenario.robot} {scenario.device}"
        return _cached(self._robots, key, lambda: load_device(scenario))

    def _plan(self, scenario: Scenario, robot: Robot) -> tuple[Plan, TorqueGroups]:
        choice = (scenario.motion, scenario.period, scenario.torque_margin, scenario.planner)

        def plan() -> tuple[Plan, TorqueGroups] | InputError:
            path, period, torque_margin, planner = choice
            try:
                plan = load_plan(
                    path, robot, period=period, torque_margin=torque_margin, planner=planner
                )
                motion = plan.motion
                return plan, torque_groups(robot, motion.q, motion.v, motion.vd)
            except InputError as error:
                return error

        planned = _cached(self._plans, (robot.sdf, *choice), plan)
        if isinstance(planned, InputError):
            raise InfeasibleError(str(planned))
        return planned

    def run(self, number: int) -> Row:
        """What becomes of a row."""
        start = time.perf_counter()
        try:
            design, plan = self.design(self.scenario(number))
            recording = simulate(design)
            outcomes = self._outcomes(design, recording, plan)
            passed = stops_passed(recording, design.robot.joint_names)
        except Exception as error:  # whatever it is, the study goes on
            return self._failed(number, error, time.perf_counter() - start)
        duration, joints = time.perf_counter() - start, design.robot.n
        if np.isinf(outcomes).any() or np.isnan(outcomes[:joints]).any():
            return Row(number, "failed", "the speeds are not finite", duration, ())
        if passed:
            return Row(number, "failed", "; ".join(passed), duration, ())
        return Row(number, "ok", "", duration, outcomes)

    def repeat(self, number: int) -> tuple[tuple[float, ...], Recording]:
        """Outcomes and recording of a row, run once more.

        Raises:
            InputError: if it cannot be run.
        """
        design, plan = self.design(self.scenario(number))
        recording = simulate(design)
        return self._outcomes(design, recording, plan), recording

    def _outcomes(self, design: Design, recording: Recording, plan: Plan) -> tuple[float, ...]:
        outcomes = outcomes_of(design, recording)
        if has_motor_loads(self._base) and has_motor_loads(design.scenario):
            commanded, pause = plan.commanded.duration, self._study.pause
            outcomes += motor_loads(design, recording, commanded, pause)
        return self._filled(outcomes, design.robot.n)

    def _filled(self, outcomes: tuple[float, ...], n: int) -> tuple[float, ...]:
        """With NaN for what the rows of the study have and this one does not."""
        return outcomes + (np.nan,) * (len(outcome_names(self._base, n)) - len(outcomes))

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


class InfeasibleError(InputError):
    """The device cannot do the motion."""


def outcomes_of(design: Design, recording: Recording) -> tuple[float, ...]:
    """The numbers of a run up to felt_share, as `outcome_names` names them."""
    tracking = track(recording, design.motion)
    motors = motor_use(recording, design.robot)
    parts = [getattr(tracking, name) for name in _TRACKING]
    parts += [motors.peak_share, motors.rms_share]
    felt = np.nan  # the axis plant is no device that one could sit in
    if has_head(design.robot) and design.scenario.plant.kind == "coupled":
        felt = felt_of(recording, design.robot).share
    return tuple(np.concatenate([*parts, [felt]]).tolist())


def _cached(cache: dict, key: Any, make: Callable[[], Any]) -> Any:
    """From the cache, which forgets the oldest."""
    if key not in cache:
        if len(cache) >= _CACHED:
            del cache[next(iter(cache))]
        cache[key] = make()
    return cache[key]
