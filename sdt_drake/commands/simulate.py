"""Run a scenario and show how well the joints follow."""

from __future__ import annotations

import argparse

from sdt_drake.commands import common

EXAMPLE = "sdt-drake simulate package://sdt/scenarios/coupled_pi_ctc.yaml --out run.csv"


def add(parser: argparse.ArgumentParser) -> None:
    common.add_scenario(parser)
    common.add_figure(parser, "CSV file for the recording, or a figure of it (.png, .svg, .pdf)")


def run(options: argparse.Namespace) -> None:
    from sdt_drake.analysis import plots
    from sdt_drake.analysis.metrics import COMPARED, METRICS
    from sdt_drake.analysis.tracking import stops_passed, track
    from sdt_drake.simulate import simulate

    common.check_out(options.out, csv=True, show=options.show)
    design = common.design_of(options.scenario)
    scenario = design.scenario
    recording = simulate(design)
    tracking = track(recording, design.motion)
    common.say(f"{scenario.name}: {scenario.controller.label} on the {scenario.plant.kind} plant")
    own = [(METRICS[x], getattr(tracking, x)) for x in COMPARED if hasattr(tracking, x)]
    columns = [(metric.column, metric.format, metric.factor * values) for metric, values in own]
    common.print_joints(design.robot.joint_names, columns)
    for line in stops_passed(recording, design.robot.joint_names):
        common.say(f"note: {line}")
    common.deliver(
        options,
        lambda: plots.speed_errors(
            f"{scenario.name}: speed errors",
            {scenario.controller.label: recording},
            design.robot.joint_names,
            design.motion,
        ),
        recording.to_csv,
    )
