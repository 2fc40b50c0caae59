"""Make one self-contained report.html of what reproduce or study wrote; studies in folders of DIR
become chapters.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from sdt_drake.cli.common import check_folder, say, some_path
from sdt_drake.io.errors import InputError

EXAMPLE = "sdt-drake report out"


def add(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("folder", metavar="DIR", type=some_path, help="folder that they wrote")


def run(options: argparse.Namespace) -> None:
    from sdt_drake.show.reports.paper import FILES, write_report
    from sdt_drake.show.reports.study import study_chapter, write_study_report
    from sdt_drake.studies.folder import holds_study

    folder: Path = options.folder
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
    say(f"{path} written")
