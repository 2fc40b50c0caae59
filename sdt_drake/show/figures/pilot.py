"""Figures of the pilot's head: specific force, rotation, and felt attitude."""

import textwrap
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from sdt_drake.analysis.tracking import HeadTracking, motions_of
from sdt_drake.io.arguments import typed
from sdt_drake.io.arrays import Array
from sdt_drake.motion import Story, TimedSegment
from sdt_drake.pilot.head import GRAVITY, HeadMotion
from sdt_drake.pilot.illusions import LEVELS, illusions, quantities, unit_of
from sdt_drake.pilot.orientation import CAUTION, Percept, perceive
from sdt_drake.pilot.thresholds import CHANNELS
from sdt_drake.show.figures.scope import ACHIEVED
from sdt_drake.show.panels import Line, Panel, draw, label_lines, picture
from sdt_drake.show.style import LOOKS, PALETTE, Look, finish, grid, plain_numbers, style

_CHANNEL_COLOURS = (*PALETTE[3:6], "#882255", "#999933", "#332288")

_COLOURS = _CHANNEL_COLOURS[3:]
FELT, TRUE = Look(PALETTE[2]), LOOKS["reference"]
"""The looks of felt and of true values."""

_MAX_SPAN = 500  # largest over smallest value of the logarithmic axis of the error
_MIN_FORCE = 0.05  # panels with less change are left out [G]; others below their LEVELS
_FORCES = ("force along x, forward", "force along y, left", "force along z, up")
_ROTATIONS = ("rotation about x, roll right", "rotation about y, nose down",
              "rotation about z, turn left")  # fmt: skip
_POSITIVE = dict(zip(LEVELS, ("right", "nose up", "right", "nose down", "left"), strict=True))
_PANEL, _LEFT, _RIGHT = (7.75, 1.2), 1.1, 1.5  # inch
_TITLE_LINE = 110  # letters
_BAND, _LETTER = 0.2, 0.049  # height of a track's names, width of their letters [inch]


@typed
def pilot(
    title: str,
    time: Array,
    head: HeadTracking | HeadMotion,
    story: Story | None = None,
    felt: Percept | None = None,
) -> Figure:
    """Draw felt against true motion of the pilot's head, its specific force, and the felt error.

    The illusion comes first: that of the story, or else the largest predicted one. Panels with
    hardly any change are left out; the title names them.

    Args:
        title: title of the figure, unless the story has one.
        time: samples [s], shape (N,).
        head: motion of the pilot's head at these samples; of a run, or only planned.
        story: purpose, illusion and segments of the motion; the segments are named above.
        felt: percept of this motion; None for that by the first parameter set of `perceive`.
    """
    story = story or Story()
    run = head if isinstance(head, HeadTracking) else None
    *_, motion = motions_of(head).values()
    felt = felt or perceive(time, motion.specific_force, motion.angular_velocity)
    panels = [(panel, LEVELS[name]) for name, panel in felt_true(felt, motion, story).items()]
    panels += [(_force(time, head, axis), _MIN_FORCE) for axis in range(3)]
    shown, still = [panels[0][0]], list[Panel]()
    for panel, least in panels[1:]:
        change = max(np.ptp(line.values) for line in panel.lines)
        (shown if change >= least else still).append(panel)
    lines = [story.title or title]
    if story.feels:
        lines += textwrap.wrap(f"To be felt: {story.feels}", _TITLE_LINE)
    if still:
        names = "; ".join(panel.title for panel in still)
        lines += textwrap.wrap(f"Hardly any change: {names}.", _TITLE_LINE)
    tracks = list(dict.fromkeys(segment.track for segment in story.segments))
    above = 0.45 + 0.17 * len(lines)
    with style():
        figure, axes = grid(
            len(shown) + bool(run), 1, panel=_PANEL, left=_LEFT, right=_RIGHT,
            top=above + _BAND * len(tracks) + 0.3 * bool(tracks),
        )  # fmt: skip
        for panel, ax in zip(shown, axes[:, 0], strict=False):
            draw(ax, panel)
        if run:
            _error(axes[-1, 0], time, run)
        for ax in axes[:, 0]:
            label_lines(ax)
        figure.align_ylabels(axes[:, 0])
        axes[-1, 0].set_xlabel("time [s]")
        axes[-1, 0].set_xlim(time[0], time[-1])
        if tracks:
            _name_segments(figure, axes[:, 0], story.segments, tracks, above)
        figure.text(0.01, 0.12 / figure.get_figheight(), CAUTION, color="0.4", fontsize=8)
        return finish(figure, "\n".join(lines), [])


