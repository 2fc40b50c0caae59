"""Tables as .csv, .mat or .parquet: first column `time`, column `name_k` for joint k."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType

import numpy as np

from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError, needing
from sdt_drake.io.files import checked_suffix, replacing
from sdt_drake.io.formats import BINARY, TABLES, check_binary, flat, write_binary
from sdt_drake.io.numbers import read_numbers
from sdt_drake.io.shown import DataFrame


def write_table(
    path: str | Path,
    time: Array,
    columns: Mapping[str, Array],
    *,
    first: str = "time",
    units: Mapping[str, str] = MappingProxyType({}),
) -> None:
    """Write a table exactly (17 digits), as .csv, .mat or .parquet.

    Args:
        path: the file; its suffix is one of TABLES.
        time: values of the first column [s], shape (N,).
        columns: columns by name, each of shape (N, n).
        first: name of the first column.
        units: units of columns by name, several for equal parts of n; .csv files have none.

    Raises:
        InputError: another suffix, a file that cannot be written, or a missing package.
    """
    path, whole = checked_suffix(Path(path), TABLES), {first: time, **columns}
    if path.suffix in BINARY:
        check_binary(path)
        with replacing(path) as partial:
            write_binary(partial, whole, units)
        return
    own = flat(whole)
    rows = np.stack(list(own.values()), axis=1).tolist()
    with replacing(path) as partial, partial.open("w", encoding="utf-8") as file:
        file.write(",".join(own) + "\n")
        # repr of a float is its shortest exact text, and faster than a fixed format.
        file.writelines(",".join(map(repr, row)) + "\n" for row in rows)


def data_frame(time: Array, columns: Mapping[str, Array]) -> DataFrame:
    """Make a pandas table with time [s] as index and a column `name_k` for joint k.

    Args:
        time: shape (N,).
        columns: columns by name, each of shape (N, n).

    Raises:
        InputError: pandas is not installed.
    """
    with needing("to_pandas needs pandas", "sdt_drake[exchange]"):
        import pandas as pd
    return pd.DataFrame(flat(columns), index=pd.Index(time, name="time"))


def read_table(path: str | Path, *, even: bool = True) -> tuple[Array, dict[str, Array]]:
    """Read a table: the time column, shape (N,), and groups `name_1..name_n`, shape (N, n).

    Columns with other names are ignored. The time must increase, in equal steps if `even`.

    Raises:
        InputError: no such file, no UTF-8, no time column, another delimiter, a value that is not
            finite, a row of another length, wrong time steps, or more than MAX_BYTES. The message
            has the file and the line.
    """
    numbers = read_numbers(path)
    path, names = numbers.path, numbers.names
    if names[0] != "time":
        raise InputError(f"{path}: the first column is '{names[0]}', expected 'time'")
    if "time" in names[1:]:
        raise InputError(f"{path}: two columns are 'time', expected one")
    groups = _groups(path, names)
    numbers.check_finite([0, *(c for group in groups.values() for c in group)])
    time = numbers.data[:, 0]
    steps = np.diff(time)
    bad, expected = steps <= 0, "a growing time"
    if even:
        bad |= np.abs(steps - steps[0]) > 1e-6 * abs(steps[0])
        expected = f"equal steps{f' of {steps[0]:g} s' if steps[0] > 0 else ' > 0'}"
    if bad.any():
        row = int(np.argmax(bad)) + 1
        raise InputError(
            f"{numbers.place(row)}: time goes from {time[row - 1]:g} to "
            f"{time[row]:g} s, expected {expected}"
        )
    return time, {name: numbers.data[:, columns] for name, columns in groups.items()}


def check_columns(
    path: str | Path, columns: Mapping[str, Array], names: Sequence[str], expected: str
) -> None:
    """Check that columns exist and have the same number of joints.

    Raises:
        InputError: a missing column, or different numbers of joints.
    """
    for name in names:
        if name not in columns:
            raise InputError(f"{path}: no column {name}_1, expected {expected}")
    if len({columns[name].shape for name in names}) > 1:
        raise InputError(f"{path}: {', '.join(names)} differ in their number of joints")


LIMITS = {"q": (1e6, "rad"), "q_ref": (1e6, "rad"), "v": (1e4, "rad/s"), "v_ref": (1e4, "rad/s")}
"""Largest angles and speeds in files, joint side. Larger ones have another unit, or are errors."""

MIN_STEP = 1e-6
"""Smallest step of the time in files [s]."""


def check_limits(path: str | Path, time: Array, columns: Mapping[str, Array]) -> None:
    """Check that angles, speeds and time steps are within limits.

    Args:
        path: the file, for messages.
        time: time in equal steps [s], shape (N,), N >= 2.
        columns: columns by name, shape (N, n). Only those in LIMITS are checked.

    Raises:
        InputError: a value beyond its limit; the message has the column and the time.
    """
    step = time[1] - time[0]
    if step < MIN_STEP:
        raise InputError(f"{path}: time in steps of {step:g} s, expected at least {MIN_STEP:g} s")
    for name, (limit, unit) in LIMITS.items():
        beyond = np.argwhere(np.abs(columns.get(name, np.zeros((0, 0)))) > limit)
        if len(beyond):
            row, k = beyond[0]
            raise InputError(
                f"{path}: {name}_{k + 1} is {columns[name][row, k]:g} {unit} at {time[row]:g} s, "
                f"expected at most {limit:g} {unit}"
            )


def _groups(path: Path, header: list[str]) -> dict[str, list[int]]:
    """Return the indices of the columns `name_1..name_n` by name, and check their order."""
    groups: dict[str, list[int]] = {}
    for column, name in enumerate(header):
        stem, _, k = name.rpartition("_")
        if not (stem and k.isdecimal()):
            continue
        group = groups.setdefault(stem, [])
        if k != str(len(group) + 1):
            before = header[column - 1].rpartition("_")[0]
            if not group and before in groups and k == str(len(groups[before]) + 1):
                stem = before  # `v_1, v_2, w_3` misspells v_3
            expected = f"{stem}_{len(groups[stem]) + 1}"
            raise InputError(f"{path}: column '{name}', expected '{expected}'")
        group.append(column)
    return groups
