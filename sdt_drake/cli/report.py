"""The command `report`."""

from typing import Annotated

from cyclopts import Parameter

from sdt_drake.cli.common import Target, check_folder
from sdt_drake.cli.printing import echo
from sdt_drake.io.errors import InputError


def run(folder: Annotated[Target, Parameter(name="DIR")], /) -> None:
    """Write one self-contained report.html from the results of `reproduce` or `study`.

    Studies in folders of DIR become chapters of the report.

    example: sdt-drake report out

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
