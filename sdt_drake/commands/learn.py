"""Fly a motion several times, and learn from its errors what reference to fly next."""

from __future__ import annotations

import argparse
from pathlib import Path

from sdt_drake.commands.common import (
    add_out,
    add_scenario,
    check_folder,
    design_of,
    print_table,
    say,
)
from sdt_drake.errors import InputError

EXAMPLE = "sdt-drake learn wrong_model --set controller.kind=p_pi --flights 5 --out learned"

_MOST = 1000  # flights


def add(parser: argparse.ArgumentParser) -> None:
    add_scenario(parser)
    parser.add_argument(
        "--flights", type=int, default=5, help="at most, with the first one (default: 5)"
    )
    parser.add_argument(
        "--of",
        choices=("reference", "torque"),
        default="reference",
        help="what is learned: a change of the reference (default), or a torque feedforward",
    )
    parser.add_argument(
        "--bandwidth",
        type=float,
        metavar="HZ",
        help="up to which errors are learned (default: as far as the model is trusted)",
    )
    parser.add_argument(
        "--study",
        metavar="STUDY",
        help="whose variables are the uncertainty of the device, which learning must converge for",
    )
    parser.add_argument(
        "--draws", type=int, default=20, help="devices of the study to check, at most (default: 20)"
    )
    parser.add_argument(
        "--all", action="store_true", help="fly all flights, though another one is not worth it"
    )
    add_out(parser, "folder for the learned reference, a scenario with it, and a report", "learned")


def run(options: argparse.Namespace) -> None:
    import numpy as np

    from sdt_drake.learning.convergence import convergence, refuse_divergence
    from sdt_drake.learning.filter import design_filter
    from sdt_drake.learning.flights import Flight, learn
    from sdt_drake.learning.loops import loops_of
    from sdt_drake.learning.report import (
        LEARNED,
        SCENARIO,
        Learned,
        check_rows,
        flight_rows,
        summary,
        write_learned,
    )
    from sdt_drake.studies.study import load_study

    for name, least in (("flights", 1), ("draws", 1)):
        value = getattr(options, name)
        if not least <= value <= _MOST:
            raise InputError(f"--{name}: {value}, expected {least} to {_MOST}")
    folder: Path = options.out
    check_folder(folder)
    design = design_of(options)
    study = load_study(options.study) if options.study else None
    loops = loops_of(design, options.of, uncertainty=study, draws=options.draws)
    bandwidth = None if options.bandwidth is None else 2 * np.pi * options.bandwidth
    filter_ = design_filter(design, loops, options.of, bandwidth=bandwidth)
    checks = [convergence(filter_, group) for group in loops]
    scenario = design.scenario
    say(f"{scenario.name}: {scenario.controller.label} on the {scenario.plant.kind} plant")
    for k, (omega, why) in enumerate(filter_.bandwidth):
        say(f"joint {k + 1}: errors are learned up to {omega / (2 * np.pi):.3g} Hz ({why})")
    say()
    print_table(*check_rows(checks, filter_))
    refuse_divergence(checks, filter_)
    say()

    def report(flight: Flight) -> None:
        header, rows = flight_rows([flight])
        say(", ".join(f"{name} {cell}" for name, cell in zip(header, rows[0], strict=True)))

    lessons = learn(design, filter_, options.flights, stops=not options.all, report=report)
    for line in summary(lessons):
        say(line)
    page = write_learned(folder, Learned(design, filter_, checks, lessons))
    say(f"{folder / LEARNED} and {folder / SCENARIO} written: sdt-drake simulate uses them")
    say(f"{page} written")
