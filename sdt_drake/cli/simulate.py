"""The command `simulate`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

import sdt_drake as sdt
from sdt_drake.cli import common
from sdt_drake.cli.common import Changes, Out, Scenario, Show, Trust, Whole
from sdt_drake.cli.printing import print_joints, say
from sdt_drake.io.errors import InputError
from sdt_drake.io.formats import TABLES


def run(
    scenario: Scenario,
    /,
    *,
    out: Out = None,
    show: Show = False,
    joint: Annotated[Whole | None, Parameter(metavar="K")] = None,
    changes: Changes = (),
    trust: Trust = False,
) -> None:
    """Run a scenario and show how well the joints follow.

    example: sdt-drake simulate coupled_pi_ctc --out report.html

    Args:
        out: the recording (.csv, .mat, .parquet), a figure of it (.png, .svg, .pdf), or a report
            to hand on, with plots to zoom and the run in 3D: one page (.html), or Markdown (.md)
        joint: show joint K alone (1 is the base; default: all)
    """
    from sdt_drake.analysis.metrics import columns_of
    from sdt_drake.analysis.tracking import stops_passed
    from sdt_drake.io.arguments import chosen_joints

    common.check_out(out, show, [*TABLES, ".html", ".md"])
    is_drawn = show or (out is not None and out.suffix not in TABLES)
    if joint is not None and not is_drawn:
        raise InputError(
            "--joint: has no effect without a figure, expected --out run.png or --show"
        )
    design = common.design_of(scenario, changes)
    joints = chosen_joints(joint, design.robot.n, "--joint")
    recording = sdt.simulate(design)
    tracking = sdt.track(recording, design.wanted)
    title = design.scenario.summary().title
    say(title)
    print_joints(design.robot.joint_names, columns_of(vars(tracking)))
    if design.envelope is not None:
        say(f"torque-speed envelope: of {design.envelope.source}")
    for line in stops_passed(recording, design.robot.joint_names):
        say(f"note: {line}")

    def write(path: Path) -> None:
        if path.suffix in TABLES:
            recording.save(path)
            return
        from sdt_drake.show.reports.run import write_run_report

        write_run_report(design, recording, path, joints)
        if path.suffix == ".html":
            say(f"{path}: {path.stat().st_size / 1e6:.1f} MB, all in one file")

    common.deliver(out, show, lambda: sdt.plots.scope(title, recording, design, joint), write)
