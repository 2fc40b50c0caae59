"""Tables with named columns, as .csv, .mat or .parquet: `time` first, `name_k` for joint k."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError, needing
from sdt_drake.io.files import checked_suffix, replacing
from sdt_drake.io.formats import BINARY, TABLES, check_binary, flat, write_binary
from sdt_drake.io.numbers import Numbers, read_numbers

if TYPE_CHECKING:
    import pandas as pd


def write_table(
    path: str | Path, time: Array, columns: Mapping[str, Array], *, first: str = "time"
) -> None:
    """Write `time` [s], shape (N,), and columns of shape (N, n), exactly (17 digits).

    The suffix says how, one of TABLES. `first` is the name of the first column,
    where it is not the time.

    Raises:
        InputError: for another suffix; if the file cannot be written, or needs a package that is
            not installed.
    """
    path, whole = checked_suffix(Path(path), TABLES), {first: time, **columns}
    if path.suffix in BINARY:
        check_binary(path)
        with replacing(path) as partial:
            write_binary(partial, whole)
        return
    own = flat(whole)
    rows = np.stack(list(own.values()), axis=1).tolist()
    with replacing(path) as partial, partial.open("w", encoding="utf-8") as file:
        file.write(",".join(own) + "\n")
        # repr of a float is its shortest exact text, and quicker than a format of fixed width.
        file.writelines(",".join(map(repr, row)) + "\n" for row in rows)


def data_frame(time: Array, columns: Mapping[str, Array]) -> pd.DataFrame:
    """A table of pandas: time [s] as index, and `name_k` for joint k, of values of shape (N, n).

    Raises:
        InputError: where pandas is not installed.
    """
    with needing("to_pandas needs pandas", "sdt_drake[exchange]"):
        import pandas as pd
    return pd.DataFrame(flat(columns), index=pd.Index(time, name="time"))


def read_table(path: str | Path, *, even: bool = True) -> tuple[Array, dict[str, Array]]:
    """The time column, shape (N,), and each group of columns `name_1..name_n`, shape (N, n).

    Columns with other names are left out. The time must grow: in equal steps if `even`.

    Raises:
        InputError: naming the file, and the line where there is one: no such file, not UTF-8, no
            time column, no commas between the columns, something that is not a finite number, a
            row of another length, a time that does not grow as it must, more than MOST_BYTES.
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
    _check_time(numbers, even=even)
    return time, {name: numbers.data[:, columns] for name, columns in groups.items()}


def check_columns(
    path: str | Path, columns: Mapping[str, Array], names: Sequence[str], expected: str
) -> None:
    """Refuse columns of which some are missing, or that differ in their number of joints.

    Raises:
        InputError: naming the file, and what was expected.
    """
    for name in names:
        if name not in columns:
            raise InputError(f"{path}: no column {name}_1, expected {expected}")
    if len({columns[name].shape for name in names}) > 1:
        raise InputError(f"{path}: {', '.join(names)} differ in their number of joints")


LIMITS = {"q": (1e6, "rad"), "q_ref": (1e6, "rad"), "v": (1e4, "rad/s"), "v_ref": (1e4, "rad/s")}
"""Of angles and speeds in files, joint side: what is beyond has another unit, or is no motion."""

SHORTEST_STEP = 1e-6
"""Of time in files [s]."""


def check_limits(path: str | Path, time: Array, columns: Mapping[str, Array]) -> None:
    """Refuse angles and speeds that no joint has, and time in steps that nobody records.

    Args:
        path: of the file that holds them.
        time: in equal steps [s], shape (N,), N >= 2.
        columns: by name, shape (N, n); those that LIMITS does not name may hold anything.

    Raises:
        InputError: naming the file, the column and the time.
    """
    step = time[1] - time[0]
    if step < SHORTEST_STEP:
        raise InputError(
            f"{path}: time in steps of {step:g} s, expected at least {SHORTEST_STEP:g} s"
        )
    for name, (limit, unit) in LIMITS.items():
        beyond = np.argwhere(np.abs(columns.get(name, np.zeros((0, 0)))) > limit)
        if len(beyond):
            row, k = beyond[0]
            raise InputError(
                f"{path}: {name}_{k + 1} is {columns[name][row, k]:g} {unit} at {time[row]:g} s, "
                f"expected at most {limit:g} {unit}"
            )


def _check_time(numbers: Numbers, *, even: bool) -> None:
    time = numbers.data[:, 0]
    with np.errstate(over="ignore"):
        steps = np.diff(time)
    bad = steps <= 0
    expected = "a growing time"
    if even:
        bad |= np.abs(steps - steps[0]) > 1e-6 * abs(steps[0])
        expected = f"equal steps{f' of {steps[0]:g} s' if steps[0] > 0 else ' > 0'}"
    if bad.any():
        row = int(np.argmax(bad)) + 1
        raise InputError(
            f"{numbers.place(row)}: time goes from {time[row - 1]:g} to "
            f"{time[row]:g} s, expected {expected}"
        )


def _groups(path: Path, header: list[str]) -> dict[str, list[int]]:
    """The columns of each `name`: `name_1..name_n`, which must stand in that order."""
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
