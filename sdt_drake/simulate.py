"""Running a loop, and what it recorded."""

from __future__ import annotations

import threading
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig
from pydrake.systems.framework import Diagram

from sdt_drake.design import Design, make_design
from sdt_drake.errors import InputError, checked_type
from sdt_drake.loops import loop_period, make_loop
from sdt_drake.motor_torque import period_torque
from sdt_drake.scenario import Scenario
from sdt_drake.start import start_in_equilibrium
from sdt_drake.systems import read_logs
from sdt_drake.tables import read_table, write_table

Array = NDArray[np.float64]

ACCURACY = 7e-6
"""Of the error-controlled integrator: speeds are good to 2e-6 rad/s on the reference motion, to
1e-4 where motors saturate hard, to 3e-4 where a tight envelope limits them."""

_MOST_STEPS = 1_000_000  # of the integrator in a period; a loop that needs more does not end

LIMITS = {"q": (1e6, "rad"), "q_ref": (1e6, "rad"), "v": (1e4, "rad/s"), "v_ref": (1e4, "rad/s")}
"""Of angles and speeds in files, joint side: what is beyond has another unit, or is no motion."""

SHORTEST_STEP = 1e-6
"""Of time in files [s]."""

# What goes into a CSV file, in this order.
COLUMNS = (
    "v_ref", "v", "tau_cmd", "tau", "load_torque", "speed_error", "q_ref", "q", "tau_limited",
    "tau_peak", "tau_rms", "saturated", "beyond_stop",
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class Recording:
    """What happened in a run, at the interpolation period; arrays of shape (N + 1, n).

    Continuous signals are those at `time`; torques are those just before the update at `time`, so
    at the end of the period that ends there. The first row is just after its update. What motors
    give within the periods is in `tau_peak`, `tau_rms` and `saturated`.

    Attributes:
        time: [s], shape (N + 1,).
        q_ref, v_ref: reference of the planner, joint side [rad, rad/s].
        q, v: of the plant, joint side [rad, rad/s].
        tau_cmd: torque that the controller asks for, motor side [N m].
        tau_limited: the same after saturation, motor side [N m].
        tau: torque that the motors give: the same with an ideal drive, motor side [N m].
        load_torque: tau_LD of Algorithm 1, motor side [N m].
        tau_peak, tau_rms: largest and RMS torque that the motors give in the period that ends at
            `time`, motor side [N m]; see `period_torque`.
        saturated: share of that period in which a motor gives less than is asked [-].
        beyond_stop: how far the coupled plant's joints are beyond their stops, which do not act in
            the simulation, joint side [rad]; 0 within them, and on the axis plant.
    """

    time: Array
    q_ref: Array
    v_ref: Array
    q: Array
    v: Array
    tau_cmd: Array
    tau_limited: Array
    tau: Array
    load_torque: Array
    tau_peak: Array
    tau_rms: Array
    saturated: Array
    beyond_stop: Array

    @property
    def speed_error(self) -> Array:
        """v - v_ref, joint side [rad/s]."""
        return self.v - self.v_ref

    @property
    def position_error(self) -> Array:
        """q - q_ref, joint side [rad]."""
        return self.q - self.q_ref

    def to_csv(self, path: str | Path) -> None:
        """Write time and, for each joint, COLUMNS, exactly."""
        write_table(path, self.time, {name: getattr(self, name) for name in COLUMNS})

    @staticmethod
    def from_csv(path: str | Path) -> Recording:
        """Read what `to_csv` writes; further columns are ignored.

        Raises:
            InputError: naming the file and the line or the column: something missing, gaps in
                time, numbers that are not finite, or beyond what `check_limits` lets pass.
        """
        time, columns = read_table(path)
        check_limits(path, time, columns)
        names = [field.name for field in fields(Recording) if field.name != "time"]
        missing = [name for name in names if name not in columns]
        if missing:
            raise InputError(
                f"{path}: no column {missing[0]}_1, expected a recording as `simulate` writes it: "
                f"time and, for every joint k, {', '.join(f'{name}_k' for name in names)}"
            )
        if len({columns[name].shape for name in names}) > 1:
            raise InputError(f"{path}: the columns differ in their number of joints")
        return Recording(time=time, **{name: columns[name] for name in names})


def check_limits(path: str | Path, time: Array, columns: Mapping[str, Array]) -> None:
    """Refuse angles and speeds that no joint has, and time in steps that nobody records.

    Args:
        path: of the file that holds them.
        time: in equal steps [s], shape (N,), N >= 2.
        columns: by name, shape (N, n); those that LIMITS does not name may hold anything.

    Raises:
        InputError: naming the file, the column and the time.
    """
    step = time[1] - time[0]
    if step < SHORTEST_STEP:
        raise InputError(
            f"{path}: time in steps of {step:g} s, expected at least {SHORTEST_STEP:g} s"
        )
    for name, (limit, unit) in LIMITS.items():
        beyond = np.argwhere(np.abs(columns.get(name, np.zeros((0, 0)))) > limit)
        if len(beyond):
            row, k = beyond[0]
            raise InputError(
                f"{path}: {name}_{k + 1} is {columns[name][row, k]:g} {unit} at {time[row]:g} s, "
                f"expected at most {limit:g} {unit}"
            )


def make_simulator(diagram: Diagram, *, max_step: float, accuracy: float = ACCURACY) -> Simulator:
    """A simulator, not initialized, that meets every sample and integrates between them."""
    simulator = Simulator(diagram)
    config = SimulatorConfig(
        integration_scheme="runge_kutta3",
        max_step_size=max_step,
        accuracy=accuracy,
        use_error_control=True,
    )
    ApplySimulatorConfig(config, simulator)
    integrator = simulator.get_mutable_integrator()
    integrator.set_requested_minimum_step_size(max_step / _MOST_STEPS)
    integrator.set_throw_on_minimum_step_size_violation(True)
    return simulator


def simulate(
    design: Design, diagram: Diagram | None = None, *, accuracy: float = ACCURACY
) -> Recording:
    """Run a loop along its motion, starting on the reference.

    Args:
        design: a resolved scenario.
        diagram: its loop with logs; built here by default.
        accuracy: of the integrator, in [1e-12, 0.1].

    Raises:
        InputError: for another accuracy; if the integrator makes no headway, with the time.
    """
    checked_type(design, Design, "design")
    if not (isinstance(accuracy, float) and 1e-12 <= accuracy <= 0.1):
        raise InputError(f"accuracy: {accuracy!r}, expected a number from 1e-12 to 0.1")
    diagram = make_loop(design) if diagram is None else diagram
    if diagram.get_name() != f"{design.scenario.plant.kind}_loop":
        raise InputError(
            f"diagram: {diagram.get_name()!r}, expected the {design.scenario.plant.kind}_loop of "
            "the design"
        )
    motion, period = design.motion, loop_period(design)
    simulator = make_simulator(diagram, max_step=period, accuracy=accuracy)
    context = simulator.get_mutable_context()
    start_in_equilibrium(design, diagram, context)
    try:
        simulator.Initialize()
        # Only the main thread hears Ctrl-C; in others, listening for it would take the
        # interpreter's lock at every step, and let no two runs go at the same time.
        hears = threading.current_thread() is threading.main_thread()
        simulator.AdvanceTo((len(motion.v) - 1) * period, interruptible=hears)
    except RuntimeError as error:
        reason = " ".join(str(error).split())
        raise InputError(
            f"scenario '{design.scenario.name}': the simulation is stuck at "
            f"{context.get_time():.6g} s ({reason})"
        ) from None
    _, signals = read_logs(diagram, context)
    measured = np.hsplit(signals.pop("measured", signals["state"]), 2)
    q, v = np.hsplit(signals.pop("state"), 2)
    within = period_torque(design, *measured, signals["tau_cmd"], signals["tau"])
    samples = (len(signals["tau"]) - 1) // (len(q) - 1)
    torques = {name: signals.pop(name)[::samples] for name in ("tau_cmd", "tau_limited", "tau")}
    first = np.abs(torques["tau"][:1])
    return Recording(
        time=motion.time,
        q_ref=motion.q,
        v_ref=motion.v,
        q=q,
        v=v,
        tau_peak=np.vstack([first, within.peak]),
        tau_rms=np.vstack([first, within.rms]),
        saturated=np.vstack([np.zeros_like(first), within.saturated]),
        beyond_stop=_beyond_stop(design, q),
        **torques,
        **signals,
    )


def _beyond_stop(design: Design, q: Array) -> Array:
    robot = design.robot
    if design.scenario.plant.kind == "axis":
        return np.zeros_like(q)
    return np.maximum(0.0, np.maximum(robot.position_lower - q, q - robot.position_upper))


def simulate_scenario(scenario: Scenario) -> Recording:
    """Load, plan, tune and run a scenario.

    Raises:
        InputError: for any bad input on the way.
    """
    return simulate(make_design(scenario))
