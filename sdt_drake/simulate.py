"""Running a loop, and what it recorded."""

from __future__ import annotations

import threading
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig
from pydrake.systems.framework import Context, Diagram

from sdt_drake.design import Design, make_design
from sdt_drake.errors import InputError
from sdt_drake.loops import PLANT_NAME, make_loop
from sdt_drake.scenario import Scenario
from sdt_drake.systems import read_logs
from sdt_drake.tables import write_table

Array = NDArray[np.float64]

ACCURACY = 7e-6
"""Of the error-controlled integrator: speeds are good to 1e-4 rad/s, where motors saturate too."""

# What goes into a CSV file, in this order.
COLUMNS = ("v_ref", "v", "tau_cmd", "tau", "load_torque", "speed_error")


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
        tau: torque of the motors after saturation, motor side [N m].
        load_torque: tau_LD of Algorithm 1, motor side [N m].
    """

    time: Array
    q_ref: Array
    v_ref: Array
    q: Array
    v: Array
    tau_cmd: Array
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
        """Write time and, for each joint, v_ref, v, tau_cmd, tau, load_torque, speed_error."""
        write_table(path, self.time, {name: getattr(self, name) for name in COLUMNS})


def make_simulator(diagram: Diagram, *, max_step: float) -> Simulator:
    """A simulator, not initialized, that meets every sample and integrates between them."""
    simulator = Simulator(diagram)
    config = SimulatorConfig(
        integration_scheme="runge_kutta3",
        max_step_size=max_step,
        accuracy=ACCURACY,
        use_error_control=True,
    )
    ApplySimulatorConfig(config, simulator)
    return simulator


def simulate(design: Design, diagram: Diagram | None = None) -> Recording:
    """Run a loop along its motion, starting on the reference.

    Args:
        design: a resolved scenario.
        diagram: its loop with logs; built here by default.
    """
    diagram = make_loop(design) if diagram is None else diagram
    motion = design.motion
    simulator = make_simulator(diagram, max_step=motion.period)
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
    return Recording(time=time, q_ref=motion.q, v_ref=motion.v, q=q, v=v, **signals)


def _start_on_reference(design: Design, diagram: Diagram, context: Context) -> None:
    """Joints at the first sample, holds with the first sample, and speeds that persist."""

    def set_state(name: str, state: Array) -> None:
        system = diagram.GetSubsystemByName(name)
        system.GetMyMutableContextFromRoot(context).SetContinuousState(state)

    motion, gains = design.motion, design.gains
    set_state(PLANT_NAME[design.scenario.plant.kind], np.concatenate([motion.q[0], motion.v[0]]))
    if design.scenario.controller.structure == "p_in_feedback":
        # What -K_PS v takes away at the start, the integral gives.
        motor_speed = design.robot.gear_ratio * motion.v[0]
        set_state("pi_speed_controller", gains.kp / gains.ki * motor_speed)
    context.SetDiscreteState(diagram.EvalUniquePeriodicDiscreteUpdate(context))


def simulate_scenario(scenario: Scenario) -> Recording:
    """Load, plan, tune and run a scenario.

    Raises:
        InputError: for any bad input on the way.
    """
    return simulate(make_design(scenario))