@typed
def felt_true(felt: Percept, head: HeadMotion, story: Story) -> dict[str, Panel]:
    """Make a panel of each felt quantity against its true value, by name.

    The illusion comes first, with its window on grey ground: that of the story, or else the largest
    predicted one.
    """
    found = max(illusions(felt, head), key=lambda one: abs(one.error) / LEVELS[one.quantity],
                default=None)  # fmt: skip
    window = story.illusion or found
    meaning = "should be felt" if story.illusion else "is predicted"
    panels: dict[str, Panel] = {}
    for name, (own, true) in quantities(felt, head).items():
        lines = [Line("felt (predicted)", FELT, own), Line("true", TRUE, true)]
        panel = Panel(
            f"{name}, + {_POSITIVE[name]}", "time [s]",
            f"{'rate' if name.endswith('rate') else 'angle'} [{unit_of(name)}]", felt.time, lines,
        )  # fmt: skip
        if window and name == window.quantity:
            marked = (felt.time >= window.start) & (felt.time <= window.end)
            label = f"on grey ground the illusion {meaning}"
            panel = replace(
                panel, title=f"the illusion: {panel.title}", marked=marked, marked_label=label,
                note=label,
            )  # fmt: skip
            panels = {name: panel, **panels}
        panels[name] = panel
    return panels


@typed
def percept(title: str, felt: Percept) -> Figure:
    """Draw felt attitude, felt and true rotation, and felt acceleration."""
    attitude = [
        Line("felt roll, + right", Look(PALETTE[3], "--"), np.degrees(felt.roll)),
        Line("felt pitch, + nose up", Look(PALETTE[4], "--"), np.degrees(felt.pitch)),
    ]
    panels = [Panel("attitude", "time [s]", "angle [deg]", felt.time, attitude, note=CAUTION)]
    for k, name in enumerate(_ROTATIONS):
        both = (
            Line("of the head", TRUE, np.degrees(felt.angular_rate[:, k])),
            Line("felt", FELT, np.degrees(felt.rate[:, k])),
        )
        panels.append(Panel(name, "time [s]", "rate [deg/s]", felt.time, both))
    acceleration = [
        Line(f"felt, {axis}", Look(colour), felt.acceleration[:, k] / GRAVITY)
        for k, (axis, colour) in enumerate(zip(("forward", "left", "up"), _COLOURS, strict=True))
    ]
    panels.append(Panel("acceleration", "time [s]", "a [G]", felt.time, acceleration))
    return picture(title, [panels])


@typed
def felt_panels(
    time: Array, head: HeadTracking, felt: Percept | None
) -> list[tuple[str, str, list[Panel]]]:
    """Make the panels of each axis of the head, with the errors over the threshold.

    The names of its rotation and of its force come first. Without a percept the felt rate is left
    out.
    """
    just = Line("threshold: just felt", Look("0.2"), np.ones_like(time))
    multiples, shown = head.felt.multiples, []
    for axis, (turn, push) in enumerate(zip(CHANNELS[:3], CHANNELS[3:], strict=True)):
        lines = [
            Line(f"error of {turn}", Look(PALETTE[3]), multiples[:, axis]),
            Line(f"error of {push} force", Look(PALETTE[5]), multiples[:, 3 + axis]),
            just,
        ]
        error = Panel("", "time [s]", "error / threshold", time, lines)
        rates = [
            Line("reference", LOOKS["reference"], head.reference.angular_velocity[:, axis]),
            Line("achieved", ACHIEVED, head.achieved.angular_velocity[:, axis]),
            *([Line("felt (predicted)", FELT, felt.rate[:, axis])] if felt else []),
        ]
        rates = [replace(line, values=np.degrees(line.values)) for line in rates]
        rotation = Panel(_ROTATIONS[axis], "time [s]", "rate [deg/s]", time, rates)
        shown.append((turn, push, [_force(time, head, axis), rotation, error]))
    return shown


