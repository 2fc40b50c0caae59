"""Figures in one style; each function returns a matplotlib Figure."""

from __future__ import annotations

import io
import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, NullFormatter
from numpy.typing import NDArray

from sdt_drake.analysis.budget import ErrorBudget
from sdt_drake.analysis.comparison import Compared
from sdt_drake.analysis.frequency_response import FrequencyResponse, unwrapped_degrees
from sdt_drake.analysis.stability import StabilitySweep
from sdt_drake.analysis.study import StepResponse
from sdt_drake.analysis.tracking import constant_speed_segments
from sdt_drake.dynamics import InertiaRange, Loads
from sdt_drake.errors import InputError, replacing
from sdt_drake.motion import Motion
from sdt_drake.robot import Robot
from sdt_drake.simulate import Recording

# Okabe and Ito, "Color universal design", 2008: colours that colour-blind people can tell apart.
PALETTE = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#999999")
REFERENCE, PI, PI_CTC, PRINTED_SIGN, OTHER = PALETTE[:5]
"""What the paper draws in blue, red and green keeps these hues as far as the palette has them."""

_STYLE = {
    "font.size": 9,
    "axes.titlesize": 9,
    "axes.grid": True,
    "grid.alpha": 0.3,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "legend.frameon": False,
    "lines.linewidth": 1.1,
    "text.parse_math": False,  # names are the user's, and no TeX
    "svg.hashsalt": "sdt_drake",  # the same figure gives the same file
}

FIGURES = (".png", ".svg", ".pdf")
NUMBERS = "Comment"
"""Key of the text in a PNG that has its `numbers`, as JSON: what two pictures are compared by."""

# matplotlib's backends that write files only.
_PAPER = ("agg", "cairo", "pdf", "pgf", "ps", "svg", "template")

Line = tuple[str, str, str, NDArray[np.float64]]
"""Label, colour, line style, samples of shape (N, n)."""


@contextmanager
def style() -> Iterator[None]:
    """The look of all figures of this package."""
    with matplotlib.rc_context(_STYLE):
        yield


def save(figure: Figure, path: str | Path) -> Path:
    """Write a figure; the suffix chooses the format. A file that exists is replaced whole.

    Raises:
        InputError: for another suffix than those of FIGURES.
    """
    path = checked_figure_path(path)
    metadata = {".svg": {"Date": None}, ".png": {NUMBERS: json.dumps(numbers(figure))}}
    whole = io.BytesIO()  # on a full disk matplotlib stumbles over what it could not write
    with style():
        figure.savefig(whole, format=path.suffix[1:], dpi=130, metadata=metadata.get(path.suffix))
    with replacing(path) as partial:
        partial.write_bytes(whole.getvalue())
    return path


def numbers(figure: Figure) -> list[list[float]]:
    """What a figure shows: x and y of every line, set of points or areas, and bar, in their order.

    Of each at most 50 points, evenly among them, to 4 digits.
    """
    shown = []
    for axes in figure.axes:
        shown += [line.get_xydata() for line in axes.lines]
        for points in axes.collections:
            shown.append(
                np.vstack([points.get_offsets(), *(p.vertices for p in points.get_paths())])
            )
        for patch in axes.patches:
            shown.append(patch.get_patch_transform().transform(patch.get_path().vertices))
    return [_thinned(np.asarray(points, dtype=float)) for points in shown]


def _thinned(points: NDArray[np.float64]) -> list[float]:
    few = points[np.linspace(0, len(points) - 1, min(len(points), 50)).round().astype(int)]
    return [float(f"{value:.4g}") for value in few.ravel()]


def checked_figure_path(path: str | Path) -> Path:
    """`path` if its suffix is that of a figure.

    Raises:
        InputError: for another suffix.
    """
    path = Path(path)
    if path.suffix not in FIGURES:
        raise InputError(f"{path}: unknown kind of figure, expected {', '.join(FIGURES)}")
    return path


def check_screen(where: str) -> None:
    """Refuse to show figures where there is no screen.

    Raises:
        InputError: naming `where`.
    """
    import matplotlib.pyplot as plt

    backend = matplotlib.get_backend()  # the best there is, unless $MPLBACKEND says which
    try:
        plt.switch_backend(backend)
        screen = backend.lower() not in _PAPER
    except ImportError:
        screen = False
    if not screen:
        raise InputError(
            f"{where}: no screen to draw on (matplotlib's backend is {backend}); write the figure "
            "to a file with --out"
        )


