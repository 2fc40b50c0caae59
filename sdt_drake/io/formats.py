"""Tables in binary files (.mat of MATLAB and Octave, Parquet), and values in JSON."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sdt_drake.io.errors import InputError, needing, one_line

if TYPE_CHECKING:
    from sdt_drake.io.arrays import Array

BINARY = (".mat", ".parquet")

TABLES = (".csv", *BINARY)
"""Suffixes of tables."""

FIGURES = (".png", ".svg", ".pdf")
"""Suffixes of figures."""

MAX_NUMBERS = 100_000_000
"""Largest number of values in a table: 0.8 GB. Reading takes up to six times that memory."""

_ALWAYS_ALLOWED = 25_000_000  # numbers in a binary file of any size


def check_binary(path: Path) -> None:
    """Check that the library for a binary file is installed.

    Raises:
        InputError: a .parquet file without pyarrow.
    """
    needs = f"{path}: .parquet files need pyarrow, which is not installed"
    if path.suffix == ".parquet":
        with needing(needs, "sdt_drake[exchange]"):
            import pyarrow.parquet  # noqa: F401


def write_binary(path: Path, columns: Mapping[str, Array], units: Mapping[str, str]) -> None:
    """Write a table as .mat or .parquet, in place.

    Args:
        path: the file.
        columns: columns by name, shape (N,) or (N, n). Parquet has name_k for column k, MATLAB a
            structure for each part of a name with dots.
        units: units of some columns by name, several for equal parts of n.
    """
    if path.suffix == ".mat":
        import scipy.io

        whole = _structures({**columns, **{f"units.{x}": unit for x, unit in units.items()}})
        scipy.io.savemat(path, whole, oned_as="column", long_field_names=True)
        return
    import pyarrow as pa
    import pyarrow.parquet

    table = pa.table(flat(columns))
    for name, parts in ((name, unit.split(", ")) for name, unit in units.items()):
        n = columns[name].shape[1]
        for k in range(n):
            at = table.schema.get_field_index(f"{name}_{k + 1}")
            unit = {"unit": parts[k * len(parts) // n]}
            table = table.set_column(at, table.field(at).with_metadata(unit), table.column(at))
    pyarrow.parquet.write_table(table, path)


def _structures(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return values by names with dots as nested mappings."""
    result: dict[str, Any] = {}
    for name, value in values.items():
        inner, (*parts, last) = result, name.split(".")
        for part in parts:
            inner = inner.setdefault(part, {})
        inner[last] = value
    return result


def flat(columns: Mapping[str, Array]) -> dict[str, Array]:
    """Split columns of shape (N, n) into name_1 to name_n, each of shape (N,)."""
    result: dict[str, Array] = {}
    for name, values in columns.items():
        whole = {name: values} if values.ndim == 1 else {}
        result |= whole or {f"{name}_{k + 1}": part for k, part in enumerate(values.T)}
    return result


def read_binary(path: Path, max_numbers: int = MAX_NUMBERS) -> dict[str, Array]:
    """Read the columns of numbers of a binary file by name, each of shape (N,).

    It may contain `max_numbers`, and no more than fit its size, whatever its compression.

    Raises:
        InputError: not such a file, or columns of different lengths.
    """
    check_binary(path)
    most = min(max_numbers, _ALWAYS_ALLOWED + path.stat().st_size)
    try:
        columns = (_read_mat if path.suffix == ".mat" else _read_parquet)(path, most)
    except NotImplementedError:
        raise InputError(f"{path}: MAT file of version 7.3, expected one saved with -v7") from None
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    except Exception as error:  # the libraries raise many types
        raise InputError(f"{path}: cannot be read as {path.suffix} ({one_line(error)})") from None
    if len({len(values) for values in columns.values()}) > 1:
        raise InputError(f"{path}: the columns differ in length")
    return columns


def _read_mat(path: Path, most: int) -> dict[str, Array]:
    from sdt_drake.io.mat import read_mat

    arrays = read_mat(path, 8 * most)
    timed = {"time": arrays["time"]} if "time" in arrays else arrays
    count = max((max(values.shape) for values in timed.values()), default=0)
    upright = {
        name: values if len(values) == count else values.T
        for name, values in arrays.items()
        if count in values.shape  # skip other values, such as a period
    }
    _check_count(sum(values.size for values in upright.values()), most)
    whole = {name: values[:, 0] if name == "time" else values for name, values in upright.items()}
    return {name: values.astype(float) for name, values in flat(whole).items()}


def _read_parquet(path: Path, most: int) -> dict[str, Array]:
    import pyarrow
    import pyarrow.parquet

    with pyarrow.parquet.ParquetFile(path) as file:
        types = pyarrow.types
        names = [
            field.name
            for field in file.schema_arrow
            if types.is_integer(field.type) or types.is_floating(field.type)
        ]
        _check_count(len(names) * file.metadata.num_rows, most)
        table = file.read(names)
    return {name: table[name].to_numpy().astype(float) for name in names}


def _check_count(count: int, most: int) -> None:
    if count > most:
        raise InputError(f"{count} numbers, expected at most {most} in a file of its size")


def in_json(value: object) -> object:
    """Convert a value for JSON: arrays to lists, numbers that are not finite to null.

    >>> in_json({"zeta": (0.7, float("nan"))})
    {'zeta': [0.7, None]}
    """
    if isinstance(value, Mapping):
        return {key: in_json(inner) for key, inner in value.items()}
    import numpy as np

    if isinstance(value, np.ndarray | np.generic):
        return in_json(value.tolist())
    if isinstance(value, list | tuple):
        return [in_json(inner) for inner in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
