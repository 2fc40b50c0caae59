"""The command `reproduce`."""

import time
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from sdt_drake.cli.common import OutFolder, Target, check_folder
from sdt_drake.cli.printing import echo, echo_wrapped
from sdt_drake.io.errors import InputError


def run(*, out: OutFolder = Path("out")) -> None:
    """Reproduce the paper: tables, figures, diagrams, claims.

    `reproduce report` writes the report again, with studies as chapters.

    example: sdt-drake reproduce --out out

    Args:
        out: folder for the results
    """
    from sdt_drake.paper.files import FILES, write_reproduction
    from sdt_drake.paper.report import claims_in_words, findings
    from sdt_drake.paper.reproduction import Stopwatch, reproduce
    from sdt_drake.show.documents import REPORT
    from sdt_drake.show.sections import plain

    start = time.perf_counter()
    check_folder(out, FILES)
    watch = Stopwatch(echo)
    summary = write_reproduction(reproduce(watch), out, watch)
    echo()
    echo_wrapped(claims_in_words(summary["claims"]), rest="")
    for finding in findings(summary):
        echo_wrapped(plain(finding), "- ")
    seconds = time.perf_counter() - start
    echo(f"\nOpen {out / REPORT}; {seconds:.1f} s in all")


def report(folder: Annotated[Target, Parameter(name="DIR")], /) -> None:
    """Write the report again from the results in a folder, one self-contained report.html.

    Studies in folders of DIR become chapters of the report; the folder of a study gets its own.

    example: sdt-drake reproduce report out

    Args:
        folder: folder with the results
    """
    from sdt_drake.paper.report import FILES, write_report
    from sdt_drake.show.reports.study import study_chapter, write_study_report
    from sdt_drake.studies.folder import holds_study

    check_folder(folder)
    if not folder.is_dir():
        raise InputError(
            f"{folder}: no such folder; run `sdt-drake reproduce --out {folder}` first"
        )
    if holds_study(folder):
        path, _ = write_study_report(folder)
    else:
        check_folder(folder, FILES)
        studies = [path for path in sorted(folder.iterdir()) if holds_study(path)]
        path = write_report(folder, [study_chapter(study) for study in studies])
    echo(f"{path} written")