def show(figure: Figure) -> None:
    """Open a figure in a window; returns when that is closed. See `check_screen`."""
    import matplotlib.pyplot as plt

    # Only pyplot has windows, and only figures of its own: ours takes the place of an empty one.
    canvas = plt.figure(figsize=figure.get_size_inches()).canvas
    canvas.figure = figure
    figure.set_canvas(canvas)
    plt.show(block=True)
    plt.close("all")


def figure2(motion: Motion, joint_names: Sequence[str]) -> Figure:
    """Reference trajectories: a row for each joint, with position, speed and acceleration."""
    columns = (
        ("position [deg]", np.degrees(motion.q)),
        ("speed [rad/s]", motion.v),
        ("acceleration [rad/s²]", motion.vd),
    )
    with style():
        figure, axes = _grid(motion.n, 3)
        for k, name in enumerate(joint_names):
            for ax, (label, values) in zip(axes[k], columns, strict=True):
                ax.plot(motion.time, values[:, k], color=REFERENCE)
                ax.set_ylabel(label)
            axes[k, 0].set_title(_joint_title(k, name), loc="left", fontweight="bold")
        _time_axis(axes[-1])
        _title(figure, "Reference trajectories of the joints (Figure 2)")
    return figure


def step_responses(title: str, steps: Mapping[str, StepResponse]) -> Figure:
    """Step responses of the speed loop by structure, with their metrics (Figure 4)."""
    looks = {"pi": (PI, "PI on the error"), "p_in_feedback": (REFERENCE, "P in the feedback path")}
    with style():
        figure = Figure(figsize=(6.4, 4), layout="constrained")
        ax = figure.subplots()
        ax.axhspan(0.98, 1.02, color="0.9", label="±2 %")
        for structure, step in steps.items():
            colour, name = looks[structure]
            m = step.metrics
            label = (
                f"{name}, ζ = {step.zeta:g}: rise {m.rise_time:.4f} s, "
                f"settling {m.settling_time:.4f} s, overshoot {m.overshoot_percent:.2f} %"
            )
            ax.plot(step.time, step.speed, color=colour, label=label)
        ax.set(xlim=(0, _shown(steps)), ylim=(0, None), ylabel="motor speed [rad/s]")
        ax.set_ylim(top=1.3 * ax.get_ylim()[1])  # room for the legend
        _time_axis([ax])
        ax.legend(loc="upper left", fontsize=8)
        ax.set_title(title)
    return figure


def _shown(steps: Mapping[str, StepResponse]) -> float:
    """Time by which all have settled, and some more; all there is if one does not settle [s]."""
    settled = max(step.metrics.settling_time for step in steps.values())
    recorded = max(step.time[-1] for step in steps.values())
    return float(np.nanmin([recorded, 2 * settled]))


def speeds(title: str, time, lines: Sequence[Line], joint_names: Sequence[str]) -> Figure:
    """Joint speeds, a panel for each joint (Figure 7)."""
    return _panels(title, "speed [rad/s]", time, lines, joint_names)


def speed_errors(
    title: str, time, lines: Sequence[Line], joint_names: Sequence[str], motion: Motion
) -> Figure:
    """Errors of the joint speeds, a panel for each joint (Figure 8); constant speed shaded."""
    figure = _panels(title, "speed error [rad/s]", time, lines, joint_names)
    steady = constant_speed_segments(motion)
    with style():
        for k, ax in enumerate(figure.axes):
            largest = [f"{label} {np.abs(values[:, k]).max():.3g}" for label, _, _, values in lines]
            ax.set_title(f"largest: {', '.join(largest)} rad/s", loc="right")
            low, high = ax.get_ylim()
            shade = {"color": "0.5", "alpha": 0.15, "linewidth": 0, "zorder": 0}
            ax.fill_between(
                motion.time, low, high, where=steady[:, k], label="constant speed", **shade
            )
            ax.set_ylim(low, high)
        _legend_below(figure)
    return figure


