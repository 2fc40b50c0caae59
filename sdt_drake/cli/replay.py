"""Run a recorded reference through the simulated loop, and tell where the two differ and why."""

from __future__ import annotations

import argparse

import sdt_drake as sdt
from sdt_drake.cli import common
from sdt_drake.cli.common import say

EXAMPLE = "sdt-drake replay run.csv coupled_pi_ctc --out replay"


def add(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "recording",
        metavar="RECORDING",
        help="CSV file with the reference (q_ref_k or v_ref_k) and what was measured (some of q_k, "
        "v_k, tau_k; joint k), or a recording of `simulate`; a torque feedforward in it (tau_ff_k) "
        "takes the place of the controller's own",
    )
    common.add_scenario(parser)
    common.add_recorded(parser)
    common.add_figure(
        parser,
        "folder for report, figure and table; or the figure alone (.png, .svg, .pdf), or the table "
        "(.csv)",
        ["", ".csv"],
    )


def run(options: argparse.Namespace) -> None:
    from sdt_drake.show.documents import plain
    from sdt_drake.show.figures.replay import replay_figure
    from sdt_drake.show.reports.replay import (
        FILES,
        replay_findings,
        tables,
        write_replay,
    )

    if options.out is not None and not options.out.suffix:
        common.check_folder(options.out, FILES)
    with common.naming_changes(options):
        scenario = sdt.load(options.scenario, dict(options.changes))
        replayed = sdt.replay(
            options.recording, scenario, columns=options.columns, side=options.side
        )
    for line in replay_findings(replayed):
        say(plain(line))
    for table in tables(replayed):
        say()
        common.print_document_table(table)
    if options.out is not None and not options.out.suffix:
        say(f"\n{write_replay(replayed, options.out)} written")
        options.out = None
    common.deliver(options, lambda: replay_figure(replayed), replayed.to_csv)
