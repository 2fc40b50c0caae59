"""Reproduction of the paper: Table 1, step responses, tracking runs."""

import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property
from itertools import repeat
from typing import Any, NamedTuple

import numpy as np

from sdt_drake.analysis.comparison import Compared, design_with, run_of
from sdt_drake.analysis.step import StepResponse, step_metrics
from sdt_drake.io.arguments import finite_number
from sdt_drake.io.errors import InputError
from sdt_drake.io.progress import with_progress
from sdt_drake.paper.published import FIGURE4_ZETA, OMEGA_R, TABLE1, table1
from sdt_drake.paper.step_loop import make_step_loop
from sdt_drake.pilot.reported import Judged, validate
from sdt_drake.run.design import Design, make_design
from sdt_drake.run.scenario import load_scenario
from sdt_drake.run.simulate import make_simulator
from sdt_drake.run.threads import threads
from sdt_drake.systems.gains import STRUCTURES, tune

Announce = Callable[[str], None]
"""A function that shows one line of progress."""


class Case(NamedTuple):
    """The identifying settings of a tracking run of the reproduction."""

    plant: str
    """Kind of plant, "axis" or "coupled"."""
    process: str
    """Inertia of an axis loop, "i_eff_max" or "i_eff_min"; "multibody" for a coupled plant."""
    algorithm: str
    """Sign of Algorithm 1, "printed" or "consistent"."""
    controller: str
    """Kind of controller."""
    disturbance_amplitude: float = 0.0
    """Amplitude of the disturbance, as a share of the load [-]."""


@dataclass(eq=False)
class Reproduction:
    """The computed results behind the verdicts on the paper's claims."""

    design: Design
    """Design of the coupled PI + CTC run; its inertia and gains follow from the SDF."""
    steps: dict[str, StepResponse]
    """Step responses of axis 1 by structure (Figure 4)."""
    runs: dict[Case, Compared]
    """Tracking runs in the order of the report."""
    more_runs: list[Future[Compared]]
    """Runs of the coupled plant with controllers that are not in the paper; possibly unfinished."""
    reported: Future[list[Judged]]
    """Reported perceptions beside predictions of the pilot's model; possibly unfinished."""
    wall_time_s: dict[str, float] = field(default_factory=dict)
    """Wall time by stage [s]."""

    def axis(
        self, controller: str, algorithm: str = "printed", process: str = "i_eff_max"
    ) -> Compared:
        """Return a run on decoupled axes; with CTC it has the paper's disturbance."""
        return self.runs[Case("axis", process, algorithm, controller, _AMPLITUDE[controller])]

    def coupled(self, controller: str, algorithm: str = "consistent") -> Compared:
        """Return a run on the coupled plant without disturbance."""
        return self.runs[Case("coupled", "multibody", algorithm, controller)]

    @cached_property
    def beyond(self) -> list[Compared]:
        """Runs of the coupled plant with all controllers; waits until they are finished."""
        more = (future.result() for future in self.more_runs)
        return [self.coupled("pi"), self.coupled("pi_ctc"), *more]


class Stopwatch:
    """A clock for the stages of a computation, with a line of progress after each."""

    def __init__(self, announce: Announce) -> None:
        self.seconds: dict[str, float] = {}
        self._announce = announce

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Add the wall time of the block to the stage `name` and announce it."""
        start = time.perf_counter()
        yield
        self.seconds[name] = self.seconds.get(name, 0.0) + time.perf_counter() - start
        self._announce(f"  {name:28s} {self.seconds[name]:6.2f} s")


def reproduce(watch: Stopwatch) -> Reproduction:
    """Compute all results that the verdicts on the paper's claims depend on."""
    with watch.stage("robot, motion, loads"):
        design = make_design(load_scenario("package://sdt/scenarios/coupled_pi_ctc.yaml"))
    with watch.stage("step responses"):
        i_eff_1 = design.inertia.maximum[0]
        steps = {
            structure: step_response(STRUCTURES[structure], zeta, i_eff_1, OMEGA_R)
            for structure, zeta in FIGURE4_ZETA.items()
        }
    # No Python runs inside the loops, but in the perception models: they begin beside the loops.
    with watch.stage("simulations"), threads(2) as pool:
        reported = pool.submit(validate)
        runs = pool.map(_run, repeat(design), _CASES)
        # Files may be written before these runs are finished.
        more = [pool.submit(run_of, label, design_with(design, label)) for label in _NOT_IN_PAPER]
        by_case = dict(zip(_CASES, with_progress(runs, len(_CASES)), strict=True))
    return Reproduction(design, steps, by_case, more, reported, watch.seconds)


