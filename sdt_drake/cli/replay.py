"""The command `replay`."""

import sdt_drake as sdt
from sdt_drake.cli import common
from sdt_drake.cli.common import Columns, Given, Out, Scenario, Show, Side
from sdt_drake.cli.printing import echo, print_document_table


def run(
    recording: str,
    scenario: Scenario,
    /,
    *,
    columns: Columns = None,
    side: Side = None,
    out: Out = None,
    show: Show = False,
    given: Given = Given(),
) -> None:
    """Simulate a recorded reference, and compare the recording with the simulation.

    example: sdt-drake replay run.csv coupled_pi_ctc --out replay

    Args:
        recording: CSV file with the reference (q_ref_k or v_ref_k) and measured signals (some of
            q_k, v_k, tau_k; joint k), or a recording of `simulate`; its torque feedforward
            (tau_ff_k), if any, replaces the controller's own
        out: folder for report, figure and table; or file for the figure alone (.png, .svg, .pdf)
            or the table alone (.csv)
    """
    from sdt_drake.show.figures.replay import replay_figure
    from sdt_drake.show.reports.replay import FILES, replay_findings, tables, write_replay
    from sdt_drake.show.sections import plain

    common.check_out(out, show, ["", ".csv"])
    if out is not None and not out.suffix:
        common.check_folder(out, FILES)
    loaded = sdt.load(scenario, dict(given.changes))
    replayed = sdt.replay(recording, loaded, columns=columns, side=side)
    for line in replay_findings(replayed):
        echo(plain(line))
    for table in tables(replayed):
        echo()
        print_document_table(table)
    if out is not None and not out.suffix:
        echo(f"\n{write_replay(replayed, out)} written")
        out = None
    common.deliver(out, show, lambda: replay_figure(replayed), replayed.to_csv)
