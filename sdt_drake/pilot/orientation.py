"""Predicted orientation that a pilot perceives during a recorded motion of the head.

`sdt_drake.pilot.reported` compares the predictions with reports of people.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from threading import Lock
from typing import TYPE_CHECKING

import numpy as np
from pydrake.systems.framework import Context, Diagram, DiagramBuilder
from pydrake.systems.primitives import Demultiplexer, LogVectorOutput, Multiplexer
from scipy.integrate import odeint

from sdt_drake.io.arguments import finite, takes
from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError
from sdt_drake.io.shown import Shown, Summary, formatted, higher
from sdt_drake.io.tables import data_frame
from sdt_drake.pilot.head import GRAVITY
from sdt_drake.pilot.observer import (
    PerceptionModel,
    load_perception,
    orientation_observer,
    set_unfelt,
)
from sdt_drake.run.simulate import make_simulator
from sdt_drake.systems.reference import sample_source

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

CAUTION = (
    "Predicted by a model of attentive people in the dark; people differ widely, and it is no "
    "medical statement."
)
"""Caveat that accompanies every shown prediction."""

MIN_PERIOD = 0.01
"""Shortest sample period of the observer [s]; its senses have a cut-off of 2 Hz.

Where the accelerations of the reference motion jump, half of it changes felt rates by 0.7 deg/s.
"""

MAX_PERIOD = 0.1
"""Longest accepted sample period of a recording [s]; the senses follow faster motion."""

WEIGHTLESS = 0.01 * GRAVITY
"""Smallest specific force with a perceived direction [m/s²]."""

ACCURACY = 1e-4
"""Accuracy of the integrator; felt angles are good to 0.01 deg, felt rates to 0.1 deg/s."""

LONGEST_EXPLICIT = 0.03
"""Longest sample period of an explicit integrator [s]: the senses are stiff, up to 113 rad/s.