def step_response(
    setpoint_weight: float, zeta: float, i_eff: float, omega_r: float
) -> StepResponse:
    """Simulate the step response of one axis until it has settled.

        >>> response = step_response(1.0, zeta=1.0, i_eff=4.26, omega_r=65.991)  # Figure 4
        >>> metrics = response.metrics
        >>> print(f"{metrics.rise_time:.3f} s, {metrics.overshoot_percent:.2f} %")
        0.022 s, 13.53 %

    Args:
        setpoint_weight: weight of the reference in the proportional part [-], from 0 (I-P) to 1
            (PI on the error).
        zeta: damping ratio [-], 0.01 to 100.
        i_eff: inertia, motor side [kg m²].
        omega_r: lowest natural frequency of the structure [rad/s], at least 1e-6; omega_n is half
            of it.

    Raises:
        InputError: a value is out of range.
    """
    if not 0.01 <= zeta <= 100:
        raise InputError(f"{zeta:g}, expected 0.01 to 100", place="zeta")
    finite_number(omega_r, "omega_r", minimum=_MIN_OMEGA_R)
    gains = tune([i_eff], omega_r, [zeta])
    # The slowest pole decays like zeta omega_n (zeta < 1) or omega_n / (2 zeta).
    duration = 16.5 * max(zeta, 1 / zeta) / (0.5 * omega_r)
    loop = make_step_loop(gains=gains, i_eff=i_eff, setpoint_weight=setpoint_weight)
    simulator = make_simulator(loop, period=duration / 500, accuracy=_STEP_ACCURACY)
    simulator.Initialize()
    state, context = loop.GetOutputPort("state"), simulator.get_context()

    def speed_at(time: float) -> float:
        simulator.AdvanceTo(time)
        return float(np.array(state.Eval(context))[1])

    t = duration * np.linspace(0, 1, _STEP_SAMPLES) ** 2
    speed = np.array([speed_at(time) for time in t])
    return StepResponse(
        setpoint_weight, zeta, t, speed, step_metrics(t, speed, y0=0.0, y_final=1.0)
    )


_TABLE1 = (
    "i_eff_max", "i_eff_median", "i_eff_min", "variation_percent", "kp", "ki", "zeta_max",
    "zeta_median", "zeta_min",
)  # fmt: skip


def table1_rows(design: Design) -> list[dict[str, Any]]:
    """Return Table 1 from the SDF and the motion: a row for each joint, with the published one."""
    found, rows = design.tuning.numbers, []
    for k in range(design.device.simulated.n):
        computed = {name: float(found[name][k]) for name in _TABLE1}
        published = {x: table1(x)[k] if x in TABLE1 else None for x in _TABLE1}
        rows.append({"joint": k + 1, **computed, "published": {"joint": k + 1, **published}})
    return rows


_STEP_ACCURACY = 7e-6
"""Accuracy of the integrator for step responses."""

_MIN_OMEGA_R = 1e-6
"""Smallest omega_r [rad/s]; slower responses reach angles beyond double precision."""

_STEP_SAMPLES = 5_001
"""Samples of a step response; they are denser at the start, for the faster pole and the peak."""

_AMPLITUDE = {"pi": 0.0, "pi_ctc": 0.05}
"""Amplitude of the disturbance in the paper's models by kind of controller [-]."""

_CASES = [
    Case("axis", process, algorithm, controller, amplitude)
    for algorithm in ("printed", "consistent")
    for process in ("i_eff_max", "i_eff_min")
    for controller, amplitude in _AMPLITUDE.items()
] + [
    Case("coupled", "multibody", "consistent", "pi"),
    Case("coupled", "multibody", "consistent", "pi_ctc"),
    Case("coupled", "multibody", "printed", "pi_ctc"),
    Case("coupled", "multibody", "consistent", "pi", 0.05),
    Case("coupled", "multibody", "consistent", "pi_ctc", 0.05),
]

_NOT_IN_PAPER = ("pi_id", "p_pi", "p_pi+ctc", "p_pi+id", "pi_scheduled", "inverse_dynamics")
"""Labels of controllers that the paper does not have."""


def _run(base: Design, case: Case) -> Compared:
    """Run a case.

    On decoupled axes the inertia is the published I_eff,max, or that less its published variation.
    """
    scenario = load_scenario(
        f"package://sdt/scenarios/{case.plant}_{case.controller}.yaml",
        {"algorithm": case.algorithm, "disturbance.amplitude": case.disturbance_amplitude},
    )
    if case.process == "i_eff_min":
        variation = np.array(table1("variation_percent")) / 100
        i_eff = np.array(scenario.plant.i_eff) * (1 - variation)
        scenario = scenario.changed({"plant.i_eff": i_eff})
    return run_of(case.controller, base.variant(scenario))