def torques(title: str, recording: Recording, loads: Loads, robot: Robot) -> Figure:
    """Motor torques against load torques and the widened limits, motor side (Figure 3)."""
    limit = np.broadcast_to(robot.motor_torque_limit, recording.tau.shape)
    upper = limit + np.maximum(loads.alleviating_torque, 0)
    lower = -limit + np.minimum(loads.alleviating_torque, 0)
    lines = [
        ("limits, widened by the alleviating torque", "0.6", "-", upper),
        ("_lower", "0.6", "-", lower),
        ("load torque", REFERENCE, "-", recording.load_torque),
        ("motor torque", PI, "-", recording.tau),
    ]
    return _panels(title, "torque [N m]", recording.time, lines, robot.joint_names)


def effective_inertia(
    title: str,
    time,
    i_eff: NDArray[np.float64],
    joint_names: Sequence[str],
    published_maximum: Sequence[float] | None = None,
) -> Figure:
    """Effective inertia along a motion, motor side [kg m²], with its largest, median and smallest.

    Args:
        title: of the figure.
        time: [s], shape (N,).
        i_eff: motor side [kg m²], shape (N, n).
        joint_names: n names.
        published_maximum: of Table 1, motor side [kg m²], drawn as well.
    """
    span = InertiaRange.of(i_eff)
    levels = [
        ("largest", PI, "--", span.maximum),
        ("median", PI_CTC, "-.", span.median),
        ("smallest", PRINTED_SIGN, "--", span.minimum),
    ]
    if published_maximum is not None:
        levels.append(
            (
                "Table 1 (the paper's motion), largest",
                PALETTE[6],
                ":",
                np.asarray(published_maximum),
            )
        )
    lines = [("effective inertia", REFERENCE, "-", i_eff)]
    # One scale for all joints, relative to the largest: who varies little looks like it.
    lowest = min(0.9, float(np.min(span.minimum / span.maximum))) - 0.05
    figure = _panels(title, "inertia [kg m²]", time, lines, joint_names)
    with style():
        for k, ax in enumerate(figure.axes):
            for label, colour, dashes, values in levels:
                ax.axhline(values[k], color=colour, linestyle=dashes, label=label, linewidth=0.9)
            ax.set_title(f"variation {span.variation_percent[k]:.2f} %", loc="right")
            top = max(values[k] for _, _, _, values in levels)
            ax.set_ylim(lowest * span.maximum[k], 1.05 * top)
        _legend_below(figure)
    return figure


def tracking_lines(runs: Mapping[str, Recording], quantity: str) -> list[Line]:
    """Lines of `quantity` ("v" or "speed_error") for runs labelled "PI", "PI + CTC", ..."""
    looks = {
        "PI": (PI, "-"),
        "PI + CTC": (PI_CTC, "-"),
        "PI + CTC, printed sign": (PRINTED_SIGN, ":"),
    }
    return [
        (name, *looks.get(name, (OTHER, "-")), getattr(run, quantity)) for name, run in runs.items()
    ]


