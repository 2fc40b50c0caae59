"""The paper recomputed: Table 1, step responses, tracking runs."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property
from itertools import repeat
from typing import Any, NamedTuple

import numpy as np

from sdt_drake.analysis import paper
from sdt_drake.analysis.comparison import Compared, design_with, run_of
from sdt_drake.analysis.reported import Judged, validate
from sdt_drake.analysis.step import StepMetrics, step_metrics
from sdt_drake.analysis.threads import threads
from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError, checked_number
from sdt_drake.io.progress import with_progress
from sdt_drake.run.design import Design, make_design
from sdt_drake.run.scenario import load_scenario
from sdt_drake.run.simulate import make_simulator
from sdt_drake.run.step_loop import make_step_loop
from sdt_drake.systems.gains import damping_ratio, natural_frequency, oscillation_frequency, tune

Announce = Callable[[str], None]


@dataclass(frozen=True, eq=False)
class StepResponse:
    """A simulated step of motor speed from 0 to 1 rad/s.

    Attributes:
        structure: "pi" or "p_in_feedback".
        zeta: damping ratio [-].
        time: [s], shape (N,).
        speed: [rad/s], shape (N,).
        metrics: of `speed`.
    """

    structure: str
    zeta: float
    time: Array
    speed: Array
    metrics: StepMetrics


class Case(NamedTuple):
    """What tells a tracking run of the reproduction from the others.

    Attributes:
        plant: "axis" or "coupled".
        process: inertia of an axis loop, "i_eff_max" or "i_eff_min"; "multibody" for a coupled one.
        algorithm: "printed" or "consistent".
        controller: its kind.
        disturbance_amplitude: of the load [-].
    """

    plant: str
    process: str
    algorithm: str
    controller: str
    disturbance_amplitude: float = 0.0


@dataclass(eq=False)
class Reproduction:
    """What the paper's claims are held against, computed.

    Attributes:
        design: the coupled PI + CTC run, whose inertia and gains come from the SDF.
        steps: responses of axis 1 by structure (Figure 4).
        runs: tracking runs in the order of the report.
        more_runs: of the coupled plant under more controllers than the paper has; they may go on.
        reported: what people reported of motions beside what the pilot's model predicts, likewise.
        wall_time_s: by stage [s].
    """

    design: Design
    steps: dict[str, StepResponse]
    runs: dict[Case, Compared]
    more_runs: list[Future[Compared]]
    reported: Future[list[Judged]]
    wall_time_s: dict[str, float] = field(default_factory=dict)

    def axis(
        self, controller: str, algorithm: str = "printed", process: str = "i_eff_max"
    ) -> Compared:
        """A run on decoupled axes, as the paper has it: with CTC the load is disturbed."""
        return self.runs[Case("axis", process, algorithm, controller, _AMPLITUDE[controller])]

    def coupled(self, controller: str, algorithm: str = "consistent") -> Compared:
        """A run on the coupled plant, undisturbed."""
        return self.runs[Case("coupled", "multibody", algorithm, controller)]

    @cached_property
    def beyond(self) -> list[Compared]:
        """The coupled plant under the paper's controllers and more; waits until they have run."""
        more = (future.result() for future in self.more_runs)
        return [self.coupled("pi"), self.coupled("pi_ctc"), *more]


class Stopwatch:
    """Wall time of each stage of a computation, told as it goes."""

    def __init__(self, tell: Announce) -> None:
        self.seconds: dict[str, float] = {}
        self._tell = tell

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        start = time.perf_counter()
        yield
        self.seconds[name] = self.seconds.get(name, 0.0) + time.perf_counter() - start
        self._tell(f"  {name:28s} {self.seconds[name]:6.2f} s")


def reproduce(watch: Stopwatch) -> Reproduction:
    """Compute everything that the paper's claims are held against."""
    with watch.stage("robot, motion, loads"):
        design = make_design(load_scenario("package://sdt/scenarios/coupled_pi_ctc.yaml"))
    with watch.stage("step responses"):
        i_eff_1 = design.inertia.maximum[0]
        steps = {
            structure: step_response(structure, zeta, i_eff_1, paper.OMEGA_R)
            for structure, zeta in paper.FIGURE4_ZETA.items()
        }
    # No Python runs inside these loops.
    with watch.stage("simulations"), threads(2) as pool:
        runs = pool.map(_run, repeat(design), _CASES)
        # These may run while files are written.
        more = [pool.submit(run_of, label, design_with(design, label)) for label in _BEYOND]
        reported = pool.submit(validate)
        by_case = dict(zip(_CASES, with_progress(runs, len(_CASES)), strict=True))
    return Reproduction(design, steps, by_case, more, reported, watch.seconds)