Above it, a method for stiff equations takes a quarter of the evaluations, but runs in Python.
"""


@dataclass(frozen=True, eq=False, repr=False)
class Percept(Shown):
    """Predicted perception of a pilot at N samples, in axes of the head."""

    model: PerceptionModel
    """Parameter set of the observer, with its source."""
    time: Array
    """Time of the samples [s], shape (N,)."""
    specific_force: Array
    """True specific force of the head [m/s²], shape (N, 3)."""
    angular_rate: Array
    """True angular rate of the head [rad/s], shape (N, 3)."""
    gravity: Array
    """Felt direction down [-], unit length, shape (N, 3)."""
    rate: Array
    """Felt angular rate [rad/s], shape (N, 3)."""
    acceleration: Array
    """Felt linear acceleration [m/s²], shape (N, 3)."""

    @property
    def roll(self) -> Array:
        """Felt roll [rad], positive to the right, shape (N,)."""
        return attitude(self.gravity)[0]

    @property
    def pitch(self) -> Array:
        """Felt pitch [rad], positive nose up, shape (N,)."""
        return attitude(self.gravity)[1]

    def summary(self) -> Summary:
        felt = (
            ("felt roll [deg]", np.degrees(self.roll)),
            ("felt pitch [deg]", np.degrees(self.pitch)),
            *(
                (f"felt {axis} rate [deg/s]", np.degrees(self.rate[:, k]))
                for k, axis in enumerate(("roll", "pitch", "yaw"))
            ),
        )
        rows = [
            (name, *(formatted(x, ".1f") for x in (values.min(), values.max(), values[-1])))
            for name, values in felt
        ]
        title = f"{np.ptp(self.time):g} s, {len(self.time)} samples; {self.model.source}"
        return Summary(title, ("", "smallest", "largest", "at the end"), rows)

    def plot(self) -> Figure:
        """Return a figure of the felt attitude, and of felt beside true rates."""
        return higher("show.figures.pilot:percept")("Felt orientation", self)

    def to_pandas(self) -> pd.DataFrame:
        """Return a table of gravity, rate and acceleration along x, y, z (1, 2, 3) over time.

        Raises:
            InputError: pandas is not installed.
        """
        return data_frame(self.time, self.columns)

    @property
    def columns(self) -> dict[str, Array]:
        """Felt signals by name, in the order of tables."""
        return {name: getattr(self, name) for name in ("gravity", "rate", "acceleration")}


def attitude(down: Array) -> tuple[Array, Array]:
    """Return roll and pitch [rad] of a head, from the direction down in its axes, shape (N, 3)."""
    x, y, z = down.T
    return np.arctan2(-y, -z), np.arctan2(-x, np.hypot(y, z))


@takes(time=finite("(N,)"), specific_force=finite("(N, 3)"), angular_rate=finite("(N, 3)"))
def perceive(
    time: Array,
    specific_force: Array,
    angular_rate: Array,
    model: str | PerceptionModel = "clark2019",
) -> Percept:
    """Predict the orientation that a pilot perceives during a motion of the head.

    Before the first sample, the head has long had the force and rate of that sample.

        >>> import numpy as np, sdt_drake as sdt
        >>> time = np.arange(0, 20, 0.05)
        >>> force = np.tile([0.0, 0, 9.81], (len(time), 1))
        >>> rate = np.outer(time > 1, [0, 0, np.radians(60)])  # yaw to the left
        >>> felt = sdt.perceive(time, force, rate, model="slow_yaw")
        >>> print(f"felt yaw rate after 19 s: {np.degrees(felt.rate[-1, 2]):.0f} of 60 deg/s")
        felt yaw rate after 19 s: 14 of 60 deg/s

    `felt.plot()` draws the result.

    Args:
        time: time of the samples [s], rising, shape (N,).
        specific_force: a - g [m/s²], (0, 0, +9.81) at rest; x forward, y left, z up, shape (N, 3).
        angular_rate: rate of the head in its axes [rad/s], shape (N, 3).
        model: parameter set: the name of a shipped one, a YAML file, or a PerceptionModel.

    Raises:
        InputError: shapes differ, samples are too far apart, or the head is weightless.
    """
    _check(time, specific_force, angular_rate)
    chosen = model if isinstance(model, PerceptionModel) else load_perception(model)
    count = max(round(np.ptp(time) / max(float(np.median(np.diff(time))), MIN_PERIOD)), 1)
    period = float(np.ptp(time)) / count

    builder = DiagramBuilder()
    samples = np.hstack([specific_force, angular_rate])
    source = builder.AddNamedSystem("head", sample_source(time - time[0], samples))
    split = builder.AddNamedSystem("force_and_rate", Demultiplexer([3, 3]))
    observer = orientation_observer(model=chosen)
    builder.AddNamedSystem("observer", observer)
    felt = builder.AddNamedSystem("felt", Multiplexer([3, 3, 3]))
    builder.Connect(source.get_output_port(), split.get_input_port())
    for k in range(2):
        builder.Connect(split.get_output_port(k), observer.get_input_port(k))
    for k in range(3):
        builder.Connect(observer.get_output_port(k), felt.get_input_port(k))
    builder.ExportOutput(felt.get_output_port())
    log = LogVectorOutput(felt.get_output_port(), builder, period)
    diagram = builder.Build()
    context = diagram.CreateDefaultContext()
    own = observer.GetMyMutableContextFromRoot(context)
    set_unfelt(observer, own, specific_force[0], angular_rate[0])
    at = np.linspace(0, count * period, count + 1)
    if period > LONGEST_EXPLICIT:
        still = ~np.any(np.diff(samples, axis=0), axis=1)
        turns = np.flatnonzero(np.diff(still)) + 1
        logged = _solved(diagram, context, at, (time - time[0])[turns], bool(still[0]))
    else:
        simulator = make_simulator(diagram, context=context, period=period, accuracy=ACCURACY)
        simulator.Initialize()
        simulator.AdvanceTo(at[-1] + 0.5 * period)  # half a period more logs the last one for sure
        logged = log.FindLog(context).data()[:, : count + 1].T
    at_samples = np.array([np.interp(time - time[0], at, column) for column in logged.T]).T
    return Percept(chosen, time, specific_force, angular_rate, *np.hsplit(at_samples, 3))


_SUCCESS = "Integration successful."  # of odeint
_LSODA = Lock()
"""Lock of `odeint`, which up to scipy 1.16 keeps its memory in one place for all threads."""


def _solved(
    diagram: Diagram, context: Context, times: Array, turns: Array, is_still: bool
) -> Array:
    """Return the output of a diagram at times [s], shape (N, size), by a method for stiff systems.

    The input is still and changes by turns, first `is_still`. While it changes, no step is longer
    than those between the times.
    """

    def at(time: float, state: Array) -> Context:
        context.SetTime(time)
        context.SetContinuousState(state)
        return context

    def slopes(time: float, state: Array) -> Array:
        return diagram.EvalTimeDerivatives(at(time, state)).CopyToVector()

    options = {"rtol": ACCURACY, "atol": 0.01 * ACCURACY, "tfirst": True, "full_output": True}
    states = [context.get_continuous_state_vector().CopyToVector()[np.newaxis]]
    last, longest = states[0][0], (times[1] - times[0], 0.0)
    near = 1e-6 * longest[0]  # odeint returns anything of times that differ by round-off
    for start, end in pairwise([0.0, *turns[turns < times[-1] - near], times[-1]]):
        inside = times[(times > start + near) & (times <= end + near)]
        ends = len(inside) > 0 and inside[-1] >= end - near
        points = [start, *inside[: len(inside) - ends], end]
        with _LSODA:
            found, told = odeint(slopes, last, points, hmax=longest[is_still], **options)
        if told["message"] != _SUCCESS:
            raise InputError(f"the perceived orientation was not found: {told['message']}")
        states.append(found[1 : len(inside) + 1])
        last, is_still = found[-1], not is_still
    out = diagram.get_output_port()
    rows = zip(times, np.concatenate(states), strict=True)
    return np.array([np.array(out.Eval(at(*row))) for row in rows])


def _check(time: Array, specific_force: Array, angular_rate: Array) -> None:
    """Check that the observer can run over the samples."""
    for name, array in (("specific_force", specific_force), ("angular_rate", angular_rate)):
        if array.shape != (len(time), 3):
            raise InputError(f"{name}: of shape {array.shape}, expected ({len(time)}, 3)")
    steps = np.diff(time)
    if not len(steps) or steps.min() <= 0:
        raise InputError("time: expected at least 2 samples, each later than the one before")
    too_long = steps > MAX_PERIOD * (1 + 1e-9)
    if too_long.any():
        first = too_long.argmax()
        raise InputError(
            f"time: {steps[first]:g} s between samples at {time[first]:g} s, expected at most "
            f"{MAX_PERIOD:g} s"
        )
    size = np.linalg.norm(specific_force, axis=1)
    if size.min() < WEIGHTLESS:
        raise InputError(
            f"specific_force: {size.min():.3g} m/s² at {time[size.argmin()]:g} s, expected at "
            f"least {WEIGHTLESS:.2g} m/s²: a weightless head has no perceived vertical"
        )
