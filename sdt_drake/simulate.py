"""Running a loop, and what it recorded."""

from __future__ import annotations

import threading
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig
from pydrake.systems.framework import Context, Diagram
from pydrake.systems.primitives import ZeroOrderHold

from sdt_drake.control import CONTROLLERS
from sdt_drake.design import Design, make_design
from sdt_drake.dynamics import torque_groups
from sdt_drake.errors import InputError
from sdt_drake.loops import PI_NAME, PLANT_NAME, make_loop
from sdt_drake.scenario import Scenario
from sdt_drake.systems import read_logs
from sdt_drake.tables import read_table, write_table

Array = NDArray[np.float64]

ACCURACY = 7e-6
"""Of the error-controlled integrator: speeds are good to 1e-4 rad/s, where motors saturate too."""

LIMITS = {"q": (1e6, "rad"), "q_ref": (1e6, "rad"), "v": (1e4, "rad/s"), "v_ref": (1e4, "rad/s")}
"""Of angles and speeds in files, joint side: what is beyond has another unit, or is no motion."""

SHORTEST_STEP = 1e-6
"""Of time in files [s]."""

# What goes into a CSV file, in this order.
COLUMNS = (
    "v_ref", "v", "tau_cmd", "tau", "load_torque", "speed_error", "q_ref", "q", "tau_limited",
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class Recording:
    """What happened in a run, at the interpolation period; arrays of shape (N + 1, n).

    Continuous signals are those at `time`; torques are those just before the update at `time`, so
    at the end of the period that ends there. The first row is just after its update.

    Attributes:
        time: [s], shape (N + 1,).
        q_ref, v_ref: reference of the planner, joint side [rad, rad/s].
        q, v: of the plant, joint side [rad, rad/s].
        tau_cmd: torque that the controller asks for, motor side [N m].
        tau_limited: the same after saturation, motor side [N m].
        tau: torque that the motors give: the same with an ideal drive, motor side [N m].
        load_torque: tau_LD of Algorithm 1, motor side [N m].
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
    return simulator


def simulate(
    design: Design, diagram: Diagram | None = None, *, accuracy: float = ACCURACY
) -> Recording:
    """Run a loop along its motion, starting on the reference.

    Args:
        design: a resolved scenario.
        diagram: its loop with logs; built here by default.
        accuracy: of the integrator.

    Raises:
        InputError: if the integrator gives up.
    """
    diagram = make_loop(design) if diagram is None else diagram
    motion = design.motion
    simulator = make_simulator(diagram, max_step=motion.period, accuracy=accuracy)
    context = simulator.get_mutable_context()
    _start_on_reference(design, diagram, context)
    try:
        simulator.Initialize()
        # Only the main thread hears Ctrl-C; in others, listening for it would take the
        # interpreter's lock at every step, and let no two runs go at the same time.
        hears = threading.current_thread() is threading.main_thread()
        simulator.AdvanceTo(motion.duration, interruptible=hears)
    except RuntimeError as error:
        reason = " ".join(str(error).split())
        raise InputError(
            f"scenario '{design.scenario.name}': cannot be simulated ({reason})"
        ) from None
    time, signals = read_logs(diagram, context)
    q, v = np.hsplit(signals.pop("state"), 2)
    signals.setdefault("tau_limited", signals["tau"])
    return Recording(time=time, q_ref=motion.q, v_ref=motion.v, q=q, v=v, **signals)


def _start_on_reference(design: Design, diagram: Diagram, context: Context) -> None:
    """Joints and motors at the first sample, holds with what they sample, speeds that persist."""
    scenario, motion, gains = design.scenario, design.motion, design.gains
    n, q, v = motion.n, motion.q[0], motion.v[0]
    systems = {system.get_name(): system for system in diagram.GetSystems()}

    def context_of(name: str) -> Context:
        return systems[name].GetMyMutableContextFromRoot(context)

    context_of(PLANT_NAME[scenario.plant.kind]).SetContinuousState(np.concatenate([q, v]))
    if design.elastic is not None:
        axes = design.elastic.elastic
        wound = _spring_torque_at_start(design)[axes] / design.elastic.stiffness[axes]
        context_of("elastic_joints").SetContinuousState(np.concatenate([q[axes] + wound, v[axes]]))
    integral = f"{PI_NAME}.integral" if scenario.controller.anti_windup else PI_NAME
    if integral in systems and scenario.controller.structure_in_use == "p_in_feedback":
        # What -K_PS v takes away at the start, the integral gives.
        share = 1.0
        if CONTROLLERS[scenario.controller.kind].feedback == "scheduled":
            share = design.inertia_share[0]
        start = share * gains.kp / gains.ki * design.robot.gear_ratio * v
        own = context_of(integral)
        if own.num_discrete_state_groups() > 0:
            own.SetDiscreteState(start)
        else:
            own.SetContinuousState(start)
    for name, system in systems.items():  # in the order of the signals, but for the encoders
        if isinstance(system, ZeroOrderHold):
            _sample(system, context_of(name))
    for name in systems:
        if name.endswith(".before"):  # of an encoder, which takes the speed from differences
            position = context_of(name.replace(".before", ".now")).get_discrete_state_vector()
            period = systems[name].period()
            context_of(name).SetDiscreteState(position.value() - period * v[:n])


def _sample(hold: ZeroOrderHold, context: Context) -> None:
    context.SetDiscreteState(hold.get_input_port().Eval(context))


def _spring_torque_at_start(design: Design) -> Array:
    """What the springs carry at time 0, joint side [N m]."""
    if design.scenario.plant.kind == "axis":
        link = design.robot.gear_ratio**2 * (design.i_eff - design.robot.rotor_inertia)
        return link * design.motion.vd[0] + design.robot.gear_ratio * design.loads.load_torque[0]
    motion = design.motion
    return torque_groups(design.robot, motion.q[0], motion.v[0], motion.vd[0]).total


def simulate_scenario(scenario: Scenario) -> Recording:
    """Load, plan, tune and run a scenario.

    Raises:
        InputError: for any bad input on the way.
    """
    return simulate(make_design(scenario))
