"""The command `pilot`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import sdt_drake as sdt
from sdt_drake.cli import common
from sdt_drake.cli.printing import echo, echo_wrapped, print_document_table, print_table
from sdt_drake.io.errors import InputError
from sdt_drake.io.formats import TABLES

if TYPE_CHECKING:
    from sdt_drake.analysis.tracking import HeadTracking
    from sdt_drake.io.arrays import Array
    from sdt_drake.motion import Story
    from sdt_drake.pilot.head import HeadMotion
    from sdt_drake.pilot.orientation import Percept

    Rows = tuple[Sequence[str], Sequence[Sequence[str]]]


Gains = Annotated[
    str,
    common.one_of(
        "perception model",
        name="--model",
        help="parameter set of the perception model: shipped name or YAML file",
    ),
]


def run(
    what: Annotated[str, common.one_of("scenario", "motion", name="SCENARIO|MOTION|RECORDING")],
    /,
    *,
    robot: common.OtherRobot = None,
    gains: Gains = "clark2019",
    out: common.Out = None,
    show: common.Show = False,
    given: common.Given = common.Given(),
) -> None:
    """Predict the pilot's perception of a motion, and of the controller's errors.

    `pilot people` tells how many pilots feel an illusion, `pilot validate` how good the models are.

    example: sdt-drake pilot leans --out leans.png

    Args:
        what: scenario to run, motion to plan, or a recording that `simulate` wrote (.csv, .mat,
            .parquet)
        out: CSV file for the perception over time, or file for a figure of it (.png, .svg, .pdf)
    """
    import numpy as np

    from sdt_drake.analysis.tracking import HeadTracking, motions_of
    from sdt_drake.pilot.illusions import feel, felt_apart, illusions, intended
    from sdt_drake.pilot.observer import load_perception
    from sdt_drake.pilot.orientation import CAUTION

    common.check_out(out, show, [".csv"])
    perception = load_perception(gains)
    name, time, head, story = _moved(what, robot, given.changes)
    period = float(time[1] - time[0])
    motions = motions_of(head)
    felt = {label: feel(motion, period, perception) for label, motion in motions.items()}
    if isinstance(head, HeadTracking):
        echo(
            f"{name}: the pilot could feel the controller's error {100 * head.felt.share:.1f} % of "
            f"the time ({100 * head.felt_from_angles.share:.1f} % if only positions were wrong)"
        )
        angle, rate = (np.degrees(x) for x in felt_apart(*felt.values()))
        echo(
            f"The error changes the felt vertical by up to {angle:.2f} deg and the felt rotation "
            f"by up to {rate:.2f} deg/s."
        )
    label, motion = list(motions.items())[-1]
    if story.illusion:
        meant = intended(name, story.illusion, motion, {gains: felt[label]})
        echo(f"Intended illusion: {meant.sentence(gains)}")
    found = [str(illusion) for illusion in illusions(felt[label], motion)]
    echo(f"Illusions predicted for the {label} motion by {gains}:")
    for text in found or ["none"]:
        echo(f"  {text}")
    echo(CAUTION)
    echo()
    print_table(*_motion_rows(motions, felt, period))
    echo("axes of the head: x forward, y left, z up")
    if isinstance(head, HeadTracking):
        echo()
        print_table(*_felt_rows(head, time))
        echo("multiples of the threshold of feeling")
    title = f"{name}: what the pilot feels"
    common.deliver(
        out,
        show,
        lambda: sdt.plots_pilot.pilot(title, time, head, story, felt[label]),
        lambda path: _write(path, time, period, head, felt),
    )


def validate(*, robot: common.OtherRobot = None) -> None:
    """Compare the perception models with published reports of people.

    Their predictions for the training motions are printed, too.

    example: sdt-drake pilot validate
    """
    from sdt_drake.pilot import reported
    from sdt_drake.pilot.head import check_head
    from sdt_drake.pilot.illusions import intended_illusions
    from sdt_drake.pilot.orientation import CAUTION
    from sdt_drake.show.reports.perception import (
        INTENDED,
        intended_table,
        reported_notes,
        reported_table,
    )

    model = sdt.load_robot(robot or common.ROBOT)
    check_head(model)
    rows = reported.validate()
    echo_wrapped(reported.verdict_of_all(rows), "")
    echo()
    print_document_table(reported_table(rows))
    echo_wrapped(reported.LEGEND, "")
    echo()
    for note in reported_notes(rows):
        echo_wrapped(note, "- ")
    echo()
    echo("The illusion of each training motion [deg, deg/s]")
    print_document_table(intended_table(intended_illusions(model)))
    echo_wrapped(INTENDED, "")
    echo()
    echo_wrapped(CAUTION, "")


def people(
    motion: common.Motion,
    /,
    *,
    pilots: Annotated[common.Integer, common.number(gte=1, lte=100_000)] = 100,
    robot: common.OtherRobot = None,
    gains: Gains = "clark2019",
) -> None:
    """Predict how many of different pilots feel the illusion of a motion.

    example: sdt-drake pilot people graveyard_spin --pilots 200

    Args:
        pilots: number of pilots with different parameters
    """
    import numpy as np

    from sdt_drake.pilot.head import check_head
    from sdt_drake.pilot.illusions import LEVELS, PERIOD, illusion_of, planned_head, unit_of
    from sdt_drake.pilot.orientation import CAUTION
    from sdt_drake.pilot.pilots import differences, feelings

    model = sdt.load_robot(robot or common.ROBOT)
    check_head(model)
    head, meant = planned_head(motion, model), illusion_of(motion)
    by_value = meant is not None and meant.of == "felt"
    how, value = ("felt with", "Felt value") if by_value else ("wrong by", "Felt minus true")
    for own in feelings(meant, head, PERIOD, gains, pilots):
        unit = unit_of(own.quantity)
        low, middle, high = np.percentile(own.errors, [5, 50, 95])
        echo_wrapped(
            f"{own} are predicted to feel the illusion of {motion}: {own.quantity} {how} more "
            f"than {LEVELS[own.quantity]:g} {unit}. {value}: median {middle:+.1f} {unit}, "
            f"{low:+.1f} to {high:+.1f} {unit} for 90 % of the pilots.",
            "",
        )
    echo()
    for sentence in [f"Pilots around {gains}.", *differences(), CAUTION]:
        echo_wrapped(sentence, "")


def _moved(
    what: str, robot: str | None, changes: common.Changes
) -> tuple[str, Array, HeadTracking | HeadMotion, Story]:
    """Return name, time [s], motion of the head and story of a scenario, motion or recording."""
    from sdt_drake.analysis.tracking import track_head
    from sdt_drake.io.resources import find_file
    from sdt_drake.motion import Story, load_plan, story_of
    from sdt_drake.pilot.head import check_head, head_motion_of_samples
    from sdt_drake.pilot.illusions import PERIOD

    if Path(what).suffix not in TABLES and common.is_scenario(what):
        common.refuse(
            f"has an effect on recordings and motions only; change the robot of {what} with "
            f"--set robot={robot}",
            robot=robot,
        )
        design = common.design_of(what, changes, check_head)
        device = design.device.simulated
        story = story_of(design.scenario.motion, device, design.reference.tracked)
        recording = sdt.simulate(design)
        return design.scenario.name, recording.time, track_head(recording, device), story
    common.refuse_changes(changes, what)
    model = sdt.load_robot(robot or common.ROBOT)
    check_head(model)
    if Path(what).suffix in TABLES:
        recording = sdt.Recording.load(what)
        if recording.q.shape[1] != model.n:
            raise InputError(
                f"{what}: recorded with {recording.q.shape[1]} joint(s), "
                f"but {model.name} has {model.n}; give the robot of the recording with --robot"
            )
        return Path(what).stem, recording.time, track_head(recording, model), Story()
    file = find_file(what, "scenario", "motion")
    motion = load_plan(file, model, period=PERIOD).motion
    head = head_motion_of_samples(model, PERIOD, motion.q, motion.v)
    return file.stem, motion.time, head, story_of(file, model, motion)


def _motion_rows(
    motions: Mapping[str, HeadMotion], felt: Mapping[str, Percept], period: float
) -> Rows:
    """Return header and rows of the largest quantities of motions by their names."""
    import numpy as np

    from sdt_drake.pilot.canals import sensed_rate
    from sdt_drake.pilot.thresholds import UNPERCEIVED_RATE, false_sensation_after_stop

    def values(motion: HeadMotion, felt: Percept) -> list[str]:
        omega = motion.angular_velocity
        after = false_sensation_after_stop(omega, period)
        return [
            f"{motion.resultant_g.max():.3f}",
            f"{motion.resultant_g.min():.3f}",
            *(f"{w:.1f}" for w in np.degrees(np.abs(omega).max(axis=0))),
            *(f"{w:.1f}" for w in np.degrees(np.abs(sensed_rate(omega, period)).max(axis=0))),
            *(f"{t:.1f}".replace("nan", "–") for t in after),
            *(f"{a:.1f}" for a in np.degrees([np.abs(felt.roll).max(), np.abs(felt.pitch).max()])),
        ]

    axes = ("roll", "pitch", "yaw")
    labels = ["largest G", "smallest G", *(f"{axis} rate, largest [deg/s]" for axis in axes)]
    labels += [f"{axis} rate signalled by the canals, largest [deg/s]" for axis in axes]
    after = f"after the stop, time with more than {UNPERCEIVED_RATE:g} deg/s signalled [s]"
    labels += [f"{axis} {after}" for axis in axes]
    labels += ["felt roll from the vertical, largest [deg]", "felt pitch, largest [deg]"]
    columns = [values(motion, felt[name]) for name, motion in motions.items()]
    return ("", *motions), list(zip(labels, *columns, strict=True))


def _felt_rows(head: HeadTracking, time: Array) -> Rows:
    """Return header and rows of the error in multiples of the threshold, by channel."""
    from sdt_drake.pilot.thresholds import CHANNELS

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
        "if only positions were wrong, largest", "above 1 [% of time]",
    )  # fmt: skip
    return header, rows


def _write(
    path: Path,
    time: Array,
    period: float,
    head: HeadTracking | HeadMotion,
    felt: Mapping[str, Percept],
) -> None:
    """Write the perception over time to a table.

    Columns name_1, name_2, name_3 are along x, y, z of the head; multiple_1 to multiple_6 are in
    the order of CHANNELS.
    """
    from sdt_drake.analysis.tracking import HeadTracking, motions_of
    from sdt_drake.io.tables import write_table
    from sdt_drake.pilot.canals import sensed_rate

    columns: dict[str, Array] = {}
    for name, motion in motions_of(head).items():
        suffix = "_ref" if name == "reference" else ""
        columns |= {
            f"specific_force{suffix}": motion.specific_force,
            f"angular_velocity{suffix}": motion.angular_velocity,
            f"angular_acceleration{suffix}": motion.angular_acceleration,
            f"canals{suffix}": sensed_rate(motion.angular_velocity, period),
        }
        signals = felt[name].columns.items()
        columns |= {f"felt_{signal}{suffix}": values for signal, values in signals}
    if isinstance(head, HeadTracking):
        columns["multiple"] = head.felt.multiples
    write_table(path, time, columns)
