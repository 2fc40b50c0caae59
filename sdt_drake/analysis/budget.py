"""Error budget: which part of the speed error comes from what, by leaving it out of the loop."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from sdt_drake.analysis.threads import threads
from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError
from sdt_drake.io.progress import with_progress
from sdt_drake.robot.device import Friction
from sdt_drake.run.design import Design
from sdt_drake.run.loop import Loop
from sdt_drake.run.scenario import Scenario, with_fields
from sdt_drake.run.simulate import simulate
from sdt_drake.run.tuning import Feedforward

PARTS = ("reference lag", "load", "disturbance", "saturation")

_ACCURACY = 2e-6  # of which the axis plant takes a twentieth: errors are good to 1e-7 rad/s
_SMOOTH = {"plant.friction": Friction(), "controller.friction_compensation": False}
_FINER = 1e6  # increments of encoders: none to be seen


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
        remainder: what friction does, less what its compensation takes of it, and increments of
            encoders; without both, 0.
    """

    time: Array
    whole: Array
    parts: Mapping[str, Array]
    remainder: Array


def error_budget(design: Design) -> ErrorBudget:
    """Run a design on the axis plant, and leave out one cause after the other: limits of the
    motors, friction and increments of encoders, disturbance, load.

    What a run loses is due to what it lacks. Without limits and friction the loop is linear, and
    the order does not matter. On the coupled plant the load cannot be left out: it is a function of
    the motion.

    Raises:
        InputError: for the coupled plant, or a scenario with on-line inverse dynamics.
    """
    scenario = design.scenario
    if scenario.plant.kind != "axis":
        raise InputError(
            "coupled, but an error budget adds responses up, which only the axis "
            "plant allows; expected axis",
            place="plant.kind",
        )
    if scenario.learned:
        raise InputError("has no part in an error budget; remove", place="learned")
    if scenario.inverse_dynamics != "table":
        raise InputError("online, but an error budget needs table", place="inverse_dynamics")
    smooth = with_fields(scenario, _SMOOTH)
    if (increments := scenario.drive.encoder_resolution) is not None:
        smooth.drive.encoder_resolution = [_FINER * x for x in increments]
    calm = with_fields(smooth, {"disturbance.amplitude": 0.0})

    def exact(scenario: Scenario, fed: Feedforward | None = None) -> Design:
        return replace(design, scenario=replace(scenario, accuracy=_ACCURACY), fed=fed)

    loops = [Loop(exact(scenario)), Loop(exact(scenario), limited=False)]
    for less, more in ((smooth, scenario), (calm, smooth)):
        loops.append(loops[-1] if less == more else Loop(exact(less), limited=False))
    unloaded = exact(calm, _own_feedforward(design))
    loops.append(Loop(unloaded, limited=False, loaded=False))
    distinct = list(dict.fromkeys(loops))
    with threads(2) as pool:
        ran = pool.map(lambda loop: simulate(loop.design, loop).speed_error, distinct)
        errors = dict(zip(distinct, with_progress(ran, len(distinct)), strict=True))
    whole, free, linear, undisturbed, reference = (errors[loop] for loop in loops)
    differences = (reference, undisturbed - reference, linear - undisturbed, whole - free)
    parts = dict(zip(PARTS, differences, strict=True))
    return ErrorBudget(design.motion.time, whole, parts, whole - sum(parts.values()))


def _own_feedforward(design: Design) -> Feedforward:
    """The part of the feedforward that an axis needs without load: its inertia, with "id" alone."""
    choice = design.scenario.controller
    if choice.feedforward_in_use != "id":
        return Feedforward()
    gain = np.array(choice.feedforward_gain or 1.0)
    return Feedforward(gain * design.i_eff * design.robot.gear_ratio * design.motion.vd)
