"""The command `simulate`."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

import sdt_drake as sdt
from sdt_drake.cli import common
from sdt_drake.cli.common import Given, Integer, Out, Scenario, Show
from sdt_drake.cli.printing import echo, print_joints
from sdt_drake.io.errors import InputError
from sdt_drake.io.formats import TABLES

if TYPE_CHECKING:
    from sdt_drake.analysis.tracking import Tracking
    from sdt_drake.robot.robot import Robot as RobotModel


def run(
    scenario: Scenario,
    /,
    *,
    out: Out = None,
    show: Show = False,
    joint: Annotated[Integer | None, Parameter(metavar="K")] = None,
    given: Given = Given(),
) -> None:
    """Run a scenario and print the errors of the joints.

    example: sdt-drake simulate coupled_pi_ctc --out report.html

    Args:
        out: file for the recording (.csv, .mat, .parquet), a figure (.png, .svg, .pdf), or a
            report with plots to zoom and the run in 3D (.html, or .md for Markdown)
        joint: show joint K alone, counted from the base, 1 (default: all)
    """
    from sdt_drake.analysis.metrics import columns_of
    from sdt_drake.analysis.tracking import stops_passed
    from sdt_drake.io.arguments import chosen_joints
    from sdt_drake.robot.rotors import without_friction, without_rotors

    common.check_out(out, show, [*TABLES, ".html", ".md"])
    is_drawn = show or (out is not None and out.suffix not in TABLES)
    if joint is not None and not is_drawn:
        raise InputError("--joint: has no effect without a figure, add --out run.png or --show")
    design = common.design_of(scenario, given.changes)
    joints = chosen_joints(joint, design.device.simulated.n, "--joint")
    recording = sdt.simulate(design)
    tracking = sdt.track(recording)
    title = design.scenario.summary().title
    echo(f"{title}: {_verdict(tracking, design.device.simulated)}")
    print_joints(design.device.simulated.joint_names, columns_of(vars(tracking)))
    if design.envelope is not None:
        echo(f"torque-speed envelope from {design.envelope.source}")
    if design.windings is not None:
        from sdt_drake.analysis.heat import heat_of

        found = heat_of(recording, design.windings)
        echo(f"the motion {found.sentence(design.device.simulated, recording.time[-1])}")
    stiffness = design.scenario.plant.stops.stiffness
    no_friction = design.scenario.plant.friction.coulomb is None
    left_out = without_rotors(design.nominal), without_friction(design.nominal) * no_friction
    for line in filter(None, left_out):
        echo(f"note: {line}")
    for line in stops_passed(recording, design.device.simulated.joint_names, stiffness):
        echo(f"note: {line}")

    def write(path: Path) -> None:
        if path.suffix in TABLES:
            recording.save(path)
            return
        from sdt_drake.show.reports.run import write_run_report

        write_run_report(design, recording, path, joints)
        if path.suffix == ".html":
            echo(f"{path}: {path.stat().st_size / 1e6:.1f} MB, all in one file")

    common.deliver(out, show, lambda: sdt.plots.scope(title, recording, design, joint), write)


def _verdict(tracking: "Tracking", robot: "RobotModel") -> str:
    """Return the largest errors with their joints, and the longest saturation."""
    import numpy as np

    position = np.degrees(tracking.max_abs_position_error)
    speed, saturated = tracking.max_abs_speed_error, 100 * tracking.saturated_fraction
    k, j, s = (int(values.argmax()) for values in (position, speed, saturated))
    motors = "no motor saturates"
    if saturated[s]:
        motors = f"{robot.joint(s)} saturates {saturated[s]:.2g} % of the time"
    return (
        f"largest position error {position[k]:.3g} deg ({robot.joint(k)}), "
        f"speed error {speed[j]:.3g} rad/s ({robot.joint(j)}); {motors}"
    )
