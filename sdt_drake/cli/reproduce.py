"""The command `reproduce`."""

import time
from pathlib import Path

from sdt_drake.cli.common import Target, check_folder
from sdt_drake.cli.printing import echo, echo_wrapped


def run(*, out: Target = Path("out")) -> None:
    """Reproduce the paper: tables, figures, diagrams, claims.

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
