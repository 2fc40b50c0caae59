"""Simulate the loop along a recorded reference, and compare simulation and recording."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, cast

import numpy as np
from pydrake.systems.framework import DiagramBuilder
from scipy.ndimage import convolve1d

from sdt_drake.analysis.metrics import Metric
from sdt_drake.io.arguments import instance_of
from sdt_drake.io.arrays import Array, Mask
from sdt_drake.io.errors import InputError
from sdt_drake.io.progress import with_progress
from sdt_drake.io.shown import Shown, Summary, higher, of_joints
from sdt_drake.io.tables import write_table
from sdt_drake.machine.diagnose import constants as c
from sdt_drake.machine.diagnose.spikes import without_spikes
from sdt_drake.machine.recordings.columns import Columns
from sdt_drake.machine.recordings.reading import recordings_of
from sdt_drake.machine.recordings.recorded import Recorded
from sdt_drake.motion import Motion
from sdt_drake.motion.trajectory import interpolated, resampled
from sdt_drake.robot.deviation import Deviation
from sdt_drake.robot.device import Drive, Elasticity, Friction
from sdt_drake.run.design import Design, load_device, make_design
from sdt_drake.run.loop import make_loop
from sdt_drake.run.motor_torque import motor_limits
from sdt_drake.run.scenario import Scenario
from sdt_drake.run.simulate import simulate
from sdt_drake.run.threads import threads
from sdt_drake.systems import sample_source

if TYPE_CHECKING:
    from matplotlib.figure import Figure

QUANTITIES = {
    "speed_error": Metric("speed error", "rad/s"),
    "position_error": Metric("position error", "deg", float(np.degrees(1))),
    "torque": Metric("motor torque", "N m"),
}
"""Compared quantities: v - v_ref and q - q_ref, joint side, the latter less its first value, and
the motor torque, motor side."""

AS_IT_IS = "as the scenario has it"
UNFED = "without the recorded feedforward"
FED = "with the load that the model lacks"
FEEDFORWARD = "recorded feedforward alone"
ALONE = "controller alone, on the recorded motion"

_WINDOW = 0.1  # s; faster changes of a torque are noise of encoders

Signals = Mapping[str, Array]
"""Some of QUANTITIES at the samples of the motion, shape (N + 1, n) each."""


@dataclass(frozen=True, eq=False, repr=False)
class Replay(Shown):
    """A recording together with simulations of it."""

    design: Design
    """Design of the scenario, with the recorded reference."""
    recorded: Recorded
    """The recording, without spikes."""
    measured: Signals
    """Signals of the recording."""
    start: Array
    """q - q_ref of the first sample, joint side [rad], shape (n,); subtracted from all samples."""
    courses: Mapping[str, Signals]
    """Signals of the simulations by the change to the scenario; AS_IT_IS is the first."""

    def summary(self) -> Summary:
        shares = {name: self.explained(name) for name in self.measured}
        columns = {
            f"{QUANTITIES[name].title} [%]": (".1f", 100 * np.where(share < 0, np.nan, share))
            for name, share in shares.items()
        }
        title = f"of {self.recorded.path.name}, explained by {self.design.scenario.summary().title}"
        return of_joints(title, columns, self.design.device.simulated.joint_names)

    def plot(self) -> Figure:
        """Return a figure of recorded and simulated errors and torques."""
        return higher("show.figures.replay:replay_figure")(self)

    def recorded_rms(self, quantity: str) -> Array:
        """Return the RMS of a recorded quantity, shape (n,)."""
        return _rms(self.measured[quantity])

    def difference(self, quantity: str, case: str = AS_IT_IS) -> Array:
        """Return the RMS of simulation minus recording, shape (n,)."""
        return _rms(self.courses[case][quantity] - self.measured[quantity])

    def explained(self, quantity: str, case: str = AS_IT_IS) -> Array:
        """Return the share of a recording's mean square that the simulation explains, shape (n,).

        1 - (RMS of the difference / RMS of the recording)². Below 0, zeros would be nearer to the
        recording than the simulation is. NaN for a recording of zeros or round-off.
        """
        return 1 - self.apart(quantity, case) ** 2

    def better(self, quantity: str) -> dict[str, Mask]:
        """Return the cases that explain a joint best and clearly more than the scenario as it is.

        Returns:
            Mask of the joints, shape (n,), by name of the case.
        """
        as_it_is = self.explained(quantity)
        cases = [x for x in self.courses if x not in (AS_IT_IS, FED, ALONE)]
        shares = {x: self.explained(quantity, x) for x in cases if quantity in self.courses[x]}
        if not shares:
            return {}
        most = np.max(list(shares.values()), axis=0)
        is_clear = (most > 0) & (most > np.maximum(as_it_is, 0) + c.CLEAR_SHARE)
        return {
            x: found for x, share in shares.items() if (found := is_clear & (share == most)).any()
        }

    def apart(self, quantity: str, case: str = AS_IT_IS) -> Array:
        """Return the RMS of the difference over that of the recording [-], shape (n,).

        NaN for a recording of zeros or round-off.
        """
        recorded, off = self.recorded_rms(quantity), self.difference(quantity, case)
        is_nothing = recorded <= c.ROUND_OFF * np.maximum(recorded.max(), off)
        return off / np.where(is_nothing, np.nan, recorded)

    @property
    def due_to_model(self) -> Array | None:
        """Share of the difference that comes from the model of the plant, from 0 to 1, shape (n,).

        It is the part of the difference's mean square, in position or else speed, that vanishes
        when the plant is loaded with the torque that the model lacks. The rest comes from
        controller and drives and, if links were recorded, from springs. NaN if the simulation
        explains 99 % of the recording, or all values are zero. None without positions, speeds or
        torques.
        """
        name = next((x for x in ("position_error", "speed_error") if x in self.measured), None)
        if name is None or FED not in self.courses:
            return None
        stays = (self.difference(name, FED) / np.maximum(self.difference(name), 1e-12)) ** 2
        is_open = self.explained(name) <= c.EXPLAINED_SHARE
        return np.where(is_open, np.clip(1 - stays, 0, 1), np.nan)

    def to_csv(self, path: str | Path) -> None:
        """Write a CSV of time and, for each joint, every quantity recorded and simulated [SI]."""
        columns = {f"{name}_recorded": values for name, values in self.measured.items()}
        columns |= {f"{name}_simulated": self.courses[AS_IT_IS][name] for name in self.measured}
        write_table(path, self.design.reference.tracked.time, columns)


# --- the simulations -------------------------------------------------------------------------


def replay(
    recording: str | Path | Recorded,
    scenario: Scenario,
    *,
    columns: str | Path | Columns | None = None,
    side: str | None = None,
) -> Replay:
    """Simulate a recorded reference in the loop of a scenario, as `sdt-drake replay`.

    Spikes of the recording are replaced first, see `without_spikes`. A recorded torque feedforward
    replaces the controller's own if the controller has PI loops.

    Args:
        recording: a file with the reference (q_ref_k [rad] or v_ref_k [rad/s], joint side) and
            measured signals (some of q_k, v_k, joint side, and tau_k [N m]), or an object from
            `read_recording`.
        scenario: gives the robot and the loop; its motion and its learned reference are not used.
        columns, side: as in `identify`.

    Returns:
        The recording and simulations of it: one of the scenario as it is, others with one change.

    Raises:
        InputError: naming the wrong argument or recording.

    Examples:
        >>> import numpy as np
        >>> import sdt_drake as sdt
        >>> speeds = np.outer(np.sin(np.linspace(0, np.pi, 201)) ** 2, [0.1, 0.2, 0.2, 0.3])
        >>> motion = sdt.Motion.from_speeds(0.005, np.zeros(4), speeds)
        >>> design = sdt.design(sdt.load("coupled_pi_ctc"), motion=motion)
        >>> sdt.simulate(design).save("run.csv")
        >>> replayed = sdt.replay("run.csv", sdt.load("wrong_model"))
        >>> replayed.explained("speed_error").round(2)  # share of the recorded error
        array([1.  , 0.97, 1.  , 1.  ])
    """
    instance_of(Scenario, "sdt_drake.load")(scenario, "scenario")
    robot = load_device(scenario)
    [recorded] = recordings_of([recording], "recording", robot, columns, needs=(), side=side)
    recorded = without_spikes(recorded, robot)
    signals = recorded.signals
    if not {"q_ref", "v_ref"} & set(signals):
        raise InputError(
            f"{recorded.path}: neither q_ref nor v_ref, expected a reference to replay"
        )
    if not {"q", "v", "tau"} & set(signals):
        raise InputError(f"{recorded.path}: none of q, v and tau, expected a measured signal")
    period, q_ref, v_ref = scenario.period, signals.get("q_ref"), signals.get("v_ref")
    motion, _ = resampled(recorded.path, recorded.time, q_ref, v_ref, period)
    if q_ref is None and "q" in signals:  # gravity and inertias depend on the initial pose
        motion = replace(motion, q=motion.q + signals["q"][0])
    scenario = replace(scenario, learned="")  # the recorded reference contains what was learned
    plain = make_design(scenario, robot=robot, motion=motion)
    at = _samples(recorded, plain)
    cases = _cases(plain, at.get("tau_ff") if plain.scenario.controller.takes_feedforward else None)
    design, of_links = cases[AS_IT_IS], recorded.of_links
    with threads(2) as pool:
        ran = pool.map(lambda case: _course(case, of_links), cases.values())
        courses = dict(zip(cases, with_progress(ran, len(cases)), strict=True))
    measured, start = _measured(motion, at)
    if "torque" in measured:
        # No motor gives more, and the simulation of a joint that races would not end.
        most = c.MAX_LACKING * robot.motor_torque_limit
        lacking = np.clip(measured["torque"], -most, most) - courses[AS_IT_IS]["torque"]
        if "tau_ff" in at:
            courses[FEEDFORWARD] = {"torque": at["tau_ff"]}
        courses[FED] = _course(design, of_links, _smoothed(lacking, period))
        if "q" in at:
            # A cascade would integrate the offset of an encoder's zero, so it is subtracted.
            courses[ALONE] = _alone(design, {**at, "q": at["q"] - start})
    return Replay(design, recorded, measured, start, courses)


def _samples(recorded: Recorded, design: Design) -> dict[str, Array]:
    """Return the recorded signals at the samples of the motion; torques motor side."""
    motion, ratio = design.reference.tracked, design.device.simulated.gear_ratio
    clock = motion.time + recorded.time[0]
    at = {name: interpolated(clock, recorded.time, x) for name, x in recorded.signals.items()}
    if "q" in at and "v" not in at:
        at["v"] = np.gradient(at["q"], motion.period, axis=0)
    return {name: x / ratio if name in ("tau", "tau_ff") else x for name, x in at.items()}


def _cases(plain: Design, tau_ff: Array | None) -> dict[str, Design]:
    """Return the designs to simulate, by the change; only for parts that the scenario has."""

    def fed(design: Design) -> Design:
        return design if tau_ff is None else design.with_feedforward(tau_ff)

    cases = {AS_IT_IS: fed(plain)}
    for label, fields in _SWITCHES.items():
        scenario = plain.scenario.changed(fields)
        if scenario != plain.scenario:
            cases[label] = fed(plain.variant(scenario))
    if tau_ff is not None:
        cases[UNFED] = plain
    return cases


_SWITCHES: dict[str, dict[str, object]] = {
    "without friction": {"plant.friction": Friction(), "controller.friction_compensation": False},
    "with rigid joints": {"plant.elasticity": Elasticity()},
    "with ideal drives": {"drive": Drive()},
    "with the nominal links": {"plant.deviation": Deviation()},
}
"""Scenario fields that each comparison run resets, by its label."""


def _measured(motion: Motion, at: Mapping[str, Array]) -> tuple[Signals, Array]:
    """Return the compared signals of the recording, and `Replay.start`."""
    start, measured = np.zeros(motion.n), {}
    if "v" in at:
        measured["speed_error"] = at["v"] - motion.v
    if "q" in at:
        start = at["q"][0] - motion.q[0]
        measured["position_error"] = at["q"] - motion.q - start
    if "tau" in at:
        measured["torque"] = at["tau"]
    return measured, start


def _course(design: Design, of_links: bool, extra: Array | None = None) -> Signals:
    """Simulate a design, with an extra load torque if given (motor side [N m])."""
    loop, diagram = make_loop(design), None
    if extra is not None:
        builder = DiagramBuilder()
        builder.AddNamedSystem("loop", loop.diagram)
        load = builder.AddNamedSystem(
            "extra_load", sample_source(design.reference.held.time, extra)
        )
        builder.Connect(load.get_output_port(), loop.GetInputPort("extra_load_torque"))
        diagram = builder.Build()
    run, motion = simulate(loop, diagram), design.reference.tracked
    q = run.q if of_links else cast(Array, run.q_measured)
    v = run.v if of_links else cast(Array, run.v_measured)
    q_error = q - motion.q
    return {"speed_error": v - motion.v, "position_error": q_error - q_error[0], "torque": run.tau}


def _alone(design: Design, at: Mapping[str, Array]) -> Signals:
    """Return the torque that the controller commands on the recorded motion, within motor limits.

    The initial states of its integrators are unknown. They add a constant torque, which is fitted
    to the recording where no motor is at its limit.
    """
    run = simulate(design.assuming(prescribed_motion=(at["q"], at["v"])))
    lowest, highest = motor_limits(design, at["v"])
    # Limits of the motors, with or without the simulation's wider ones.
    least, most = np.minimum(lowest, run.tau_limited), np.maximum(highest, run.tau_limited)
    inside = (at["tau"] > c.UNSATURATED * least) & (at["tau"] < c.UNSATURATED * most)
    lacking = np.where(inside, at["tau"] - run.tau_cmd, 0.0)
    asked = run.tau_cmd + lacking.sum(axis=0) / np.maximum(1, inside.sum(axis=0))
    return {"torque": np.clip(asked, least, most)}


def _smoothed(values: Array, period: float) -> Array:
    """Return zero-phase filtered values: the mean over a Hann window of 0.1 s."""
    half = round(_WINDOW / 2 / period)
    window = np.hanning(2 * half + 1)[1:-1] if half > 1 else np.ones(1)
    return convolve1d(values, window / window.sum(), axis=0, mode="nearest")


def _rms(values: Array) -> Array:
    return np.sqrt(np.mean(values**2, axis=0))
