"""The figure of what the pilot feels."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from sdt_drake.analysis.illusions import true_attitude
from sdt_drake.analysis.orientation import CAUTION, Percept, perceive
from sdt_drake.analysis.perception import CHANNELS, canals
from sdt_drake.analysis.tracking import HeadTracking
from sdt_drake.io.arrays import Array
from sdt_drake.motion import Story, TimedSegment
from sdt_drake.robot.head import GRAVITY, HeadMotion
from sdt_drake.show.figures.scope import ACHIEVED
from sdt_drake.show.panels import Line, Panel, draw, picture
from sdt_drake.show.style import LOOKS, PALETTE, Look, finish, grid, plain_numbers, style

_CHANNEL_COLOURS = (*PALETTE[3:6], "#882255", "#999933", "#332288")

_COLOURS = _CHANNEL_COLOURS[3:]

_SPAN = 500  # of the logarithmic scale of the error at most [-]
_SOMETHING = 0.05  # of the largest change of its kind; less is nothing to look at
_FORCES = ("force along x, forward", "force along y, left", "force along z, up")
_ROTATIONS = ("rotation about x, roll right", "rotation about y, nose down",
              "rotation about z, turn left")  # fmt: skip
_PANEL, _LEFT = (9.05, 1.2), 1.1  # inch
_LINE = 110  # letters of the title
_BAND, _LETTER = 0.2, 0.052  # height of a track's names, width of a letter in them [inch]


def pilot(title: str, time: Array, head: HeadTracking, story: Story | None = None) -> Figure:
    """A figure of what changes of specific force and rotation of the head, and of the error that
    could be felt.

    A panel for each axis of the head along or about which something changes, one below the other.

    Args:
        title: of the figure, unless the story has one.
        time: [s], shape (N,).
        head: along the same N samples.
        story: what the motion is for, and its segments, which are named above.
    """
    story = story or Story()
    shown: list[Panel] = []
    still: list[str] = []
    for kind in zip(*(head_panels(time, head, axis) for axis in range(3)), strict=True):
        change = [max(np.ptp(line.values) for line in panel.lines[:2]) for panel in kind]
        for panel, own in zip(kind, change, strict=True):
            if own >= _SOMETHING * max(change):
                shown.append(panel)
            else:
                still.append(panel.title)
    shown.append(_attitude(time, head.achieved))
    lines = [story.title or title]
    if story.feels:
        lines += textwrap.wrap(f"To be felt: {story.feels}", _LINE)
    if still:
        lines += textwrap.wrap(f"Hardly anything changes: {'; '.join(still)}.", _LINE)
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


def percept(title: str, felt: Percept) -> Figure:
    """A figure of felt attitude, and of felt beside true rotation and specific force."""
    attitude = [
        Line("felt roll, + right", Look(PALETTE[3]), np.degrees(felt.roll)),
        Line("felt pitch, + nose up", Look(PALETTE[4]), np.degrees(felt.pitch)),
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


def head_panels(time: Array, head: HeadTracking, axis: int) -> tuple[Panel, Panel]:
    """Specific force along an axis of the head (0, 1, 2: x, y, z), and rotation about it.

    Each begins with the lines of the reference and of what was achieved.
    """

    def both(quantity: Callable[[HeadMotion], Array]) -> list[Line]:
        return [
            Line("reference", LOOKS["reference"], quantity(head.reference)[:, axis]),
            Line("achieved", ACHIEVED, quantity(head.achieved)[:, axis]),
        ]

    force = both(lambda motion: motion.specific_force / GRAVITY)
    rate = both(lambda motion: np.degrees(motion.angular_velocity))
    told = canals(head.achieved.angular_velocity[:, axis], float(time[1] - time[0]))
    rate.append(Line("what the canals tell (achieved)", Look(PALETTE[2]), np.degrees(told)))
    return (
        Panel(_FORCES[axis], "time [s]", "force [G]", time, force),
        Panel(_ROTATIONS[axis], "time [s]", "rate [deg/s]", time, rate),
    )


def _attitude(time: Array, head: HeadMotion) -> Panel:
    """True and felt roll and pitch from the vertical, by the first gain set of `perceive`."""
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
    """The rotation and the force that are nearest to being felt, on a logarithmic axis."""
    felt, angles = head.felt.multiples, head.felt_from_angles.multiples.max(axis=1)
    largest = float(felt.max())
    top = max(2.0, 1.5 * largest)
    foot = min(0.1, max(largest / 20, top / _SPAN))
    ax.axhspan(foot, 1, color="0.93", linewidth=0)
    ax.axhline(1, color="0.2", linewidth=0.9, label="just felt")
    if angles.max() > foot:
        ax.plot(time, angles, ":", color="0.55", label="error by joint angles alone, largest")
    for channel, most in (head.felt.worst_rotation, head.felt.worst_force):
        if most >= foot:
            k = CHANNELS.index(channel)
            label = f"error, {channel}, largest of its kind"
            ax.plot(time, felt[:, k], color=_CHANNEL_COLOURS[k], label=label)
    ax.set_yscale("log")
    ax.set_ylim(foot, top)
    plain_numbers(ax.yaxis)
    ax.set_title("error over what is just felt", loc="left", fontweight="bold")
    ax.set_ylabel("multiple [-]")
    ax.set_title(_felt_in_words(head), loc="right")


def _felt_in_words(head: HeadTracking) -> str:
    if head.felt.share == 0:
        return f"never felt: at most {head.felt.largest.max():.2g} of what is just felt"
    felt, angles = (100 * own.share for own in (head.felt, head.felt_from_angles))
    return f"could be felt {felt:.1f} % of the time, by the joint angles alone {angles:.1f} %"


def _name_segments(
    figure: Figure,
    axes: NDArray[np.object_],
    segments: Sequence[TimedSegment],
    tracks: Sequence[str],
    above: float,
) -> None:
    """A band for each track above the panels, and a line in them where a segment begins or ends."""
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
            # Within the segment, else behind it, else over both.
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
