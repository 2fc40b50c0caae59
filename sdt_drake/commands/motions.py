"""List the training motions, or print one in full."""

from __future__ import annotations

import argparse
import textwrap

from sdt_drake.commands.common import add_robot, naming, print_table, say
from sdt_drake.errors import InputError

EXAMPLE = "sdt-drake motions graveyard_spiral"


_WIDTH = 96  # columns of running text
_LONGEST = 3600  # s; what is computed while one waits


def add(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "motion", nargs="?", metavar="NAME", help="a shipped motion, or a training profile .yaml"
    )
    add_robot(parser)


def run(options: argparse.Namespace) -> None:
    from sdt_drake.robot import load_robot

    robot = load_robot(options.robot)
    if options.motion is None:
        _print_all(robot)
    else:
        _print_one(options.motion, robot)


def _print_all(robot) -> None:
    from sdt_drake.motion import load_training, shipped_motions

    rows, sentences = [], []
    for name in shipped_motions():
        profile = load_training(name)
        try:
            g, sentence = _largest_g(profile.command(robot), robot), profile.feels
        except InputError as error:
            g, sentence = "-", f"not with '{robot.name}' ({error})"
        rows.append((name, profile.title, f"{profile.duration:g}", _joints(profile), g))
        sentences.append(f"{name}: {sentence}")
    print_table(("motion", "illusion", "duration [s]", "joints", "largest G"), rows)
    say("largest G: at the pilot's head, on the commanded motion")
    say()
    for sentence in sentences:
        _paragraph(sentence)


def _print_one(motion: str, robot) -> None:
    import numpy as np

    from sdt_drake.motion import find_motion, load_training
    from sdt_drake.resources import find_file

    profile = load_training(motion)
    file = find_file(find_motion(motion))
    command = profile.command(robot, str(file))
    with naming(str(file)):
        g = _largest_g(command, robot)
    say(f"{profile.title or profile.name}: {profile.duration:g} s, largest G at the head {g}")
    _paragraph(f"feels: {profile.feels}")
    say()
    print_table(
        ("segment", "from [s]", "to [s]"),
        [(f"{s.track}: {s.text}", f"{s.start:.3f}", f"{s.end:.3f}") for s in
         profile.timeline(robot)],
    )  # fmt: skip
    turned = [
        f"{name} {angle:g} deg"
        for name, angle in zip(robot.joint_names, np.degrees(command.start()), strict=True)
        if angle != 0
    ]
    say(f"starts at {', '.join(turned) or '0 deg'}; the speed in gaps is held")
    if profile.notes:
        say()
        _paragraph(f"notes: {profile.notes}")


def _largest_g(command, robot) -> str:
    """Largest resultant at the head, in G."""
    import numpy as np

    from sdt_drake.motion import INTERPOLATION_PERIOD
    from sdt_drake.motion.planner import commanded_motion
    from sdt_drake.pilot import has_head, head_motion

    if command.duration > _LONGEST:
        raise InputError(
            f"motion '{command.name}': duration: {command.duration:g} s, expected at most "
            f"{_LONGEST:g} s"
        )
    if not has_head(robot):
        return "-"
    # The planner may be given another period; here any about as long, that divides the duration.
    period = command.duration / np.ceil(command.duration / INTERPOLATION_PERIOD)
    motion = commanded_motion(robot, command, period, torque_margin=1.0)
    return f"{head_motion(robot, motion.q, motion.v, motion.vd).resultant_g.max():.2f}"


def _joints(profile) -> str:
    """The joints that move, each once."""
    names = (name for track in profile.tracks for name in track.joints)
    return ", ".join(dict.fromkeys(names))


def _paragraph(text: str) -> None:
    for line in textwrap.wrap(" ".join(text.split()), _WIDTH, subsequent_indent="  "):
        say(line)
