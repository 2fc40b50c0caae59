"""The command `size`."""

import shlex
from pathlib import Path
from typing import Annotated

from sdt_drake.cli.common import Given, Out, check_folder, one_of
from sdt_drake.cli.printing import echo
from sdt_drake.cli.study import FAILED, Cluster, Quick, Resume, Workers, run_into
from sdt_drake.io.files import replacing_files, write_text


def run(
    sizing: Annotated[str, one_of("study")],
    /,
    *,
    out: Out = None,
    workers: Workers = None,
    cluster: Cluster = None,
    resume: Resume = False,
    quick: Quick = False,
    given: Given = Given(),
) -> int:
    """Find the lightest sufficient motors for each controller, with a report of the reasons.

    example: sdt-drake size sizing --workers 2 --out sizing

    Args:
        sizing: shipped name or .yaml file of a sizing
        out: folder for the study (default: its name)
        quick: a first look: the first motion and controller alone, speeds to 0.01 rad/s
    """
    from sdt_drake.show.documents import REPORT
    from sdt_drake.show.reports.sizing import FILES, sizing_report
    from sdt_drake.studies.results import read_study_table
    from sdt_drake.studies.sizing import first_look, load_sizing
    from sdt_drake.studies.summary import failures
    from sdt_drake.studies.verdicts import judge_candidates, verdict_table

    chosen, base = load_sizing(sizing, dict(given.changes))
    if quick:
        chosen = first_look(chosen)
    folder = out or Path(chosen.name + "_quick" * quick)
    check_folder(folder, ("sizing.txt", "candidates.csv", *FILES))
    run_into(folder, chosen.study(), base, workers, cluster, resume)
    table = read_study_table(folder)
    verdicts = judge_candidates(chosen, table)
    failed = failures(table)
    report = sizing_report(chosen, verdicts, failed)
    lines = report.lines()
    for line in lines:
        echo(line)
    echo()
    with replacing_files(folder) as new:
        write_text(new / "sizing.txt", "\n".join(lines) + "\n")
        verdict_table(verdicts).to_csv(new / "candidates.csv", index=False, lineterminator="\n")
        report.write(new)
    echo(f"{folder / REPORT} and {folder / 'candidates.csv'} written")
    where = shlex.quote(str(folder))
    echo(f"next, to see all runs: sdt-drake study show {where} --out {where}/runs")
    return FAILED if failed else 0
