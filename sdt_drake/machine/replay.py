"""A recorded reference through the simulated loop: how recording and simulation differ, and why."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, cast

import numpy as np
from pydrake.systems.framework import Diagram, DiagramBuilder

from sdt_drake.analysis.metrics import Metric
from sdt_drake.analysis.threads import threads
from sdt_drake.io.arrays import Array, Mask
from sdt_drake.io.errors import InputError
from sdt_drake.io.progress import with_progress
from sdt_drake.io.shown import Shown, Summary, face, of_joints
from sdt_drake.io.tables import write_table
from sdt_drake.machine.recordings import Recorded
from sdt_drake.motion import Motion
from sdt_drake.motion.trajectory import interpolated, resampled
from sdt_drake.robot.deviation import Deviation
from sdt_drake.robot.device import Drive, Elasticity, Friction
from sdt_drake.robot.robot import Robot
from sdt_drake.run.design import Design, make_design
from sdt_drake.run.loop import Loop, make_loop
from sdt_drake.run.motor_torque import envelope
from sdt_drake.run.scenario import Scenario, with_fields
from sdt_drake.run.simulate import simulate
from sdt_drake.systems import sample_source

if TYPE_CHECKING:
    from matplotlib.figure import Figure

QUANTITIES = {
    "speed_error": Metric("speed error", "rad/s"),
    "position_error": Metric("position error", "deg", float(np.degrees(1))),
    "torque": Metric("motor torque", "N m"),
}
"""What is compared: v - v_ref and q - q_ref, joint side, each from its first value on, and the
torque that the motors give, motor side."""

AS_IT_IS = "as the scenario has it"
UNFED = "without the recorded feedforward"
FED = "with the load that the model lacks"
FEEDFORWARD = "recorded feedforward alone"
ALONE = "controller alone, on the recorded motion"

ENOUGH = 0.99  # of a recording is explained: what is left has no cause worth a name
ROUND_OFF = 1e-9  # of what was recorded; of a joint that was recorded as good as still
_CLEARLY = 0.02  # of the mean square of a recording, that something else explains more
_INSIDE = 0.95  # of what a motor has: less, and it gives what is asked
_WINDOW = 0.1  # s; what is twice as fast is noise of encoders, which no model has

Signals = Mapping[str, Array]
"""Some of QUANTITIES at the samples of the motion, each of shape (N + 1, n)."""


@dataclass(frozen=True, eq=False, repr=False)
class Replay(Shown):
    """A recording beside simulations of it.

    Attributes:
        design: of the scenario, with the recorded reference.
        recorded: what was recorded.
        measured: of the recording.
        start: q - q_ref of the first sample, joint side [rad], shape (n,): left out.
        courses: of the simulations, by what was changed; WHOLE is the first.
    """

    design: Design
    recorded: Recorded
    measured: Signals
    start: Array
    courses: Mapping[str, Signals]

    def summary(self) -> Summary:
        shares = {name: self.explained(name) for name in self.measured}
        columns = {
            f"{QUANTITIES[name].title} [%]": (".1f", 100 * np.where(share < 0, np.nan, share))
            for name, share in shares.items()
        }
        title = f"of {self.recorded.path.name}, explained by {self.design.scenario.summary().title}"
        return of_joints(title, columns, self.design.robot.joint_names)

    def plot(self) -> Figure:
        """A figure of recorded and simulated errors and torques."""
        return face().plots.replay(self)

    def recorded_rms(self, quantity: str) -> Array:
        """Root of the mean square of what was recorded, shape (n,)."""
        return _rms(self.measured[quantity])

    def difference(self, quantity: str, case: str = AS_IT_IS) -> Array:
        """Root of the mean square of simulation less recording, shape (n,)."""
        return _rms(self.courses[case][quantity] - self.measured[quantity])

    def explained(self, quantity: str, case: str = AS_IT_IS) -> Array:
        """Share of the mean square of what was recorded that the simulation explains, shape (n,).

        1 - (RMS of the difference / RMS of the recording)²; below 0 where no simulation at all
        would be nearer, NaN where nothing was recorded but zeros, or round-off.
        """
        return 1 - self.apart(quantity, case) ** 2

    def better(self, quantity: str) -> dict[str, Mask]:
        """Joints of which something else explains clearly more than the scenario as it is, by what
        that is, shape (n,): of each joint the best of what is simulated, or recorded."""
        as_it_is = self.explained(quantity)
        cases = [x for x in self.courses if x not in (AS_IT_IS, FED, ALONE)]
        shares = {x: self.explained(quantity, x) for x in cases if quantity in self.courses[x]}
        if not shares:
            return {}
        most = np.max(list(shares.values()), axis=0)
        is_clear = (most > 0) & (most > np.maximum(as_it_is, 0) + _CLEARLY)
        return {
            x: found for x, share in shares.items() if (found := is_clear & (share == most)).any()
        }

    def apart(self, quantity: str, case: str = AS_IT_IS) -> Array:
        """RMS of the difference over that of the recording [-], shape (n,); NaN as `explained`."""
        recorded, off = self.recorded_rms(quantity), self.difference(quantity, case)
        is_nothing = recorded <= ROUND_OFF * np.maximum(recorded.max(), off)
        return off / np.where(is_nothing, np.nan, recorded)

    @property
    def due_to_model(self) -> Array | None:
        """Share of the difference that the model of the plant makes: what of its mean square in
        position (or speed) is gone once the plant gets the load that the model lacks. The rest is
        due to controller and drives and, where links were recorded, to springs. Shape (n,), from 0
        to 1; NaN where the simulation explains 99 % of the recording anyway, or nothing was
        recorded but zeros; None without positions, speeds or torques.
        """
        name = next((x for x in ("position_error", "speed_error") if x in self.measured), None)
        if name is None or FED not in self.courses:
            return None
        stays = (self.difference(name, FED) / np.maximum(self.difference(name), 1e-12)) ** 2
        return np.where(self.explained(name) <= ENOUGH, np.clip(1 - stays, 0, 1), np.nan)

    def to_csv(self, path: str | Path) -> None:
        """Write time and, for each joint, every quantity as recorded and as simulated (SI)."""
        columns = {f"{name}_recorded": values for name, values in self.measured.items()}
        columns |= {f"{name}_simulated": self.courses[AS_IT_IS][name] for name in self.measured}
        write_table(path, self.design.motion.time, columns)


# --- the simulations -------------------------------------------------------------------------


def replay(scenario: Scenario, recorded: Recorded, robot: Robot) -> Replay:
    """Run a scenario along the reference of a recording: as it is, and with one thing changed.

    A torque feedforward in the recording takes the place of the controller's own, if it is one of
    PI loops, which have a place for it.

    Args:
        scenario: its own motion, and what flights of it have taught, have no say.
        recorded: of the same robot.
        robot: of the scenario, from `load_device`.

    Raises:
        InputError: for a recording without a reference, or with nothing to compare; for all that
            `resampled`, `make_design` and `simulate` refuse.
    """
    signals = recorded.signals
    if not {"q_ref", "v_ref"} & set(signals):
        raise InputError(
            f"{recorded.path}: neither q_ref nor v_ref, expected a reference to replay"
        )
    if not {"q", "v", "tau"} & set(signals):
        raise InputError(f"{recorded.path}: none of q, v and tau, expected what was measured")
    period, q_ref, v_ref = scenario.period, signals.get("q_ref"), signals.get("v_ref")
    motion, _ = resampled(recorded.path, recorded.time, q_ref, v_ref, period)
    if q_ref is None and "q" in signals:  # the pose says how gravity and inertias are
        motion = replace(motion, q=motion.q + signals["q"][0])
    scenario = replace(scenario, learned="")  # what was recorded is all that was asked for
    plain = make_design(scenario, robot=robot, motion=motion)
    at = _samples(recorded, plain)
    cases = _cases(plain, at.get("tau_ff") if plain.scenario.controller.takes_feedforward else None)
    design, of_links = cases[AS_IT_IS], recorded.of_links
    with threads(2) as pool:
        ran = pool.map(lambda case: _course(case, of_links), cases.values())
        courses = dict(zip(cases, with_progress(ran, len(cases)), strict=True))
    measured, start = _measured(motion, at)
    if "torque" in measured:
        lacking = measured["torque"] - courses[AS_IT_IS]["torque"]
        if "tau_ff" in at:
            courses[FEEDFORWARD] = {"torque": at["tau_ff"]}
        courses[FED] = _course(design, of_links, _smoothed(lacking, period))
        if "q" in at:
            # An encoder's zero that is elsewhere is no error: a cascade would integrate it.
            courses[ALONE] = _alone(design, {**at, "q": at["q"] - start})
    return Replay(design, recorded, measured, start, courses)


def _samples(recorded: Recorded, design: Design) -> dict[str, Array]:
    """What was recorded, at the samples of the motion; torques on the motors' side."""
    motion, ratio = design.motion, design.robot.gear_ratio
    clock = motion.time + recorded.time[0]
    at = {name: interpolated(clock, recorded.time, x) for name, x in recorded.signals.items()}
    if "q" in at and "v" not in at:
        at["v"] = np.gradient(at["q"], motion.period, axis=0)
    return {name: x / ratio if name in ("tau", "tau_ff") else x for name, x in at.items()}


