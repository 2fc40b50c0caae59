"""Tables in binary files, .mat of MATLAB and Octave and Parquet, and values in JSON."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from sdt_drake.io.errors import InputError, needing, one_line

if TYPE_CHECKING:
    from sdt_drake.io.arrays import Array

BINARY = (".mat", ".parquet")

TABLES = (".csv", *BINARY)
"""Kinds of files that tables of joints are read from and written as."""

FIGURES = (".png", ".svg", ".pdf")
"""Kinds of files that figures are written as."""


MOST_NUMBERS = 100_000_000
"""Of a table that is read, 0.8 GB: memory holds up to six times that."""

_FEW = 25_000_000  # that any binary file may hold


def check_binary(path: Path) -> None:
    """Refuse a file of Parquet where pyarrow is not installed.

    Raises:
        InputError: naming the package.
    """
    needs = f"{path}: .parquet files need pyarrow, which is not installed"
    if path.suffix == ".parquet":
        with needing(needs, "sdt_drake[exchange]"):
            import pyarrow.parquet  # noqa: F401


def write_binary(path: Path, columns: Mapping[str, Array]) -> None:
    """Write columns, of shape (N,) or (N, n); in Parquet column k is called name_k.

    Args:
        path: to be written now, in place.
        columns: by name.
    """
    if path.suffix == ".mat":
        import scipy.io

        scipy.io.savemat(path, dict(columns), oned_as="column")
        return
    import pyarrow as pa
    import pyarrow.parquet

    pyarrow.parquet.write_table(pa.table(flat(columns)), path)


def flat(columns: Mapping[str, Array]) -> dict[str, Array]:
    """Columns of shape (N,), of which those of shape (N, n) are called name_k."""
    result: dict[str, Array] = {}
    for name, values in columns.items():
        whole = {name: values} if values.ndim == 1 else {}
        result |= whole or {f"{name}_{k + 1}": part for k, part in enumerate(values.T)}
    return result


def read_binary(path: Path) -> dict[str, Array]:
    """The columns of numbers, each of shape (N,), by name; what else there is, is left out.

    Raises:
        InputError: naming the file, if it is none of that kind, or the columns differ in length.
    """
    check_binary(path)
    try:
        columns = _read_mat(path) if path.suffix == ".mat" else _read_parquet(path)
    except NotImplementedError:
        raise InputError(f"{path}: is of version 7.3, expected one saved with -v7") from None
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    except Exception as error:  # of many kinds
        raise InputError(f"{path}: cannot be read as {path.suffix} ({one_line(error)})") from None
    if len({len(values) for values in columns.values()}) > 1:
        raise InputError(f"{path}: the columns differ in length")
    return columns


def _read_mat(path: Path) -> dict[str, Array]:
    from sdt_drake.io.mat import read_mat

    arrays = read_mat(path, 8 * _most(path))
    count = max((max(values.shape) for values in arrays.values()), default=0)
    upright = {
        name: values if len(values) == count else values.T
        for name, values in arrays.items()
        if count in values.shape  # others are no columns, as a period or masses
    }
    _check_count(path, sum(values.size for values in upright.values()))
    whole = {name: values[:, 0] if name == "time" else values for name, values in upright.items()}
    return {name: values.astype(float) for name, values in flat(whole).items()}


def _read_parquet(path: Path) -> dict[str, Array]:
    import pyarrow
    import pyarrow.parquet

    with pyarrow.parquet.ParquetFile(path) as file:
        types = pyarrow.types
        names = [
            field.name
            for field in file.schema_arrow
            if types.is_integer(field.type) or types.is_floating(field.type)
        ]
        _check_count(path, len(names) * file.metadata.num_rows)
        table = file.read(names)
    return {name: table[name].to_numpy().astype(float) for name in names}


def _most(path: Path) -> int:
    """Numbers that a file may hold; compression makes some of nothing."""
    return min(MOST_NUMBERS, _FEW + path.stat().st_size)


def _check_count(path: Path, count: int) -> None:
    if count > _most(path):
        raise InputError(f"{count} numbers, expected at most {_most(path)} in a file of its size")


def in_json(value: object) -> object:
    """A value as JSON has it: lists for arrays, null for what is not finite."""
    if isinstance(value, Mapping):
        return {key: in_json(inner) for key, inner in value.items()}
    import numpy as np

    if isinstance(value, np.ndarray | np.generic):
        return in_json(value.tolist())
    if isinstance(value, list | tuple):
        return [in_json(inner) for inner in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
