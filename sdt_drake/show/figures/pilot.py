"""Figures of the pilot's head: specific force, rotation, and felt attitude."""

import textwrap
from collections.abc import Callable, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from sdt_drake.analysis.tracking import HeadTracking
from sdt_drake.io.arguments import typed
from sdt_drake.io.arrays import Array
from sdt_drake.motion import Story, TimedSegment
from sdt_drake.pilot.canals import sensed_rate
from sdt_drake.pilot.head import GRAVITY, HeadMotion
from sdt_drake.pilot.illusions import true_attitude
from sdt_drake.pilot.orientation import CAUTION, Percept, perceive
from sdt_drake.pilot.thresholds import CHANNELS
from sdt_drake.show.figures.scope import ACHIEVED
from sdt_drake.show.panels import Line, Panel, draw, picture
from sdt_drake.show.style import LOOKS, PALETTE, Look, finish, grid, plain_numbers, style

_CHANNEL_COLOURS = (*PALETTE[3:6], "#882255", "#999933", "#332288")

_COLOURS = _CHANNEL_COLOURS[3:]

_MAX_SPAN = 500  # largest over smallest value of the logarithmic axis of the error
_MIN_CHANGE = 0.05  # share of the largest change of a kind; panels with less are left out
_FORCES = ("force along x, forward", "force along y, left", "force along z, up")
_ROTATIONS = ("rotation about x, roll right", "rotation about y, nose down",
              "rotation about z, turn left")  # fmt: skip
_PANEL, _LEFT = (9.05, 1.2), 1.1  # inch
_TITLE_LINE = 110  # letters
_BAND, _LETTER = 0.2, 0.052  # height of a track's names, width of their letters [inch]


@typed
def pilot(title: str, time: Array, head: HeadTracking, story: Story | None = None) -> Figure:
    """Draw specific force, rotation and attitude of the pilot's head, and the error that is felt.

    Panels of axes with hardly any change are left out; the title names them.

    Args:
        title: title of the figure, unless the story has one.
        time: samples [s], shape (N,).
        head: motion of the pilot's head at these samples.
        story: purpose and segments of the motion; the segments are named above the panels.
    """
    story = story or Story()
    shown: list[Panel] = []
    still: list[str] = []
    for kind in zip(*(head_panels(time, head, axis) for axis in range(3)), strict=True):
        change = [max(np.ptp(line.values) for line in panel.lines[:2]) for panel in kind]
        for panel, own in zip(kind, change, strict=True):
            if own >= _MIN_CHANGE * max(change):
                shown.append(panel)
            else:
                still.append(panel.title)
    shown.append(_attitude(time, head.achieved))
    lines = [story.title or title]
    if story.feels:
        lines += textwrap.wrap(f"To be felt: {story.feels}", _TITLE_LINE)
    if still:
        lines += textwrap.wrap(f"Hardly any change: {'; '.join(still)}.", _TITLE_LINE)
    tracks = list(dict.fromkeys(segment.track for segment in story.segments))
    above = 0.45 + 0.17 * len(lines)
    with style():
        figure, axes = grid(
            len(shown) + 1, 1, panel=_PANEL, left=_LEFT,
            top=above + _BAND * len(tracks) + 0.3 * bool(tracks),
        )  # fmt: skip
        for panel, ax in zip(shown, axes[:, 0], strict=False):
            draw(ax, panel)
        _error(axes[-1, 0], time, head)
        axes[-1, 0].set_xlabel("time [s]")
        axes[-1, 0].set_xlim(time[0], time[-1])
        if tracks:
            _name_segments(figure, axes[:, 0], story.segments, tracks, above)
        return finish(figure, "\n".join(lines))


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
            Line("of the head", LOOKS["reference"], np.degrees(felt.angular_rate[:, k])),
            Line("felt", Look(PALETTE[2]), np.degrees(felt.rate[:, k])),
        )
        panels.append(Panel(name, "time [s]", "rate [deg/s]", felt.time, both))
    acceleration = [
        Line(f"felt, {axis}", Look(colour), felt.acceleration[:, k] / GRAVITY)
        for k, (axis, colour) in enumerate(zip(("forward", "left", "up"), _COLOURS, strict=True))
    ]
    panels.append(Panel("acceleration", "time [s]", "a [G]", felt.time, acceleration))
    return picture(title, [panels])


