"""Run a scenario and show how well the joints follow."""

from __future__ import annotations

import argparse

from sdt_drake.commands import common

EXAMPLE = "sdt-drake simulate package://sdt/scenarios/coupled_pi_ctc.yaml --out run.csv"


def add(parser: argparse.ArgumentParser) -> None:
    common.add_scenario(parser)
    common.add_figure(parser, "CSV file for the recording, or a figure of it (.png, .svg, .pdf)")


def run(options: argparse.Namespace) -> None:
    import numpy as np

    from sdt_drake.analysis import plots
    from sdt_drake.analysis.tracking import stops_passed, track
    from sdt_drake.simulate import simulate

    common.check_out(options.out, csv=True, show=options.show)
    design = common.design_of(options.scenario)
    scenario = design.scenario
    recording = simulate(design)
    tracking = track(recording, design.motion)
    common.say(f"{scenario.name}: {scenario.controller.label} on the {scenario.plant.kind} plant")
    common.print_joints(
        design.robot.joint_names,
        [
            ("largest error [rad/s]", ".4f", tracking.max_abs_speed_error),
            ("RMS [rad/s]", ".4f", tracking.rms_speed_error),
            ("constant speed [rad/s]", ".4f", tracking.constant_speed_error),
            ("position [deg]", ".3f", np.degrees(tracking.max_abs_position_error)),
            ("saturated [%]", ".2f", 100 * tracking.saturated_fraction),
        ],
    )
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
