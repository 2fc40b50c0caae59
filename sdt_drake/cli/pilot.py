"""The command `pilot`."""

from __future__ import annotations

from collections.abc import Sequence
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
    from sdt_drake.robot.robot import Robot as RobotModel

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
    scenario: Annotated[str, common.one_of("scenario", name="SCENARIO|RECORDING")],
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

    example: sdt-drake pilot coupled_pi --out pilot.png

    Args:
        scenario: scenario to run, or a recording that `simulate` wrote (.csv, .mat, .parquet)
        out: CSV file for the perception over time, or file for a figure of it (.png, .svg, .pdf)
    """
    import numpy as np

    from sdt_drake.analysis.tracking import track_head
    from sdt_drake.pilot.illusions import feel, felt_apart, illusions, intended
    from sdt_drake.pilot.observer import load_perception
    from sdt_drake.pilot.orientation import CAUTION

    common.check_out(out, show, [".csv"])
    perception = load_perception(gains)
    name, recording, model, story = _recorded(scenario, robot, given.changes)
    if recording.q.shape[1] != model.n:
        raise InputError(
            f"{scenario}: recorded with {recording.q.shape[1]} joint(s), "
            f"but {model.name} has {model.n}; give the robot of the recording with --robot"
        )
    head = track_head(recording, model)
    period = float(recording.time[1] - recording.time[0])
    felt = [feel(motion, period, perception) for motion in (head.reference, head.achieved)]
    echo(
        f"{name}: the pilot could feel the controller's error {100 * head.felt.share:.1f} % of the "
        f"time ({100 * head.felt_from_angles.share:.1f} % if only positions were wrong)"
    )
    angle, rate = (np.degrees(x) for x in felt_apart(*felt))
    echo(
        f"The error changes the felt vertical by up to {angle:.2f} deg and the felt rotation by up "
        f"to {rate:.2f} deg/s."
    )
    found = [str(illusion) for illusion in illusions(felt[1], head.achieved)]
    echo(f"Illusions predicted for the achieved motion by {gains}:")
    for text in found or ["none"]:
        echo(f"  {text}")
    if story.illusion:
        meant = intended(name, story.illusion, head.achieved, {gains: felt[1]})
        echo(f"Intended illusion: {meant.sentence(gains)}")
    echo(CAUTION)
    echo()
    print_table(*_motion_rows(head, felt, period))
    echo("axes of the head: x forward, y left, z up")
    echo()
    print_table(*_felt_rows(head, recording.time))
    echo("multiples of the threshold of feeling")
    common.deliver(
        out,
        show,
        lambda: sdt.plots_pilot.pilot(f"{name}: what the pilot feels", recording.time, head, story),
        lambda path: _write(path, recording.time, period, head, felt),
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
    from sdt_drake.show.reports.perception import intended_table, reported_notes, reported_table

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
    echo("The illusion of each training motion, felt minus true [deg, deg/s]; ✗ too small to feel")
    print_document_table(intended_table(intended_illusions(model)))
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
    head = planned_head(motion, model)
    for own in feelings(illusion_of(motion), head, PERIOD, gains, pilots):
        unit = unit_of(own.quantity)
        low, middle, high = np.percentile(own.errors, [5, 50, 95])
        echo_wrapped(
            f"{own} are predicted to feel the illusion of {motion}: {own.quantity} wrong by more "
            f"than {LEVELS[own.quantity]:g} {unit}. Felt minus true: median {middle:+.1f} {unit}, "
            f"{low:+.1f} to {high:+.1f} {unit} for 90 % of the pilots.",
            "",
        )
    echo()
    for sentence in [f"Pilots around {gains}.", *differences(), CAUTION]:
        echo_wrapped(sentence, "")


def _recorded(
    path: str, robot: str | None, changes: common.Changes
) -> tuple[str, sdt.Recording, RobotModel, Story]:
    """Return name, recording, robot and story of a scenario or a recording."""
    from sdt_drake.motion import Story, story_of
    from sdt_drake.pilot.head import check_head

    if Path(path).suffix in TABLES:
        common.refuse_changes(changes, path)
        model = sdt.load_robot(robot or common.ROBOT)
        check_head(model)
        return Path(path).stem, sdt.Recording.load(path), model, Story()
    common.refuse(
        f"has an effect on recordings only; change the robot of {path} with --set robot={robot}",
        robot=robot,
    )
    design = common.design_of(path, changes, check_head)
    story = story_of(design.scenario.motion, design.device.simulated, design.reference.tracked)
    return design.scenario.name, sdt.simulate(design), design.device.simulated, story


def _motion_rows(head: HeadTracking, felt: Sequence[Percept], period: float) -> Rows:
    """Return header and rows of the largest quantities, reference and achieved."""
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
    columns = (labels, values(head.reference, felt[0]), values(head.achieved, felt[1]))
    return ("", "reference", "achieved"), list(zip(*columns, strict=True))


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
    path: Path, time: Array, period: float, head: HeadTracking, felt: Sequence[Percept]
) -> None:
    """Write the perception over time to a table.

    Columns name_1, name_2, name_3 are along x, y, z of the head; multiple_1 to multiple_6 are in
    the order of CHANNELS.
    """
    from sdt_drake.io.tables import write_table
    from sdt_drake.pilot.canals import sensed_rate

    columns: dict[str, Array] = {}
    motions = (head.reference, head.achieved)
    for suffix, motion, own in zip(("_ref", ""), motions, felt, strict=True):
        columns |= {
            f"specific_force{suffix}": motion.specific_force,
            f"angular_velocity{suffix}": motion.angular_velocity,
            f"angular_acceleration{suffix}": motion.angular_acceleration,
            f"canals{suffix}": sensed_rate(motion.angular_velocity, period),
        }
        columns |= {f"felt_{name}{suffix}": values for name, values in own.columns.items()}
    write_table(path, time, {**columns, "multiple": head.felt.multiples})
