"""Figures of runs and loops; each function returns a matplotlib Figure."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from sdt_drake.analysis.budget import ErrorBudget
from sdt_drake.analysis.frequency_response import FrequencyResponse, unwrapped_degrees
from sdt_drake.analysis.loop_step import LoopStep
from sdt_drake.analysis.stability import StabilitySweep
from sdt_drake.analysis.step import StepResponse
from sdt_drake.io.arguments import typed
from sdt_drake.io.arrays import Array
from sdt_drake.io.shown import formatted
from sdt_drake.motion import Motion
from sdt_drake.robot.dynamics import InertiaRange, Loads
from sdt_drake.robot.robot import Robot
from sdt_drake.run.recording import Recording
from sdt_drake.show import style
from sdt_drake.show.figures import compared
from sdt_drake.show.figures.compared import comparison as comparison
from sdt_drake.show.figures.replay import replay_figure as replay  # noqa: F401
from sdt_drake.show.figures.scope import MOTOR_TORQUE
from sdt_drake.show.figures.scope import probes as probes
from sdt_drake.show.figures.scope import scope as scope
from sdt_drake.show.figures.scope import windings as windings
from sdt_drake.show.panels import LIMIT, Line, Panel, over_time, picture
from sdt_drake.show.style import Look

_MAX_LISTED = 4  # joints; above a panel is no room for more numbers
_MIN_ROOM = 0.005  # share of an inertia, so that round-off does not fill a panel


# --- over time -------------------------------------------------------------------------------


@typed
def trajectories(title: str, motion: Motion, joint_names: Sequence[str]) -> style.Picture:
    """Draw position, speed and acceleration of a motion, a row for each joint."""
    columns = (
        ("position [deg]", np.degrees(motion.q), joint_names),
        ("speed [rad/s]", motion.v, ()),
        ("acceleration [rad/s²]", motion.vd, ()),
    )
    look = style.LOOKS["reference"]
    panels = [
        over_time(label, motion.time, [("_reference", look, x)], names)
        for label, x, names in columns
    ]
    return picture(title, panels, width=2.5)


@typed
def step_responses(title: str, steps: Mapping[str, StepResponse]) -> style.Picture:
    """Draw step responses of the speed loop by name, with their metrics (Figure 4)."""
    names = {1.0: "PI on the error", 0.0: "I-P"}
    at = max((step.time for step in steps.values()), key=len)
    with style.style():
        figure = style.Picture(figsize=(6.4, 4), layout="constrained")
        ax = figure.subplots()
        ax.axhspan(0.98, 1.02, color="0.9", label="±2 %")
        lines = []
        for step in steps.values():
            m, b = step.metrics, step.setpoint_weight
            name = names.get(b, f"set-point weight {b:g}")
            rise, settling = (formatted(x, ".4f") for x in (m.rise_time, m.settling_time))
            label = (
                f"{name}, ζ = {step.zeta:g}: rise {rise} s, settling {settling} s, "
                f"overshoot {m.overshoot_percent:.2f} %"
            )
            colour = style.PALETTE[round(6 - 5 * b)]
            ax.plot(step.time, step.speed, color=colour, label=label)
            lines.append(Line(name, Look(colour), np.interp(at, step.time, step.speed)))
        # Twice the settling time, or all of a response that does not settle (NaN).
        end = max(np.fmin(2 * x.metrics.settling_time, x.time[-1]) for x in steps.values())
        ax.set(xlim=(0, end), ylim=(0, None), xlabel="time [s]", ylabel="motor speed [rad/s]")
        ax.set_ylim(top=1.3 * ax.get_ylim()[1])  # room for the legend
        ax.legend(loc="upper left", fontsize=8)
        ax.set_title(title)
    figure.columns = [[Panel("", "time [s]", "motor speed [rad/s]", at, lines)]]
    return figure


@typed
def loop_step(response: LoopStep) -> Figure:
    """Draw the response of a loop to a step, a row for each joint."""
    names, look, t = response.design.device.simulated.joint_names, style.nth_look(0), response.time
    degrees = np.degrees(response.position_error)
    torque, cut = [("", MOTOR_TORQUE, response.tau)], response.saturated
    panels = [
        over_time("speed [rad/s]", t, [("", look, response.v)], names),
        over_time("position error [deg]", t, [("", look, degrees)]),
        over_time(
            "torque [N m], motor side", t, torque, marked=cut, marked_label="a limit cuts it"
        ),
    ]
    return picture(f"Response {response.title}", panels, width=2.9)


@typed
def speeds(title: str, runs: Mapping[str, Recording], joint_names: Sequence[str]) -> style.Picture:
    """Draw joint speeds of runs and their reference, a panel for each joint (Figure 7)."""
    first = next(iter(runs.values()))
    lines = [("reference", style.LOOKS["reference"], first.v_ref)]
    lines += [(name, look, run.v) for name, look, run in compared.looked(runs)]
    return picture(title, [over_time("speed [rad/s]", first.time, lines, joint_names)])


@typed
def speed_errors(
    title: str, runs: Mapping[str, Recording], joint_names: Sequence[str], motion: Motion
) -> style.Picture:
    """Draw speed errors of runs, a panel for each joint (Figure 8).

    Args:
        title: title of the figure.
        runs: recordings of `motion` by the label of their controller.
        joint_names: n names.
        motion: the planned motion; intervals of constant speed have a grey ground.
    """
    return picture(title, [compared.error_panels(runs, joint_names, motion)])


@typed
def torques(title: str, recording: Recording, loads: Loads, robot: Robot) -> Figure:
    """Draw motor torques, load torques and the widened limits, motor side (Figure 3)."""
    limit = np.broadcast_to(robot.motor_torque_limit, recording.tau.shape)
    upper = limit + np.maximum(loads.alleviating_torque, 0)
    lower = -limit + np.minimum(loads.alleviating_torque, 0)
    lines = [
        ("limits, widened by the alleviating torque", LIMIT, upper),
        ("_lower", LIMIT, lower),
        ("load torque", Look(style.PALETTE[5]), recording.load_torque),
        ("motor torque", MOTOR_TORQUE, recording.tau),
    ]
    return picture(
        title, [over_time("torque [N m], motor side", recording.time, lines, robot.joint_names)]
    )


@typed
def effective_inertia(
    title: str,
    time: Array,
    i_eff: Array,
    joint_names: Sequence[str],
    published_maximum: Sequence[float] | None = None,
) -> Figure:
    """Draw the effective inertia along a motion, with its largest, median and smallest value.

    Args:
        title: title of the figure.
        time: samples [s], shape (N,).
        i_eff: effective inertia, motor side [kg m²], shape (N, n).
        joint_names: n names.
        published_maximum: largest values of Table 1, motor side [kg m²], shape (n,).
    """
    span = InertiaRange.of(i_eff)
    levels = [
        ("largest", Look(style.PALETTE[1], "--"), span.maximum),
        ("median", Look(style.PALETTE[2], "-."), span.median),
        ("smallest", Look(style.PALETTE[3], "--"), span.minimum),
    ]
    if published_maximum is not None:
        label = "Table 1 (the paper's motion), largest"
        levels.append((label, Look(style.PALETTE[6], ":"), np.asarray(published_maximum)))
    lines = [("effective inertia", Look(style.PALETTE[0]), i_eff)]
    lines += [(label, look, np.broadcast_to(x, i_eff.shape)) for label, look, x in levels]
    notes = [f"variation {percent:.2f} %" for percent in span.variation_percent]
    figure = picture(title, [over_time("inertia [kg m²]", time, lines, joint_names, notes=notes)])
    highest = np.max([values for _, _, values in levels], axis=0)
    for ax, low, high in zip(figure.axes, span.minimum, highest, strict=True):
        room = max(0.1 * (high - low), _MIN_ROOM * high)
        ax.set_ylim(low - room, high + room)
    return figure


@typed
def error_budget(title: str, budget: ErrorBudget, joint_names: Sequence[str]) -> Figure:
    """Draw the speed error and its parts, a panel for each joint."""
    parts = {name: values for name, values in budget.parts.items() if values.any()}
    if np.abs(budget.remainder).max() > 1e-6:
        parts["remainder"] = budget.remainder
    lines = [("speed error", Look("0.75"), budget.whole)]
    lines += [
        (name, Look(style.nth_look(i).colour), values)
        for i, (name, values) in enumerate(parts.items())
    ]
    figure = picture(title, [over_time("speed error [rad/s]", budget.time, lines, joint_names)])
    for ax in figure.axes:
        ax.lines[0].set_linewidth(3.0)
    return figure


# --- loops -----------------------------------------------------------------------------------


@typed
def bode(title: str, response: FrequencyResponse, joint_names: Sequence[str]) -> Figure:
    """Draw magnitude and phase of tracking and loop gain over frequency, a line for each joint.

    Markers show the bandwidth, where tracking has fallen by 3 dB, and the last crossing of 0 dB.
    Vertical lines show phase margins (of a loop that crosses 0 dB once) and gain margins.
    """
    columns = (
        ("speed over its reference", response.tracking, response.bandwidth, -3, 20),
        (f"loop, cut at {response.cut}", response.loop_gain, response.crossover, 0, 60),
    )
    joints = [style.joint_title(k, name) for k, name in enumerate(joint_names)]
    with style.style():
        figure, axes = style.grid(2, 2, panel=(3.95, 2.4), gaps=(1.15, 0.35))
        for (magnitude, phase), column in zip(axes.T, columns, strict=True):
            label, values, marked, level, top = column
            decibel = 20 * np.log10(np.abs(values))
            degrees = unwrapped_degrees(values, at_crossover=level == 0)
            for k, joint in enumerate(joints):
                look = style.nth_look(k)
                own = {"color": look.colour, "linestyle": look.dashes, "label": joint}
                magnitude.semilogx(response.omega, decibel[:, k], **own)
                phase.semilogx(response.omega, degrees[:, k], **own)
                magnitude.plot(marked[k], level, look.marker, color=look.colour, markersize=4)
            magnitude.axhline(level, color="0.4", linewidth=0.8)
            magnitude.set_title(label, loc="left", fontweight="bold")
            magnitude.set(ylim=(-60, top), ylabel="magnitude [dB]")
            phase.set(xlabel="frequency [rad/s]", ylabel="phase [deg]")
            phase.yaxis.set_major_locator(MaxNLocator(8, steps=[1, 1.5, 3, 4.5, 9, 10]))
            phase.margins(x=0)
            style.plain_numbers(phase.xaxis)
        _mark_margins(axes[:, 1], response, degrees)
        rise = response.gain_margins_db[0]
        quantities = {
            "bandwidth [rad/s]": response.bandwidth,
            "gain margin [dB]": np.where(np.isnan(rise) & response.stable, np.inf, rise),
            "phase margin [deg]": response.phase_margin,
        }
        for ax, (name, of_joints) in zip((*axes[0], axes[1, 1]), quantities.items(), strict=True):
            ax.set_title(_of_joints(name, of_joints), loc="right")
        return style.finish(figure, title)


def _mark_margins(axes: NDArray[np.object_], response: FrequencyResponse, degrees: Array) -> None:
    """Mark the margins in the axes of the loop gain, whose phase is `degrees`."""
    magnitude, phase = axes
    for k, crossover in enumerate(response.crossover):
        look, margin = style.nth_look(k), response.gain_margin[k]
        thin: dict[str, Any] = {"color": look.colour, "linewidth": 0.8}
        at = np.interp(np.log(crossover), np.log(response.omega), degrees[:, k])
        phase.plot(crossover, at, look.marker, color=look.colour, markersize=4)
        phase.vlines(crossover, -180, at, **thin)
        if np.isfinite(margin):
            i = np.abs(1 + margin * response.loop_gain[:, k]).argmin()
            magnitude.vlines(response.omega[i], -20 * np.log10(margin), 0, **thin)
    phase.axhline(-180, color="0.4", linewidth=0.8)


def _of_joints(quantity: str, values: Array) -> str:
    """Return a quantity with its number for each joint; of many joints, the range."""
    name, unit = quantity.rstrip("]").split(" [")
    if np.isinf(values).all():
        return f"{name} of every joint unlimited"
    if len(values) > _MAX_LISTED:
        ends = (formatted(end.reduce(values), ".0f") for end in (np.fmin, np.fmax))
        shown = " to ".join(dict.fromkeys(ends))
    else:
        shown = ", ".join(formatted(value, ".0f") for value in values)
    return f"{name} {shown} {unit}"


@typed
def stability(
    title: str, sweeps: Mapping[str, Mapping[str, StabilitySweep]], joint_names: Sequence[str]
) -> Figure:
    """Draw the smallest damping ratio and the overshoot over omega_n / omega_r.

    Args:
        title: title of the figure.
        sweeps: sweeps by place of the encoder (a column each) and by drive (a line style each).
        joint_names: n names.
    """
    with style.style():
        figure, axes = style.grid(2, len(sweeps), panel=(3.95, 2.4), gaps=(1.15, 0.35))
        for (damping, overshoot), (encoder, by_drive) in zip(axes.T, sweeps.items(), strict=True):
            for i, (drive, sweep) in enumerate(by_drive.items()):
                for k, name in enumerate(joint_names):
                    look = {
                        "color": style.nth_look(k).colour,
                        "linestyle": style.nth_look(i).dashes,
                    }
                    label = f"{style.joint_title(k, name)}, {drive}"
                    damping.plot(sweep.ratio, sweep.damping[:, k], label=label, **look)
                    overshoot.plot(sweep.ratio, sweep.overshoot_percent[:, k], **look)
            if all(np.isnan(sweep.overshoot_percent).all() for sweep in by_drive.values()):
                overshoot.text(0.5, 0.5, "unstable", transform=overshoot.transAxes, ha="center")
            damping.set_title(f"encoder on the {encoder}", loc="left", fontweight="bold")
            damping.axhspan(-1, 0, color=style.PALETTE[1], alpha=0.12, linewidth=0)
            damping.set(ylim=(-1, 1.02), ylabel="smallest damping ratio")
            overshoot.set(ylim=(0, 100), ylabel="overshoot of the link [%]", xlabel="ω_n / ω_r")
            for ax in (damping, overshoot):
                rule = ax.axvline(0.5, color="0.4", linestyle=":", label="ω_n = 0.5 ω_r")
                ax.margins(x=0)
        by_joint = [
            Line2D([], [], color=style.nth_look(k).colour, label=style.joint_title(k, name))
            for k, name in enumerate(joint_names)
        ]
        by_loop = [
            Line2D([], [], color="0.3", linestyle=style.nth_look(i).dashes, label=loop)
            for i, loop in enumerate(next(iter(sweeps.values())))
        ]
        return style.finish(figure, f"{title} (shaded: unstable)", [*by_joint, *by_loop, rule])