def _cases(plain: Design, tau_ff: Array | None) -> dict[str, Design]:
    """What is simulated, by what is changed: only what the scenario has."""

    def fed(design: Design) -> Design:
        return design if tau_ff is None else design.with_feedforward(tau_ff)

    cases = {AS_IT_IS: fed(plain)}
    for label, fields in _SWITCHES.items():
        scenario = with_fields(plain.scenario, fields)
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
"""What else the scenario has in some fields, by what that is called."""


def _measured(motion: Motion, at: Mapping[str, Array]) -> tuple[Signals, Array]:
    """Of the recording; and q - q_ref of the first sample, joint side [rad], shape (n,)."""
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
    """Of a simulation; extra: what loads the motors beside all else, motor side [N m]."""
    diagram: Diagram = make_loop(design)
    if extra is not None:
        builder = DiagramBuilder()
        builder.AddNamedSystem("loop", diagram)
        load = builder.AddNamedSystem("extra_load", sample_source(design.reference.time, extra))
        builder.Connect(load.get_output_port(), diagram.GetInputPort("extra_load_torque"))
        diagram = builder.Build()
    run, motion = simulate(design, diagram), design.motion
    q = run.q if of_links else cast(Array, run.q_measured)
    v = run.v if of_links else cast(Array, run.v_measured)
    q_error = q - motion.q
    return {"speed_error": v - motion.v, "position_error": q_error - q_error[0], "torque": run.tau}


