"""The rows of a study: as a table, and as a file for other programs."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sdt_drake.io.errors import InputError, is_within
from sdt_drake.io.files import replacing, write_csv
from sdt_drake.studies.distributions import Random
from sdt_drake.studies.folder import load_folder
from sdt_drake.studies.store import ABOUT, RESULTS, Store
from sdt_drake.studies.study import Study
from sdt_drake.studies.table import RUN_COLUMNS, StudyTable

_UNCERTAIN = ("motion", "plant", "disturbance", "drive.torque_error", "controller.model")
"""Parts of a scenario that a designer does not choose; designs have to cope with all of them."""


def write_results(store: Store, folder: Path) -> Path:
    """Write the rows as results.parquet, or as results.csv without pyarrow; return the path.

    Raises:
        InputError: if the file cannot be written.
    """
    try:
        import pyarrow
        from pyarrow import parquet
    except ImportError:
        rows = (row for columns in store.groups() for row in zip(*columns, strict=True))
        return write_csv(folder / "results.csv", store.kinds, rows)
    types = {int: pyarrow.int64(), float: pyarrow.float64(), str: pyarrow.string()}
    fields = [(name, types[kind]) for name, kind in store.kinds.items()]
    schema = pyarrow.schema(fields, {ABOUT: json.dumps(store.about)})
    path = folder / RESULTS
    with replacing(path) as partial, parquet.ParquetWriter(partial, schema) as file:
        for columns in store.groups():
            file.write_table(pyarrow.table([*map(pyarrow.array, columns)], schema=schema))
    return path


def read_study_table(folder: Path) -> StudyTable:
    """Return the finished runs of a study folder.

    Raises:
        InputError: if the folder contains no study or no finished run, or a file cannot be used.
    """
    study, outcomes = load_folder(folder)
    with Store(folder) as store, store.reading():
        store.check_numbers(len(study))
        kinds = store.kinds
        groups: list[list[NDArray[Any]]] = [  # arrays need a fifth of the memory of tuples
            [np.array(values, kind) for values, kind in zip(columns, kinds.values(), strict=True)]
            for columns in store.groups()
        ]
    if not groups:
        raise InputError(f"{folder}: no finished run; continue the study with --resume")
    arrays = dict(zip(kinds, map(np.concatenate, zip(*groups, strict=True)), strict=True))
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
    """Return `StudyTable.choices` of a study."""

    def is_uncertain(field: str) -> bool:
        return any(is_within(field, part) for part in _UNCERTAIN)

    uncertain = [v for v in study.variables if any(map(is_uncertain, v.fields))]
    if any(isinstance(variable.distribution, Random) for variable in uncertain):
        return None
    return tuple(variable.name for variable in study.variables if variable not in uncertain)
