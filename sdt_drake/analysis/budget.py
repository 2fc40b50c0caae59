"""Error budget: which part of the speed error comes from what, by superposition runs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from sdt_drake.analysis.threads import threads
from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError
from sdt_drake.io.progress import as_part, part
from sdt_drake.motion import Motion
from sdt_drake.robot.device import Friction, sliding_friction
from sdt_drake.run.design import Design
from sdt_drake.run.simulate import simulate

PARTS = ("reference lag", "load", "disturbance", "saturation")

_ACCURACY = 2e-6  # of which the axis plant takes a twentieth: sums of runs then agree to 1e-7 rad/s
_NO_LIMIT = 1e9  # times the motors' torque


@dataclass(frozen=True, eq=False)
class ErrorBudget:
    """The speed error of a run, and what it consists of; joint side, shape (N + 1, n) [rad/s].

    Attributes:
        time: [s], shape (N + 1,).
        whole: the speed error.
        parts: by name. "reference lag": the loop follows its reference late, with no load at all.
            "load": what the load torque does, less what the feedforward takes of it.
            "disturbance": what the model does not know of the load. "saturation": the run less
            the same one with motors that do not saturate.
        remainder: what is left: what friction does, less what its compensation takes of it, and
            increments of encoders; without both, round-off.
    """

    time: Array
    whole: Array
    parts: Mapping[str, Array]
    remainder: Array


def error_budget(design: Design) -> ErrorBudget:
    """Runs of a design on the axis plant: whole, without limits, with the reference alone, the load
    alone, and the disturbance.

    Reference, load and disturbance are each given to the loop alone; that their responses add up
    holds for linear loops only, and so for the axis plant only: on the coupled one the load is a
    function of the motion.

    Raises:
        InputError: for the coupled plant, or a scenario with on-line inverse dynamics.
    """
    scenario = design.scenario
    if scenario.plant.kind != "axis":
        raise InputError(
            "plant.kind: coupled, but an error budget adds responses up, which only the axis "
            "plant allows; expected axis"
        )
    if scenario.learned:
        raise InputError("learned: has no part in an error budget; remove")
    if scenario.inverse_dynamics != "table":
        raise InputError("inverse_dynamics: online, but an error budget needs table")
    free = _without_limits(design)
    smooth = _without_friction(free)
    at_rest = _without_motion(smooth)
    only_reference = _without_load(_undisturbed(smooth))
    runs = [design, free, only_reference, _undisturbed(at_rest), at_rest]
    if scenario.disturbance.amplitude == 0:
        runs.pop()
    with part(), threads(2) as pool:
        run = as_part(_speed_error, 1 / len(runs))
        whole, unlimited, reference, load, *disturbed = pool.map(run, runs)
    disturbance = disturbed[0] - load if disturbed else np.zeros_like(load)
    parts = dict(zip(PARTS, (reference, load, disturbance, whole - unlimited), strict=True))
    return ErrorBudget(design.motion.time, whole, parts, whole - sum(parts.values()))


def _speed_error(design: Design) -> Array:
    return simulate(_with(design, accuracy=_ACCURACY)).speed_error


def _with(design: Design, **fields: Any) -> Design:
    """With other fields of its scenario, and nothing computed anew."""
    return replace(design, scenario=replace(design.scenario, **fields))


def _undisturbed(design: Design) -> Design:
    return _with(design, disturbance=replace(design.scenario.disturbance, amplitude=0.0))


def _without_limits(design: Design) -> Design:
    most = _NO_LIMIT * design.robot.effort_limit
    robot = replace(design.robot, effort_limit=most, envelope=None)
    drive = replace(design.scenario.drive, n1=None, n0=None)
    return replace(_with(design, drive=drive), robot=robot)


def _without_friction(design: Design) -> Design:
    """Nor with its compensation."""
    plant = replace(design.scenario.plant, friction=Friction())
    smooth = replace(_with(design, plant=plant), friction=None)
    is_compensated = design.scenario.controller.friction_compensation
    if design.friction is None or design.tau_ff is None or not is_compensated:
        return smooth
    tau_f = sliding_friction(design.friction, design.motion.v) / design.robot.gear_ratio
    return replace(smooth, tau_ff=design.tau_ff - tau_f, steady_ff=design.steady_ff - tau_f[0])


def _without_load(design: Design) -> Design:
    """Only the reference: of the feedforward, what belongs to the joint's own motion."""
    loads = design.loads._replace(load_torque=np.zeros_like(design.loads.load_torque))
    tau_ff = None if design.tau_ff is None else design.tau_ff - _load_ff(design, design.tau_ff)
    no_load = 0 * design.steady_load
    return replace(design, loads=loads, tau_ff=tau_ff, steady_load=no_load, steady_ff=0.0)


def _without_motion(design: Design) -> Design:
    """Only the load, and of the feedforward what belongs to it, with a reference at rest."""
    nothing = np.zeros_like(design.motion.v)
    at_rest = Motion(design.motion.period, nothing, nothing, nothing)
    tau_ff = None if design.tau_ff is None else _load_ff(design, design.tau_ff)
    return replace(design, wanted=at_rest, motion=at_rest, tau_ff=tau_ff)


def _load_ff(design: Design, tau_ff: Array) -> Array:
    """The part of the feedforward that answers the load, motor side [N m]: all of it but the
    inertia of the axis process."""
    if design.scenario.controller.feedforward_in_use != "id":
        return tau_ff
    gain = np.array(design.scenario.controller.feedforward_gain or 1.0)
    own = design.i_eff * design.robot.gear_ratio * design.motion.vd
    return tau_ff - gain * own
