"""The rows of a study as one Parquet file."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from sdt_drake.io.errors import InputError, needing
from sdt_drake.io.fields import is_within
from sdt_drake.io.files import replacing
from sdt_drake.studies.distributions import Random
from sdt_drake.studies.folder import load_folder
from sdt_drake.studies.job import Job
from sdt_drake.studies.journal import Row, read_rows
from sdt_drake.studies.study import Study
from sdt_drake.studies.table import RUN_COLUMNS, StudyTable

RESULTS_FILE = "results.parquet"
_ABOUT = "sdt_drake"  # key of the metadata
_MET = ("motion", "plant", "disturbance", "drive.torque_error", "controller.model")
"""Parts of a scenario that designs have to stand."""

_GROUP = 4096  # rows that are in memory together


def require_packages() -> None:
    """Raise InputError if a package that studies need is not there, or cannot be loaded."""
    with needing("studies need pebble and pyarrow", "sdt_drake[study]"):
        import pebble
        import pyarrow.parquet


def write_results(job: Job, rows: Iterable[Row], folder: Path) -> Path:
    """Write rows, in their order, as results.parquet; memory is that of a few thousand.

    Raises:
        InputError: if the file cannot be written.
    """
    import pyarrow
    from pyarrow import parquet

    study, rows = job.study, iter(rows)
    text, number = pyarrow.string(), pyarrow.float64()
    kinds = {"row": pyarrow.int64()}
    kinds |= {v.name: text if v.takes_texts else number for v in study.variables}
    kinds |= {"status": text, "reason": text, "duration": number}
    kinds |= dict.fromkeys(job.outcomes, number)
    about = {
        "study": study.name,
        "inputs": [variable.name for variable in study.variables],
        "outcomes": list(job.outcomes),
        "fingerprint": job.fingerprint,
        "versions": job.versions,
    }
    schema = pyarrow.schema(list(kinds.items()), {_ABOUT: json.dumps(about)})
    path = folder / RESULTS_FILE
    with replacing(path) as partial, parquet.ParquetWriter(partial, schema) as writer:
        while group := list(islice(rows, _GROUP)):
            columns = [
                pyarrow.array(values, from_pandas=True)  # NaN is null
                for values in _columns(study, group, job.outcomes).values()
            ]
            writer.write_table(pyarrow.table(columns, schema=schema))
    return path


def _columns(study: Study, rows: list[Row], outcomes: Sequence[str]) -> dict[str, ArrayLike]:
    inputs = [study.inputs(row.number) for row in rows]
    nothing = (np.nan,) * len(outcomes)
    values = np.array([row.outcomes or nothing for row in rows])
    return {
        "row": [row.number for row in rows],
        **{name: [given[name] for given in inputs] for name in inputs[0]},
        **{name: [getattr(row, name) for row in rows] for name in ("status", "reason", "duration")},
        **dict(zip(outcomes, values.T, strict=True)),
    }


def read_study_table(folder: Path) -> StudyTable:
    """The runs of a study folder that are done.

    Raises:
        InputError: if the folder holds no study, or a file of it cannot be used.
    """
    study, _, outcomes = load_folder(folder)
    rows = read_rows(folder, len(study), len(outcomes))
    groups = []
    while group := list(islice(rows, _GROUP)):  # an array needs a fifth of the numbers' memory
        columns = _columns(study, group, outcomes)
        groups.append({name: np.asarray(values) for name, values in columns.items()})
    if not groups:
        raise InputError(f"{folder}: no run of the study is done yet")
    arrays = {name: np.concatenate([group[name] for group in groups]) for name in groups[0]}
    return StudyTable(
        name=study.name,
        inputs={v.name: arrays[v.name] for v in study.variables},
        outcomes={name: arrays[name] for name in outcomes},
        choices=_choices(study),
        per_draw=study.per_draw,
        missing=len(study) - len(arrays["row"]),
        **{name: arrays[name] for name in RUN_COLUMNS},
    )


def _choices(study: Study) -> tuple[str, ...] | None:
    """See `StudyTable`."""

    def is_met(field: str) -> bool:
        return any(is_within(field, part) for part in _MET)

    met = [variable for variable in study.variables if any(map(is_met, variable.fields))]
    if any(isinstance(variable.distribution, Random) for variable in met):
        return None
    return tuple(variable.name for variable in study.variables if variable not in met)