def _force(time: Array, head: HeadTracking | HeadMotion, axis: int) -> Panel:
    """Make the panel of specific force along an axis of the head: 0, 1 or 2 for x, y or z."""
    lines = [
        Line(name, look, motion.specific_force[:, axis] / GRAVITY)
        for (name, motion), look in zip(motions_of(head).items(), (TRUE, ACHIEVED), strict=False)
    ]
    return Panel(_FORCES[axis], "time [s]", "force [G]", time, lines)


def _error(ax: Axes, time: Array, head: HeadTracking) -> None:
    """Draw the rotation and the force with the largest error, on a logarithmic axis."""
    felt, angles = head.felt.multiples, head.felt_from_angles.multiples.max(axis=1)
    largest = float(felt.max())
    top = max(2.0, 1.5 * largest)
    foot = min(0.1, max(largest / 20, top / _MAX_SPAN))
    ax.axhspan(foot, 1, color="0.93", linewidth=0)
    ax.axhline(1, color="0.2", linewidth=0.9, label="threshold: just felt")
    if angles.max() > foot:
        ax.plot(time, angles, ":", color="0.55", label="if only positions wrong")
    for channel, most in (head.felt.worst_rotation, head.felt.worst_force):
        if most >= foot:
            k = CHANNELS.index(channel)
            ax.plot(time, felt[:, k], color=_CHANNEL_COLOURS[k], label=f"error, {channel}")
    ax.set_yscale("log")
    ax.set_ylim(foot, top)
    plain_numbers(ax.yaxis)
    ax.set_title("error over the threshold", loc="left", fontweight="bold")
    ax.set_ylabel("multiple [-]")
    ax.set_title(_felt_in_words(head), loc="right")


def _felt_in_words(head: HeadTracking) -> str:
    if head.felt.share == 0:
        return f"never felt: at most {head.felt.largest.max():.2g} times the threshold"
    felt, angles = (100 * own.share for own in (head.felt, head.felt_from_angles))
    return f"can be felt {felt:.1f} % of the time, if only positions were wrong {angles:.1f} %"


def _name_segments(
    figure: Figure,
    axes: NDArray[np.object_],
    segments: Sequence[TimedSegment],
    tracks: Sequence[str],
    above: float,
) -> None:
    """Add a band of names for each track above the panels, and lines where segments begin or end.

    A name is within its segment, else behind it, else over both.
    """
    inch, box = 1 / figure.get_figheight(), axes[0].get_position()
    height = _BAND * len(tracks) * inch
    band = figure.add_axes((box.x0, 1 - above * inch - height, box.width, height), sharex=axes[0])
    low, high = axes[0].get_xlim()
    for row, track in enumerate(tracks):
        own = [segment for segment in segments if segment.track == track]
        ends = [segment.start for segment in own[1:]] + [high]
        for segment, end in zip(own, ends, strict=True):
            length = segment.end - segment.start
            band.broken_barh([(segment.start, length)], (row, 0.9), color="0.88", edgecolor="0.6")
            name = segment.text.partition(",")[0]
            places = [(segment.start, segment.end), (segment.end, end), (segment.start, end)]
            rooms = [(a, int((b - a) / (high - low) * _PANEL[0] / _LETTER) - 1) for a, b in places]
            at, fitting = max(rooms, key=lambda room: min(room[1], len(name)))
            text = name if len(name) <= fitting else name[: max(fitting - 1, 0)] + "…"
            band.text(at, row + 0.42, f" {text}", fontsize=7, va="center")
            for ax in axes:
                for at in (segment.start, segment.end):
                    ax.axvline(at, color="0.75", linewidth=0.6, zorder=0.5)
    band.set_ylim(len(tracks), 0)
    band.set_yticks(np.arange(len(tracks)) + 0.45, tracks, fontsize=7.5)
    band.tick_params(length=0, labelbottom=False)
    band.grid(visible=False)
    for spine in band.spines.values():
        spine.set_visible(False)