def comparison(title: str, compared: Sequence[Compared]) -> Figure:
    """Controllers side by side: errors on a logarithmic scale, torques, and what could be felt."""
    names = compared[0].design.robot.joint_names
    has_heads = all(c.head is not None for c in compared)
    panels = (
        ("largest speed error [rad/s]", lambda c: c.tracking.max_abs_speed_error, True),
        ("RMS speed error [rad/s]", lambda c: c.tracking.rms_speed_error, True),
        (
            "speed error at constant speed [rad/s]",
            lambda c: c.tracking.constant_speed_error,
            True,
        ),
        (
            "largest position error [deg]",
            lambda c: np.degrees(c.tracking.max_abs_position_error),
            True,
        ),
        ("RMS torque, of the motor [%]", lambda c: 100 * c.motors.rms_share, False),
        ("peak torque, of the motor [%]", lambda c: 100 * c.motors.peak_share, False),
    )
    with style():
        figure, axes = _grid(3, 2, bottom=2.55 if has_heads else 0.85)
        width = 0.8 / len(compared)
        at = np.arange(len(names))
        for ax, (label, value, logarithmic) in zip(axes.flat, panels, strict=True):
            for i, (c, colour) in enumerate(zip(compared, _colours(len(compared)), strict=True)):
                shift = (i - (len(compared) - 1) / 2) * width
                ax.bar(at + shift, value(c), width, color=colour, label=c.label)
            ax.set_title(label, loc="left")
            heights = np.array([value(c) for c in compared])
            if not np.any(heights > 0):
                ax.text(0.5, 0.5, "none", transform=ax.transAxes, horizontalalignment="center")
                ax.set_yticks([])
            elif logarithmic:
                ax.set_yscale("log")
                plain_numbers(ax.yaxis)
            ax.grid(axis="x", visible=False)
            ax.set_xticks(at, [f"{k + 1} {name}" for k, name in enumerate(names)])
        if has_heads:
            _felt(figure, compared)
        _title(figure, title)
        count = len(compared)
        _legend_below(figure, columns=count if count < 8 else (count + 1) // 2)
    return figure


def _felt(figure: Figure, compared: Sequence[Compared]) -> None:
    """A panel below the others: share of time in which the pilot could feel the error."""
    left, right = (ax.get_position() for ax in figure.axes[-2:])
    inch = 1 / figure.get_figheight()
    ax = figure.add_axes((left.x0, 0.95 * inch, right.x1 - left.x0, 1.0 * inch))
    at = np.arange(len(compared))
    share = [100 * c.head.felt.share for c in compared]
    bars = ax.bar(at, share, 0.6, color=_colours(len(compared)))
    ax.bar_label(bars, [f"{value:.1f}" for value in share], fontsize=8)
    ax.set_title("error could be felt [% of time]", loc="left")
    ax.set(ylim=(0, 115), yticks=(0, 50, 100))
    ax.set_xticks(at, [c.label.replace("+", "\n+") for c in compared], fontsize=7)
    ax.grid(axis="x", visible=False)


def error_budget(title: str, budget: ErrorBudget, joint_names: Sequence[str]) -> Figure:
    """The speed error and its parts, a panel for each joint."""
    parts = [(name, values) for name, values in budget.parts.items() if values.any()]
    if np.abs(budget.remainder).max() > 1e-6:
        parts.append(("remainder", budget.remainder))
    lines = [("speed error", "0.75", "-", budget.whole)]
    lines += [
        (name, colour, "-", values)
        for (name, values), colour in zip(parts, _colours(len(parts)), strict=True)
    ]
    figure = _panels(title, "speed error [rad/s]", budget.time, lines, joint_names)
    for ax in figure.axes:
        ax.lines[0].set_linewidth(3.0)
    return figure


def bode(title: str, response: FrequencyResponse, joint_names: Sequence[str]) -> Figure:
    """Size and phase of tracking and loop gain over frequency, a line for each joint."""
    columns = (
        ("speed over its reference", response.tracking),
        ("loop, cut at the motor", response.loop_gain),
    )
    with style():
        figure, axes = _grid(2, 2, panel=2.4)
        for column, (label, values) in enumerate(columns):
            size, phase = axes[:, column]
            colours = _colours(len(joint_names))
            degrees = unwrapped_degrees(values, at_crossover=column == 1)
            for k, (name, colour) in enumerate(zip(joint_names, colours, strict=True)):
                look = {"color": colour, "linestyle": _DASHES[k % len(_DASHES)]}
                decibel = 20 * np.log10(np.abs(values[:, k]))
                size.semilogx(response.omega, decibel, label=_joint_title(k, name), **look)
                phase.semilogx(response.omega, degrees[:, k], **look)
            size.set_title(label, loc="left", fontweight="bold")
            size.set_ylabel("size [dB]")
            size.set_ylim(-60, 60 if column else 20)
            phase.set_ylabel("phase [deg]")
            phase.set_xlabel("frequency [rad/s]")
            phase.margins(x=0)
            plain_numbers(phase.xaxis)
        for level, ax in ((-3, axes[0, 0]), (0, axes[0, 1]), (-180, axes[1, 1])):
            ax.axhline(level, color="0.4", linewidth=0.8)
        _title(figure, title)
        _legend_below(figure)
    return figure


def stability(
    title: str,
    sweeps: Mapping[str, Mapping[str, StabilitySweep]],
    joint_names: Sequence[str],
) -> Figure:
    """Least damping and overshoot over omega_n / omega_r.

    `sweeps` by place of the encoder, a column each, and by loop, a line style each.
    """
    with style():
        figure, axes = _grid(2, len(sweeps), panel=2.4, bottom=1.05)  # two rows of legend
        colours = _colours(len(joint_names))
        for (damping, overshoot), (encoder, by_drive) in zip(axes.T, sweeps.items(), strict=True):
            for (drive, sweep), dashes in zip(by_drive.items(), _DASHES, strict=False):
                for k, (name, colour) in enumerate(zip(joint_names, colours, strict=True)):
                    look = {"color": colour, "linestyle": dashes}
                    label = f"{_joint_title(k, name)}, {drive}"
                    damping.plot(sweep.ratio, sweep.damping[:, k], label=label, **look)
                    overshoot.plot(sweep.ratio, sweep.overshoot_percent[:, k], **look)
            damping.set_title(f"encoder on the {encoder}", loc="left", fontweight="bold")
            damping.axhspan(-1, 0, color=PI, alpha=0.12, linewidth=0)
            damping.set(ylim=(-1, 1.02), ylabel="smallest damping ratio")
            overshoot.set(ylim=(0, 100), ylabel="overshoot of the link [%]", xlabel="ω_n / ω_r")
            for ax in (damping, overshoot):
                ax.axvline(0.5, color="0.4", linewidth=0.8)
                ax.margins(x=0)
        _title(figure, f"{title} (shaded: unstable)")
        by_joint = [
            Line2D([], [], color=colour, label=_joint_title(k, name))
            for k, (name, colour) in enumerate(zip(joint_names, colours, strict=True))
        ]
        by_loop = [
            Line2D([], [], color="0.3", linestyle=dashes, label=loop)
            for loop, dashes in zip(next(iter(sweeps.values())), _DASHES, strict=False)
        ]
        for height, handles in ((0.03, by_joint), (0.0, by_loop)):
            row = {"ncols": len(handles), "bbox_to_anchor": (0.5, height)}
            figure.legend(handles=handles, loc="lower center", **row)
    return figure


def plain_numbers(axis: Axis) -> None:
    """Powers of ten as numbers: matplotlib would write them in TeX, which is off here."""
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())