def step_response(structure: str, zeta: float, i_eff: float, omega_r: float) -> StepResponse:
    """Simulate the step of one axis until it has settled.

    Args:
        structure: "pi" or "p_in_feedback".
        zeta: damping ratio [-], 0.01 to 100.
        i_eff: inertia, motor side [kg m²].
        omega_r: lowest natural frequency of the structure [rad/s], at least 1e-6; omega_n is half
            of it.

    Raises:
        InputError: for values out of range.
    """
    if not 0.01 <= zeta <= 100:
        raise InputError(f"{zeta:g}, expected 0.01 to 100", place="zeta")
    checked_number(omega_r, "omega_r", minimum=_SLOWEST)
    gains = tune([i_eff], omega_r, [zeta])
    # The slowest pole decays like zeta omega_n (zeta < 1) or omega_n / (2 zeta).
    duration = 16.5 * max(zeta, 1 / zeta) / (0.5 * omega_r)
    loop = make_step_loop(gains=gains, i_eff=i_eff, structure=structure)
    simulator = make_simulator(loop, period=duration / 500, accuracy=_STEP_ACCURACY)
    simulator.Initialize()
    state, context = loop.GetOutputPort("state"), simulator.get_context()

    def speed_at(time: float) -> float:
        simulator.AdvanceTo(time)
        return float(np.array(state.Eval(context))[1])

    t = duration * np.linspace(0, 1, _STEP_SAMPLES) ** 2
    speed = np.array([speed_at(time) for time in t])
    return StepResponse(structure, zeta, t, speed, step_metrics(t, speed, y0=0.0, y_final=1.0))


def tuning(design: Design) -> dict[str, Array]:
    """Inertia along the motion and what the gains make of it, motor side, by name, shape (n,)."""
    inertia, gains = design.inertia, design.gains
    numbers = {
        "i_eff_max": inertia.maximum,
        "i_eff_median": inertia.median,
        "i_eff_min": inertia.minimum,
        "variation_percent": inertia.variation_percent,
        "kp": gains.kp,
        "ki": gains.ki,
    }
    for level, i_eff in zip(("max", "median", "min"), list(numbers.values())[:3], strict=True):
        numbers[f"zeta_{level}"] = damping_ratio(gains, i_eff)
        numbers[f"omega_n_{level}"] = natural_frequency(gains, i_eff)
    return numbers | {"omega_0": oscillation_frequency(gains, inertia.maximum)}


_TABLE1 = (
    "i_eff_max", "i_eff_median", "i_eff_min", "variation_percent", "kp", "ki", "zeta_max",
    "zeta_median", "zeta_min",
)  # fmt: skip


def table1_rows(design: Design) -> list[dict[str, Any]]:
    """Table 1 from the SDF and the motion; one row for each joint, with the published one."""
    found, rows = tuning(design), []
    for k in range(design.robot.n):
        computed = {name: float(found[name][k]) for name in _TABLE1}
        published = {x: paper.table1(x)[k] if x in paper.TABLE1 else None for x in _TABLE1}
        rows.append({"joint": k + 1, **computed, "published": {"joint": k + 1, **published}})
    return rows


_STEP_ACCURACY = 7e-6
_SLOWEST = 1e-6  # rad/s; in the time that slower ones take, angles grow beyond what can be resolved
_STEP_SAMPLES = 5_001  # denser at the start, for the fast one of two poles and for the first peak

_AMPLITUDE = {"pi": 0.0, "pi_ctc": 0.05}
"""Of the disturbance in the paper's models."""

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

_BEYOND = ("pi_id", "p_pi", "p_pi+ctc", "p_pi+id", "pi_scheduled", "inverse_dynamics")


def _run(base: Design, case: Case) -> Compared:
    """On decoupled axes inertia is the published one, or that less its published variation."""
    scenario = load_scenario(f"package://sdt/scenarios/{case.plant}_{case.controller}.yaml")
    scenario.algorithm = case.algorithm
    scenario.disturbance.amplitude = case.disturbance_amplitude
    if case.process == "i_eff_min":
        variation = np.array(paper.table1("variation_percent")) / 100
        scenario.plant.i_eff = (np.array(scenario.plant.i_eff) * (1 - variation)).tolist()
    return run_of(case.controller, base.variant(scenario))