@typed
def head_panels(time: Array, head: HeadTracking, axis: int) -> tuple[Panel, Panel]:
    """Make the panels of specific force along an axis of the head, and of rotation about it.

    The first two lines of each are reference and achieved.

    Args:
        time: samples [s], shape (N,).
        head: motion of the pilot's head at these samples.
        axis: 0, 1 or 2 for x, y or z.
    """

    def both(quantity: Callable[[HeadMotion], Array]) -> list[Line]:
        return [
            Line("reference", LOOKS["reference"], quantity(head.reference)[:, axis]),
            Line("achieved", ACHIEVED, quantity(head.achieved)[:, axis]),
        ]

    force = both(lambda motion: motion.specific_force / GRAVITY)
    rate = both(lambda motion: np.degrees(motion.angular_velocity))
    sensed = sensed_rate(head.achieved.angular_velocity[:, axis], float(time[1] - time[0]))
    rate.append(Line("sensed by the canals (achieved)", Look(PALETTE[2]), np.degrees(sensed)))
    return (
        Panel(_FORCES[axis], "time [s]", "force [G]", time, force),
        Panel(_ROTATIONS[axis], "time [s]", "rate [deg/s]", time, rate),
    )


@typed
def felt_panels(time: Array, head: HeadTracking) -> list[tuple[str, str, list[Panel]]]:
    """Make the panels of each axis of the head, with the errors over the threshold.

    The names of its rotation and of its force come first.
    """
    just = Line("threshold: just felt", Look("0.2"), np.ones_like(time))
    felt, shown = head.felt.multiples, []
    for axis, (turn, push) in enumerate(zip(CHANNELS[:3], CHANNELS[3:], strict=True)):
        lines = [
            Line(f"error of {turn}", Look(PALETTE[3]), felt[:, axis]),
            Line(f"error of {push} force", Look(PALETTE[5]), felt[:, 3 + axis]),
            just,
        ]
        error = Panel("", "time [s]", "error / threshold", time, lines)
        shown.append((turn, push, [*head_panels(time, head, axis), error]))
    return shown


def _attitude(time: Array, head: HeadMotion) -> Panel:
    """Make the panel of true and felt roll and pitch, by the first parameter set of `perceive`."""
    felt = perceive(time, head.specific_force, head.angular_velocity)
    true = true_attitude(head)
    lines = []
    for k, (name, own) in enumerate((("roll right", felt.roll), ("nose up", felt.pitch))):
        colour = PALETTE[3 + k]
        lines.append(Line(f"{name}, true", Look(colour), np.degrees(true[k])))
        lines.append(Line(f"{name}, felt (predicted)", Look(colour, "--"), np.degrees(own)))
    title = "attitude from the vertical"
    return Panel(title, "time [s]", "angle [deg]", time, lines, note=CAUTION)


def _error(ax: Axes, time: Array, head: HeadTracking) -> None:
    """Draw the rotation and the force with the largest error, on a logarithmic axis."""
    felt, angles = head.felt.multiples, head.felt_from_angles.multiples.max(axis=1)
    largest = float(felt.max())
    top = max(2.0, 1.5 * largest)
    foot = min(0.1, max(largest / 20, top / _MAX_SPAN))
    ax.axhspan(foot, 1, color="0.93", linewidth=0)
    ax.axhline(1, color="0.2", linewidth=0.9, label="threshold: just felt")
    if angles.max() > foot:
        ax.plot(time, angles, ":", color="0.55", label="error if only positions were wrong")
    for channel, most in (head.felt.worst_rotation, head.felt.worst_force):
        if most >= foot:
            k = CHANNELS.index(channel)
            label = f"error, {channel}, largest of its kind"
            ax.plot(time, felt[:, k], color=_CHANNEL_COLOURS[k], label=label)
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
            band.text(at, row + 0.42, f" {text}", fontsize=7.5, va="center")
            for ax in axes:
                for at in (segment.start, segment.end):
                    ax.axvline(at, color="0.75", linewidth=0.6, zorder=0.5)
    band.set_ylim(len(tracks), 0)
    band.set_yticks(np.arange(len(tracks)) + 0.45, tracks, fontsize=7.5)
    band.tick_params(length=0, labelbottom=False)
    band.grid(visible=False)
    for spine in band.spines.values():
        spine.set_visible(False)