def _alone(design: Design, at: Mapping[str, Array]) -> Signals:
    """Torque that the controller asks for if the joints do what was recorded, as far as the motors
    have it.

    What its integrals started with is not known: it is the constant that fits the recording best,
    where that does not tell of a motor at its limit.
    """
    widened = design.scenario.plant.kind == "axis"
    run = simulate(design, Loop(design, widened=widened, moved=(at["q"], at["v"])))
    lowest, highest = envelope(design, at["v"])
    # Widened or not.
    least, most = np.minimum(lowest, run.tau_limited), np.maximum(highest, run.tau_limited)
    inside = (at["tau"] > _INSIDE * least) & (at["tau"] < _INSIDE * most)
    lacking = np.where(inside, at["tau"] - run.tau_cmd, 0.0)
    asked = run.tau_cmd + lacking.sum(axis=0) / np.maximum(1, inside.sum(axis=0))
    return {"torque": np.clip(asked, least, most)}


def _smoothed(values: Array, period: float) -> Array:
    """Without what is faster than the loops, in phase: the mean over a Hann window of _WINDOW."""
    half = max(1, round(_WINDOW / 2 / period))
    window = np.hanning(2 * half + 1)[1:-1] if half > 1 else np.ones(1)
    padded = np.pad(values, [(half - 1, half - 1), (0, 0)], mode="edge")
    columns = [np.convolve(x, window / window.sum(), mode="valid") for x in padded.T]
    return np.stack(columns, axis=1)


def _rms(values: Array) -> Array:
    return np.sqrt(np.mean(values**2, axis=0))
