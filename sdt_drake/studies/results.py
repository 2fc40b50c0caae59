"""The rows of a study: as a table, and as a file for other programs."""

import json
from dataclasses import asdict
from pathlib import Path

from sdt_drake.io.errors import InputError, is_within
from sdt_drake.io.files import replacing
from sdt_drake.studies.distributions import Random
from sdt_drake.studies.folder import load_folder
from sdt_drake.studies.store import ABOUT, RESULTS, Store
from sdt_drake.studies.study import Study
from sdt_drake.studies.table import StudyTable

_UNCERTAIN = ("motion", "plant", "disturbance", "drive.torque_error", "controller.model")
"""Parts of a scenario that a designer does not choose; designs have to cope with all of them."""


def write_results(store: Store, folder: Path) -> Path:
    """Write the rows as results.parquet, or as results.csv without pyarrow; return the path.

    Raises:
        InputError: if the file cannot be written.
    """
    runs, path = store.runs(), folder / RESULTS
    try:
        import pyarrow
        from pyarrow import parquet
    except ImportError:
        path = folder / "results.csv"
        with replacing(path) as partial:
            runs.to_csv(partial, lineterminator="\n")
        return path
    table = pyarrow.Table.from_pandas(runs.reset_index(), preserve_index=False)
    table = table.replace_schema_metadata({ABOUT: json.dumps(asdict(store.about))})
    with replacing(path) as partial:
        parquet.write_table(table, partial)
    return path


def read_study_table(folder: Path) -> StudyTable:
    """Return the finished runs of a study folder.

    Raises:
        InputError: if the folder contains no study or no finished run, or a file cannot be used.
    """
    study = load_folder(folder)
    with Store(folder) as store, store.reading():
        store.check_numbers(len(study))
        if store.input_names != [variable.name for variable in study.variables]:
            raise ValueError("its columns are not those of the study")
        runs = store.runs()
    if runs.empty:
        raise InputError(f"{folder}: no finished run; continue the study with resume=True")
    return StudyTable(
        name=study.name,
        runs=runs,
        input_names=tuple(store.input_names),
        choices=_choices(study),
        per_draw=study.per_draw,
        missing=len(study) - len(runs),
        units={variable.name: variable.unit for variable in study.variables},
    )


def _choices(study: Study) -> tuple[str, ...] | None:
    """Return `StudyTable.choices` of a study."""
    uncertain = [
        v for v in study.variables if any(is_within(x, y) for x in v.fields for y in _UNCERTAIN)
    ]
    if any(isinstance(variable.distribution, Random) for variable in uncertain):
        return None
    return tuple(variable.name for variable in study.variables if variable not in uncertain)
