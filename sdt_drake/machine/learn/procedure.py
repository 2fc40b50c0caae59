"""Learning of a reference from simulated flights, with a check of its convergence: `learn`."""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from sdt_drake.io.arguments import finite_number, instance_of, one_of, takes, whole_number
from sdt_drake.io.trust import trusting
from sdt_drake.machine.learn import filter as filters
from sdt_drake.machine.learn.loops import LEARNED, loops_of
from sdt_drake.machine.learn.trials import LearningResult
from sdt_drake.machine.learn.trials import learn as run_and_learn
from sdt_drake.run.design import Design, as_design
from sdt_drake.run.scenario import Scenario
from sdt_drake.studies.devices import devices_of
from sdt_drake.studies.study import load_study


@takes(stops=instance_of(bool), report=instance_of(Callable))
def learn(
    design: Design | Scenario,
    *,
    flights: int = 5,
    of: str = "reference",
    bandwidth: float | None = None,
    study: str | Path | None = None,
    draws: int = 20,
    stops: bool = True,
    report: Callable[[LearningResult], None] = lambda result: None,
    trust: bool = False,
) -> LearningResult:
    """Fly a motion several times and learn a reference from its errors, as `sdt-drake learn`.

    Args:
        design: a scenario or its design.
        flights: largest number of flights, the first included.
        of: the learned signal, "reference" or "torque".
        bandwidth: frequency up to which errors are learned [Hz]; by default as far as the
            controller's model is trusted.
        study: file or name of a study. Learning must converge for all devices that its variables
            give.
        draws: largest number of the study's devices to check.
        stops: whether to stop when another flight would not improve the result.
        report: function that is called after each flight with all flights so far.
        trust: whether a Python file that the study's scenario names is run without asking.

    Returns:
        All trials with their errors, the best of them, and the reason to stop.

    Raises:
        InputError: naming the wrong argument, or if learning would not converge.

    Examples:
        >>> import numpy as np
        >>> import sdt_drake as sdt
        >>> speeds = np.outer(np.sin(np.linspace(0, np.pi, 201)) ** 2, [0.1, 0.2, 0.2, 0.3])
        >>> motion = sdt.Motion.from_speeds(0.005, np.zeros(4), speeds)
        >>> scenario = sdt.load("wrong_model", {"controller.kind": "p_pi"})
        >>> result = sdt.learn(sdt.design(scenario, motion=motion), flights=2)
        >>> [float(np.rad2deg(trial.largest.max()).round(3)) for trial in result.trials]  # deg
        [0.058, 0.013]
    """
    whole_number(flights, "flights")
    design = as_design(design)
    with trusting(trust):
        filter_, checks = learning_filter(design, of, bandwidth=bandwidth, study=study, draws=draws)
    filters.refuse_divergence(checks, filter_)
    return run_and_learn(design, filter_, flights, stops=stops, report=report)


def learning_filter(
    design: Design,
    of: str,
    *,
    bandwidth: float | None = None,
    study: str | Path | None = None,
    draws: int = 20,
) -> tuple[filters.LearningFilter, list[filters.Convergence]]:
    """Design the learning filter and check its convergence on each set of loops.

    The arguments are those of `learn`.
    """
    one_of(of, "of", LEARNED)
    whole_number(draws, "draws")
    devices = {}
    if study is not None:
        drawn, base = load_study(study)
        devices[f"the devices of {drawn.name}"] = devices_of(design, drawn, base, draws)
    loops = loops_of(design, of, devices=devices)
    omega = None if bandwidth is None else 2 * np.pi * finite_number(bandwidth, "bandwidth")
    filter_ = filters.design_filter(design, loops, of, bandwidth=omega)
    return filter_, [filters.convergence(filter_, group) for group in loops]
