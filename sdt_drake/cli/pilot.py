"""Show what the pilot feels of a motion, and of the errors of its controller."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

import sdt_drake as sdt
from sdt_drake.cli import common
from sdt_drake.cli.common import print_table, say
from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError
from sdt_drake.io.tables import TABLES, write_table

if TYPE_CHECKING:
    from sdt_drake.analysis.orientation import Percept
    from sdt_drake.analysis.tracking import HeadTracking
    from sdt_drake.motion import Story
    from sdt_drake.robot.head import HeadMotion
    from sdt_drake.robot.robot import Robot

    Rows = tuple[Sequence[str], Sequence[Sequence[str]]]

EXAMPLE = "sdt-drake pilot coupled_pi --out pilot.png"


def add(parser: argparse.ArgumentParser) -> None:
    text = "what to run, or what `simulate` wrote (.csv, .mat, .parquet)"
    common.add_scenario(parser, text, "SCENARIO|RECORDING", nargs="?")
    text = "hold the model of the pilot against what people reported, and tell what it predicts"
    parser.add_argument("--validate", action="store_true", help=f"{text} of the training motions")
    text = "SDF or URDF file of a recording's robot (default: the shipped device)"
    common.add_robot(parser, text, None)
    text = "gains of the pilot's model: a name that ships, or a YAML file"
    parser.add_argument("--model", default="clark2019", help=f"{text} (default: clark2019)")
    text = "CSV file for what is felt over time, or a figure of it (.png, .svg, .pdf)"
    common.add_figure(parser, text, [".csv"])


def run(options: argparse.Namespace) -> None:
    from sdt_drake.analysis.illusions import feel, felt_apart, illusions
    from sdt_drake.analysis.orientation import CAUTION
    from sdt_drake.analysis.tracking import track_head
    from sdt_drake.show.figures import pilot as plots_pilot

    if options.validate or options.scenario is None:
        return _validate(options)
    name, recording, robot, story = _recorded(options)
    if recording.q.shape[1] != robot.n:
        raise InputError(
            f"{options.scenario}: recorded with {recording.q.shape[1]} joint(s), "
            f"but {robot.name} has {robot.n}; --robot names that of the recording"
        )
    head = track_head(recording, robot)
    period = float(recording.time[1] - recording.time[0])
    felt = [feel(motion, period, options.model) for motion in (head.reference, head.achieved)]
    say(f"{name}: what the pilot feels; x forward, y left, z up, in the head's axes")
    print_table(*_motion_rows(head, felt, period))
    say()
    say(f"Felt wrongly of what was achieved, by {options.model}:")
    for illusion in illusions(felt[1], head.achieved):
        say(f"  {illusion}")
    say(CAUTION)
    say()
    print_table(*_felt_rows(head, recording.time))
    say("multiples of what is just felt; alone: if only the joint angles were off, not the speeds")
    say(
        f"The error could be felt {100 * head.felt.share:.1f} % of the time, "
        f"by the joint angles alone {100 * head.felt_from_angles.share:.1f} %."
    )
    angle, rate = (np.degrees(x) for x in felt_apart(*felt))
    say(f"It changes the felt vertical by at most {angle:.2f} deg, felt rotation {rate:.2f} deg/s.")
    common.deliver(
        options,
        lambda: plots_pilot.pilot(f"{name}: what the pilot feels", recording.time, head, story),
        lambda path: _write(path, recording.time, period, head, felt),
    )


def _validate(options: argparse.Namespace) -> None:
    """Print what gain sets predict beside what people reported."""
    if options.scenario is not None or not options.validate:
        raise InputError("expected a scenario, a recording or --validate, one of them")
    common.refuse_options(options, "not with --validate", "out", "show", "changes")
    from sdt_drake.analysis.illusions import intended_illusions
    from sdt_drake.analysis.orientation import CAUTION
    from sdt_drake.analysis.reported import LEGEND, validate, verdict_of_all
    from sdt_drake.robot.head import check_head
    from sdt_drake.show.reports.perception import intended_table, reported_notes, reported_table

    robot = sdt.load_robot(options.robot or common.ROBOT)
    check_head(robot)
    rows = validate()
    common.say_wrapped(verdict_of_all(rows), "")
    say()
    common.print_document_table(reported_table(rows))
    common.say_wrapped(LEGEND, "")
    say()
    for note in reported_notes(rows):
        common.say_wrapped(note, "- ")
    say()
    say(
        "The illusion of each training motion, felt less true [deg] or [deg/s]; ✗ too small to feel"
    )
    common.print_document_table(intended_table(intended_illusions(robot)))
    say()
    common.say_wrapped(CAUTION, "")


def _recorded(options: argparse.Namespace) -> tuple[str, sdt.Recording, Robot, Story]:
    """Name, recording, robot and story of what was asked for."""
    from sdt_drake.motion import Story, story_of
    from sdt_drake.robot.head import check_head

    if Path(options.scenario).suffix in TABLES:
        common.refuse_changes(options)
        robot = sdt.load_robot(options.robot or common.ROBOT)
        check_head(robot)
        return Path(options.scenario).stem, sdt.Recording.load(options.scenario), robot, Story()
    why = f"for a recording only, {options.scenario} names its own robot"
    common.refuse_options(options, why, "robot")
    design = common.design_of(options, check_head)
    story = story_of(design.scenario.motion, design.robot, design.motion)
    return design.scenario.name, sdt.simulate(design), design.robot, story


def _motion_rows(head: HeadTracking, felt: Sequence[Percept], period: float) -> Rows:
    """Header and rows: largest quantities of the reference and of what was achieved."""
    from sdt_drake.analysis.perception import UNPERCEIVED_RATE, canals, false_sensation_after_stop

    def values(motion: HeadMotion, felt: Percept) -> list[str]:
        omega = motion.angular_velocity
        after = false_sensation_after_stop(omega, period)
        return [
            f"{motion.resultant_g.max():.3f}",
            f"{motion.resultant_g.min():.3f}",
            *(f"{w:.1f}" for w in np.degrees(np.abs(omega).max(axis=0))),
            *(f"{w:.1f}" for w in np.degrees(np.abs(canals(omega, period)).max(axis=0))),
            *(f"{t:.1f}".replace("nan", "–") for t in after),
            *(f"{a:.1f}" for a in np.degrees([np.abs(felt.roll).max(), np.abs(felt.pitch).max()])),
        ]

    axes = ("roll", "pitch", "yaw")
    labels = ["largest G", "smallest G", *(f"{axis} rate, largest [deg/s]" for axis in axes)]
    labels += [f"{axis} rate that the canals tell, largest [deg/s]" for axis in axes]
    after = f"told after the stop, above {UNPERCEIVED_RATE:g} deg/s, for [s]"
    labels += [f"{axis} {after}" for axis in axes]
    labels += ["felt roll from the vertical, largest [deg]", "felt pitch, largest [deg]"]
    columns = (labels, values(head.reference, felt[0]), values(head.achieved, felt[1]))
    return ("", "reference", "achieved"), list(zip(*columns, strict=True))


def _felt_rows(head: HeadTracking, time: Array) -> Rows:
    """Header and rows: the error in multiples of what is just felt, by channel."""
    from sdt_drake.analysis.perception import CHANNELS

    rows = [
        (
            channel,
            f"{head.felt.largest[k]:.2f}",
            f"{time[head.felt.multiples[:, k].argmax()]:.3f}",
            f"{100 * head.felt.channel_share[k]:.1f}",
            f"{head.felt_from_angles.largest[k]:.2f}",
            f"{100 * head.felt_from_angles.channel_share[k]:.1f}",
        )
        for k, channel in enumerate(CHANNELS)
    ]
    header = (
        "felt error", "largest", "at [s]", "above 1 [% of time]",
        "angles alone, largest", "above 1 [% of time]",
    )  # fmt: skip
    return header, rows


def _write(
    path: Path, time: Array, period: float, head: HeadTracking, felt: Sequence[Percept]
) -> None:
    """Columns name_k, k = 1, 2, 3 along x, y, z of the head; multiple_1..6 as in CHANNELS."""
    from sdt_drake.analysis.perception import canals

    columns: dict[str, Array] = {}
    motions = (head.reference, head.achieved)
    for suffix, motion, own in zip(("_ref", ""), motions, felt, strict=True):
        columns |= {
            f"specific_force{suffix}": motion.specific_force,
            f"angular_velocity{suffix}": motion.angular_velocity,
            f"angular_acceleration{suffix}": motion.angular_acceleration,
            f"canals{suffix}": canals(motion.angular_velocity, period),
        }
        columns |= {f"felt_{name}{suffix}": values for name, values in own.columns.items()}
    write_table(path, time, {**columns, "multiple": head.felt.multiples})
