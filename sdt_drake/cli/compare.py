"""Run a scenario with several controllers, side by side."""

from __future__ import annotations

import argparse

import sdt_drake as sdt
from sdt_drake.cli import common
from sdt_drake.cli.common import print_table, say

EXAMPLE = "sdt-drake compare coupled_pi --controllers pi,pi_id,p_pi+id"


CONTROLLERS = {
    "axis": "pi,pi_ctc,pi_id,p_pi+id,pi_scheduled",
    "coupled": "pi,pi_ctc,pi_id,p_pi,p_pi+id,pi_scheduled,inverse_dynamics",
}


def add(parser: argparse.ArgumentParser) -> None:
    common.add_scenario(parser)
    parser.add_argument(
        "--controllers",
        help="kinds of controllers, with +none, +ctc or +id where a kind leaves its feedforward "
        "open (default: all that the plant allows)",
    )
    text = "CSV file for the table, or a figure of it (.png, .svg, .pdf)"
    common.add_figure(parser, text, [".csv"])


def run(options: argparse.Namespace) -> None:
    from sdt_drake.analysis import comparison
    from sdt_drake.analysis.tracking import stops_passed

    design = common.design_of(options)
    scenario, text = design.scenario, options.controllers
    if text is None:
        text = CONTROLLERS[scenario.plant.kind]
    labels = [label.strip() for label in text.split(",") if label.strip()]
    comparison.check_labels(labels, "--controllers")
    with common.naming(options.scenario):
        compared = sdt.compare(design, labels)
    count = f"{len(compared)} controller{'s' if len(compared) > 1 else ''}"
    say(f"{scenario.name}: {count} on the {scenario.plant.kind} plant")
    print_table(*comparison.comparison_rows(compared), keys=2)
    say("speeds and positions are joint side, torques motor side, % of the motor's largest")
    for c in compared:
        for line in stops_passed(c.recording, c.design.robot.joint_names):
            say(f"note: {c.label}: {line}")
    say()
    header, rows = comparison.felt_rows(compared)
    if rows:
        print_table(header, rows)
        say("share of time in which the pilot could feel the error; largest: multiples of what is")
        say("just felt, about and along the axes of the head")
        say()
    print_table(
        ("controller", "blocks", "needs to know"),
        [(c.label, str(c.blocks), ", ".join(c.needs)) for c in compared],
    )
    common.deliver(
        options,
        lambda: sdt.plots.comparison(f"{scenario.name}: controllers", compared),
        lambda path: comparison.write_comparison(compared, path),
    )
