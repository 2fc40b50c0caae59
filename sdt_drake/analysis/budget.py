"""Error budget: the share of each cause in the speed error, found by removing it from the loop."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError
from sdt_drake.io.progress import with_progress
from sdt_drake.robot.device import Friction
from sdt_drake.run.design import Design
from sdt_drake.run.loop import Loop, make_loop
from sdt_drake.run.scenario import Scenario
from sdt_drake.run.simulate import simulate
from sdt_drake.run.threads import threads
from sdt_drake.run.tuning import Feedforward

PARTS = ("reference lag", "load", "disturbance", "saturation")

_ACCURACY = 2e-6
"""Accuracy of the integrator, tightened 20-fold on the axis plant; errors good to 1e-7 rad/s."""

_SMOOTH = {"plant.friction": Friction(), "controller.friction_compensation": False}
_RESOLUTION_FACTOR = 1e6
"""Factor on the increments per turn; encoders so fine have no effect."""


@dataclass(frozen=True, eq=False)
class ErrorBudget:
    """A speed error and its parts; joint side [rad/s], shape (N + 1, n)."""

    time: Array
    """Time of the samples [s], shape (N + 1,)."""
    whole: Array
    """Speed error of the run."""
    parts: Mapping[str, Array]
    """Parts by name. "reference lag": error of the loop without load. "load": effect of the load
    torque that the feedforward leaves. "disturbance": effect of the unmodelled part of the load.
    "saturation": error of the run less that of the same run with unlimited motors."""
    remainder: Array
    """Effect of encoder increments, and of the friction that its compensation leaves; 0 without
    both."""


def error_budget(design: Design) -> ErrorBudget:
    """Return the error budget of a design on the axis plant.

    The design runs without one cause after the other: motor limits, friction and encoder
    increments, disturbance, load. The change of the error is the part of the cause. Without limits
    and friction the loop is linear, and the order of removal does not matter. On the coupled plant
    the load depends on the motion and cannot be removed.

    Raises:
        InputError: the plant is coupled, the inverse dynamics is on-line, or the design has a
            learned reference or another feedforward than its controller's own.
    """
    scenario = design.scenario
    if scenario.plant.kind != "axis":
        raise InputError(
            "coupled; an error budget adds up responses, which is valid on the axis plant only; "
            "expected axis",
            place="plant.kind",
        )
    if scenario.learned or design.learned is not None:
        raise InputError("has no part in an error budget; remove it", place="learned")
    if design.feedforward_override is not None:
        text = "another torque feedforward than the controller's own"
        raise InputError(f"{text} has no part in an error budget", place="design")
    if scenario.inverse_dynamics != "table":
        raise InputError("online; an error budget requires table", place="inverse_dynamics")
    fine = scenario.drive.encoder_resolution
    fine = None if fine is None else tuple(_RESOLUTION_FACTOR * x for x in fine)
    smooth = scenario.changed({**_SMOOTH, "drive.encoder_resolution": fine})
    calm = smooth.changed({"disturbance.amplitude": 0.0})

    def exact(scenario: Scenario, override: Feedforward | None = None) -> Design:
        exact = replace(scenario, accuracy=_ACCURACY)
        return replace(design, scenario=exact, feedforward_override=override)

    def unlimited(design: Design) -> Loop:
        return make_loop(design.assuming(limited=False))

    loops = [make_loop(exact(scenario)), unlimited(exact(scenario))]
    for less, more in ((smooth, scenario), (calm, smooth)):
        loops.append(loops[-1] if less == more else unlimited(exact(less)))
    unloaded = exact(calm, _own_feedforward(design))
    loops.append(unlimited(unloaded.assuming(loaded=False)))
    distinct = list(dict.fromkeys(loops))
    with threads(2) as pool:
        ran = pool.map(lambda loop: simulate(loop).speed_error, distinct)
        errors = dict(zip(distinct, with_progress(ran, len(distinct)), strict=True))
    whole, free, linear, undisturbed, reference = (errors[loop] for loop in loops)
    differences = (reference, undisturbed - reference, linear - undisturbed, whole - free)
    parts = dict(zip(PARTS, differences, strict=True))
    return ErrorBudget(design.reference.tracked.time, whole, parts, whole - sum(parts.values()))


def _own_feedforward(design: Design) -> Feedforward:
    """Return the feedforward of an axis without load: its inertia torque for "id", else none."""
    choice = design.scenario.controller
    if choice.feedforward_in_use != "id":
        return Feedforward()
    gain = np.array(choice.feedforward_gain or 1.0)
    return Feedforward(
        gain * design.i_eff * design.device.simulated.gear_ratio * design.reference.tracked.vd
    )
