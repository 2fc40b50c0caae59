"""Run a scenario and show how well the joints follow."""

from __future__ import annotations

import argparse

from sdt_drake.commands.common import (
    add_out,
    add_scenario,
    add_show,
    check_out,
    deliver,
    design_of,
    print_table,
    say,
)

EXAMPLE = "sdt-drake simulate package://sdt/scenarios/coupled_pi_ctc.yaml --out run.csv"


def add(parser: argparse.ArgumentParser) -> None:
    add_scenario(parser)
    add_out(parser, "CSV file for the recording, or a figure of it (.png, .svg, .pdf)")
    add_show(parser)


def run(options: argparse.Namespace) -> None:
    import numpy as np

    from sdt_drake.analysis import plots
    from sdt_drake.analysis.tracking import stops_passed, track
    from sdt_drake.simulate import simulate

    check_out(options.out, csv=True, show=options.show)
    design = design_of(options.scenario)
    scenario = design.scenario
    recording = simulate(design)
    tracking = track(recording, design.motion)
    say(f"{scenario.name}: {scenario.controller.label} on the {scenario.plant.kind} plant")
    print_table(
        ("joint", "largest error [rad/s]", "RMS [rad/s]", "constant speed [rad/s]",
         "position [deg]", "saturated [%]"),
        [
            (
                f"{k + 1} {design.robot.joint_names[k]}",
                f"{tracking.max_abs_speed_error[k]:.4f}",
                f"{tracking.rms_speed_error[k]:.4f}",
                f"{tracking.constant_speed_error[k]:.4f}".replace("nan", "–"),
                f"{np.degrees(tracking.max_abs_position_error[k]):.3f}",
                f"{100 * tracking.saturated_fraction[k]:.2f}",
            )
            for k in range(design.robot.n)
        ],
    )  # fmt: skip
    for line in stops_passed(recording, design.robot.joint_names):
        say(f"note: {line}")
    paper_label = {"pi": "PI", "pi_ctc": "PI + CTC"}
    label = paper_label.get(scenario.controller.kind, scenario.controller.label)
    deliver(
        options,
        lambda: plots.speed_errors(
            f"{scenario.name}: speed errors",
            recording.time,
            plots.tracking_lines({label: recording}, "speed_error"),
            design.robot.joint_names,
            design.motion,
        ),
        recording.to_csv,
    )
