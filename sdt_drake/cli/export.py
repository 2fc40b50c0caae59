"""The command `export`."""

from pathlib import Path
from typing import Annotated, Literal

import sdt_drake as sdt
from sdt_drake.cli import common
from sdt_drake.cli.common import Given, Integer, OutFolder, Scenario, number, one_of
from sdt_drake.cli.printing import echo, print_table
from sdt_drake.io.errors import InputError
from sdt_drake.io.shown import formatted, numbered


def run(
    motion: Annotated[str, one_of("scenario", "motion", name="SCENARIO|MOTION")] = common.MOTION,
    /,
    *,
    drive: Annotated[str, one_of("drives")],
    out: OutFolder = Path("exported"),
    scenario: Annotated[str | None, one_of("scenario")] = None,
    cam_points: Annotated[Integer, number(gte=2)] = 1000,
    effort: bool = False,
    given: Given = Given(),
) -> None:
    """Write a motion as the files that drives and robot controllers read.

    `export fmu` writes the loop of a scenario as an FMU for other simulators.

    example: sdt-drake export graveyard_spin --drive drives --out exported

    Args:
        motion: a scenario or a motion: shipped name or file
        drive: file with encoders, signs, rated torques, units and cycle of the drives; `drives`
            is an example
        out: folder for the files
        scenario: for a motion: the scenario of its robot, its planner, and the loop that plays
            the files back (default: training: the shipped device, position loops, torque
            feedforward)
        cam_points: largest number of points of the cam table
        effort: also torques in trajectory.yaml, for robots of ROS 2 that take effort
    """
    import numpy as np

    from sdt_drake.machine.drive_files.drives import load_drives
    from sdt_drake.machine.drive_files.export import FILES, cycles_in_a_period
    from sdt_drake.run.design import make_design
    from sdt_drake.run.scenario import load_scenario

    common.check_folder(out, FILES)
    source, changed = motion, dict(given.changes)
    if not common.is_scenario(source):
        changed["motion"] = source
        source = scenario or "training"
    elif scenario is not None:
        raise InputError(f"--scenario: has no effect, since {source} is a scenario")
    design = make_design(load_scenario(source, changed))
    controller, drives = design.scenario.controller, load_drives(drive, design.device.nominal.n)
    runs = sdt.export(design, drive, out, cam_points=cam_points, effort=effort, title=motion)
    period, cycle = design.reference.tracked.period, drives.cycle_time
    worst = max((x for x in runs if x.source in FILES), key=lambda x: float(x.position_error.max()))
    echo(
        f"{motion}: {design.reference.tracked.duration:g} s for drives with a cycle of "
        f"{1e3 * cycle:g} ms, written into {out}; largest position error of a loop that plays the "
        f"files back {np.degrees(worst.position_error.max()):.2g} deg "
        f"({design.device.simulated.joint(int(worst.position_error.argmax()))}, {worst.source})"
    )
    if abs(period / cycle - round(period / cycle)) > 1e-6:
        echo(
            f"note: the motion's period, {1e3 * period:g} ms, is no multiple of the cycle. The "
            "motion is resampled with linear speeds between samples; the loop that plays it back "
            f"runs every {1e3 * cycle * cycles_in_a_period(design, drives):g} ms, but every "
            f"{1e3 * period:g} ms for trajectory.yaml"
        )
    if not controller.takes_feedforward:
        echo(
            f"note: {controller.label} takes no torque feedforward, so its loop plays the files "
            "back without their torques"
        )
    names = numbered(design.device.nominal.joint_names)
    echo(
        f"Position errors against the planned motion, if {controller.label} on the "
        f"{design.scenario.plant.kind} plant plays each file back:"
    )
    print_table(
        ("from", *(f"{name} [deg]" for name in names)),
        [
            (x.source, *(formatted(error, ".2g") for error in np.degrees(x.position_error)))
            for x in runs
        ],
    )
    echo(
        f"cam.csv has up to {cam_points} points; the cubics between them are within "
        f"{np.degrees(runs[-1].position_off.max()):.2g} deg of the motion. It contains no torques."
    )


def fmu(
    scenario: Scenario,
    /,
    *,
    out: OutFolder = Path("loop.fmu"),
    input: Literal["torque", "reference"] = "torque",
    given: Given = Given(),
) -> None:
    """Write the loop of a scenario as an FMU (FMI 2) for other simulators.

    The simulator needs a Python with sdt_drake.

    example: sdt-drake export fmu coupled_pi --out loop.fmu

    Args:
        out: file for the FMU (.fmu)
        input: input of the FMU: torques, or the reference (needs inverse_dynamics: online)
    """
    from sdt_drake.machine.fmu import write_fmu

    common.check_file(out, (".fmu",))
    design = common.design_of(scenario, given.changes)
    write_fmu(design, out, input)
    echo(f"{out} written: the loop of {scenario} with the {input} as input")
    echo("It starts at rest, takes steps of any size and needs a Python with sdt_drake.")