_DASHES = ("-", "--", "-.", ":")


def _colours(count: int) -> list[str]:
    return [PALETTE[i % len(PALETTE)] for i in range(count)]


def _panels(
    title: str, ylabel: str, time, lines: Sequence[Line], joint_names: Sequence[str]
) -> Figure:
    n = len(joint_names)
    with style():
        figure, axes = _grid(n, 1)
        axes = axes[:, 0]
        for k, (ax, name) in enumerate(zip(axes, joint_names, strict=True)):
            for label, colour, dashes, values in lines:
                ax.plot(time, values[:, k], dashes, color=colour, label=label)
            ax.set_ylabel(ylabel)
            ax.set_title(_joint_title(k, name), loc="left", fontweight="bold")
            ax.margins(x=0)
        _time_axis(axes[-1:])
        _title(figure, title)
        _legend_below(figure)
    return figure


def _grid(
    rows: int, columns: int, *, panel: float = 1.55, bottom: float = 0.85
) -> tuple[Figure, NDArray]:
    """A figure and its axes. The margins are fixed [inch]: computing them takes a second."""
    left, right, top, gap = 0.8, 0.15, 0.65, 0.35
    width = 10.0
    height = rows * panel + (rows - 1) * gap + top + bottom
    figure = Figure(figsize=(width, height))
    axes = figure.subplots(
        rows,
        columns,
        sharex=True,
        squeeze=False,
        gridspec_kw={
            "left": left / width,
            "right": 1 - right / width,
            "top": 1 - top / height,
            "bottom": bottom / height,
            "hspace": gap / panel,
            "wspace": 0.3,
        },
    )
    return figure, axes


def _title(figure: Figure, title: str) -> None:
    figure.suptitle(title, y=1 - 0.12 / figure.get_figheight(), verticalalignment="top")


def _legend_below(figure: Figure, columns: int | None = None) -> None:
    for legend in list(figure.legends):
        legend.remove()
    handles, labels = figure.axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="lower center", ncols=columns or len(labels))


def _joint_title(k: int, name: str) -> str:
    return f"joint {k + 1}, {name}"


def _time_axis(axes: Sequence[Axes]) -> None:
    for ax in axes:
        ax.set_xlabel("time [s]")
