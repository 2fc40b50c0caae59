"""The command `list`: what ships."""

from __future__ import annotations

import math
import re
import textwrap
from typing import TYPE_CHECKING, Annotated

import sdt_drake as sdt
from sdt_drake.cli import common
from sdt_drake.cli.common import Robot, one_of
from sdt_drake.cli.printing import echo, echo_wrapped, line_width, print_table
from sdt_drake.io.errors import InputError, within
from sdt_drake.io.files import read_text
from sdt_drake.io.resources import SHIPPED, find_file, models_dir, shipped

if TYPE_CHECKING:
    from sdt_drake.motion import Command
    from sdt_drake.robot.robot import Robot as RobotModel

_MAX_DURATION = 3600  # s; longer motions take too long to plan here
_MAX_FILE = 1_000_000  # bytes


def run(name: Annotated[str | None, one_of(*SHIPPED)] = None, /) -> None:
    """List all shipped files, scenarios first, or print one of them to start your own from.

    `list motions` tells what the training motions make a pilot feel.

    example: sdt-drake list coupled_pi_ctc

    Args:
        name: scenario, motion, study, robot, motors, drives or stops to print (default: list all)
    """
    if name is not None:
        text = read_text(find_file(name, *SHIPPED), _MAX_FILE).removesuffix("\n")
        # Editors need the whole path of the schema if the text is saved elsewhere.
        echo(re.sub(r"(?<=schema=)(?:\.\./)?schemas", f"{models_dir() / 'schemas'}", text, count=1))
        return
    count = sum(len(shipped(kind)) for kind in SHIPPED)
    echo(f"{count} files are shipped. Use their names in place of files:")
    echo("sdt-drake simulate coupled_pi; in YAML, motion: leans")
    echo("For a copy: sdt-drake list NAME > own.yaml")
    echo()
    width = max(line_width() - 20, 20)
    for kind in SHIPPED:
        echo(f"{kind}:")
        for name in shipped(kind):
            echo(f"  {name:16}  {textwrap.shorten(_about(name, kind), width, placeholder=' ...')}")
        echo()


def _about(name: str, kind: str) -> str:
    """Return the beginning of a file's first comment, or its columns."""
    text = find_file(name, kind).read_text(encoding="utf-8")
    comment = re.search(r"<!--(.*?)-->|((?:^# (?!yaml-).*\n)+)", text, re.DOTALL | re.MULTILINE)
    text = comment[1] or comment[2] if comment else f"Columns {text.partition(chr(10))[0]}"
    words = re.sub(r"^#", "", text, flags=re.MULTILINE)
    return re.split(r"[.:;(]\s|\s\(|(?<=\?)\s", " ".join(words.split()), maxsplit=1)[0]


# --- training motions ------------------------------------------------------------------------


def motions(
    motion: Annotated[str | None, one_of("motion")] = None, /, *, robot: Robot = common.ROBOT
) -> None:
    """List the training motions, or print one in full, with the illusion that is predicted.

    example: sdt-drake list motions graveyard_spiral

    Args:
        motion: shipped motion, or motion profile .yaml
    """
    model = sdt.load_robot(robot)
    if motion is None:
        _print_all(model)
    else:
        _print_one(motion, model)


def _print_all(robot: RobotModel) -> None:
    from sdt_drake.motion import command_of, load_profile, shipped_motions

    rows, sentences = [], []
    for name in shipped_motions():
        profile = load_profile(name)
        try:
            g, sentence = _largest_g(command_of(profile, robot), robot), profile.feels
        except InputError as error:
            g, sentence = "-", f"not with '{robot.name}' ({error})"
        joints = dict.fromkeys(joint for track in profile.tracks for joint in track.joints)
        rows.append((name, profile.title, f"{profile.duration:g}", ", ".join(joints), g))
        sentences.append(f"{name}: {sentence}")
    echo(f"{len(rows)} motions are shipped; for one in full: sdt-drake list motions {rows[0][0]}")
    print_table(("motion", "illusion", "duration [s]", "joints", "largest G"), rows)
    echo("largest G: at the pilot's head, if the joints follow the motion without error")
    echo()
    for sentence in sentences:
        echo_wrapped(sentence)


def _print_one(motion: str, robot: RobotModel) -> None:
    from sdt_drake.motion import load_command, load_profile
    from sdt_drake.pilot.head import has_head
    from sdt_drake.pilot.illusions import intended_illusion
    from sdt_drake.pilot.orientation import CAUTION

    profile = load_profile(motion)
    command = load_command(motion, robot)
    with within(motion):
        g = _largest_g(command, robot)
    echo(f"{profile.title or profile.name}: {profile.duration:g} s, largest G at the head {g}")
    if profile.feels or profile.description:
        echo_wrapped(f"feels: {profile.feels}" if profile.feels else profile.description)
    if profile.illusion and has_head(robot):
        found = intended_illusion(motion, robot)
        assert found is not None, "the profile names its intended illusion"
        for model in found.predicted:
            echo_wrapped(found.sentence(model))
        if found.meant.reported:
            echo_wrapped(f"people report: {found.meant.reported}")
        echo_wrapped(CAUTION)
    echo()
    print_table(
        ("segment", "from [s]", "to [s]"),
        [(f"{s.track}: {s.text}", f"{s.start:.3f}", f"{s.end:.3f}") for s in command.timeline],
    )
    turned = [
        f"{name} {math.degrees(angle):g} deg"
        for name, angle in zip(robot.joint_names, command.q0, strict=True)
        if angle != 0
    ]
    echo(f"starts at {', '.join(turned) or '0 deg'}; speeds are constant between segments")
    if profile.notes:
        echo()
        echo_wrapped(f"notes: {profile.notes}")


def _largest_g(command: Command, robot: RobotModel) -> str:
    """Return the largest resultant at the head [G] as text, "-" without a head."""
    from sdt_drake.motion import INTERPOLATION_PERIOD, commanded_motion
    from sdt_drake.pilot.head import has_head, head_motion

    if command.duration > _MAX_DURATION:
        raise InputError(f"duration: {command.duration:g} s, expected at most {_MAX_DURATION:g} s")
    if not has_head(robot):
        return "-"
    # Planners use the given period. Here it is changed a little, so that it divides the duration.
    period = command.duration / math.ceil(command.duration / INTERPOLATION_PERIOD)
    motion = commanded_motion(robot, command, period)
    return f"{head_motion(robot, motion.q, motion.v, motion.vd).resultant_g.max():.2f}"
