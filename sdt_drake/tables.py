"""CSV files with named columns: `time` first, then `name_k` for joint k = 1..n."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sdt_drake.errors import InputError, replacing

Array = NDArray[np.float64]


def write_table(path: str | Path, time: Array, columns: Mapping[str, Array]) -> None:
    """Write `time` [s], shape (N,), and columns of shape (N, n), exactly (17 digits)."""
    header, blocks = ["time"], [time[:, None]]
    for name, values in columns.items():
        header += [f"{name}_{k + 1}" for k in range(values.shape[1])]
        blocks.append(values)
    rows = np.hstack(blocks).tolist()
    with replacing(Path(path)) as partial, partial.open("w", encoding="utf-8") as file:
        file.write(",".join(header) + "\n")
        # repr of a float is its shortest exact text, and quicker than a format of fixed width.
        file.writelines(",".join(map(repr, row)) + "\n" for row in rows)


def read_table(path: str | Path) -> tuple[Array, dict[str, Array]]:
    """The time column, shape (N,), and each group of columns `name_1..name_n`, shape (N, n).

    Raises:
        InputError: naming the file, and the line where there is one: no such file, no time column,
            something that is not a finite number, a row of another length, a time that does not
            grow in equal steps.
    """
    path = Path(path)
    try:
        with path.open(encoding="utf-8") as file:
            header = [name.strip() for name in file.readline().split(",")]
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", UserWarning)  # no rows: said below
                data = np.loadtxt(file, delimiter=",", ndmin=2)
    except FileNotFoundError:
        raise InputError(f"{path}: no such file") from None
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: cannot be read ({error})") from None
    except ValueError:
        raise _bad_line(path, len(header)) from None
    if not header or header[0] != "time":
        raise InputError(f"{path}: the first column is '{header[0]}', expected 'time'")
    if len(data) < 2 or data.shape[1] != len(header):
        raise _bad_line(path, len(header))
    bad = ~np.isfinite(data)
    if bad.any():
        row, column = np.argwhere(bad)[0]
        raise InputError(
            f"{path}, line {row + 2}: {header[column]} is {data[row, column]}, "
            "expected a finite number"
        )
    _check_even(path, data[:, 0])
    return data[:, 0], _grouped(path, header[1:], data[:, 1:])


def _bad_line(path: Path, width: int) -> InputError:
    """What is wrong with a file that does not read as a rectangular table of numbers."""
    with path.open(encoding="utf-8") as file:
        next(file)
        for number, line in enumerate(file, start=2):
            fields = line.split(",")
            if len(fields) != width:
                return InputError(
                    f"{path}, line {number}: {len(fields)} value(s), expected {width} as in line 1"
                )
            for field in fields:
                try:
                    float(field)
                except ValueError:
                    return InputError(f"{path}, line {number}: '{field.strip()}' is not a number")
    return InputError(f"{path}: fewer than two rows")


def _check_even(path: Path, time: Array) -> None:
    step = time[1] - time[0]
    uneven = np.abs(np.diff(time) - step) > 1e-6 * abs(step)
    if step <= 0 or uneven.any():
        row = 1 if step <= 0 else int(np.argmax(uneven)) + 1
        raise InputError(
            f"{path}, line {row + 2}: time goes from {time[row - 1]:g} to {time[row]:g} s, "
            f"expected equal steps{f' of {step:g} s' if step > 0 else ' > 0'}"
        )


def _grouped(path: Path, names: list[str], data: Array) -> dict[str, Array]:
    """Columns `name_1..name_n` as one array; they must stand side by side in that order."""
    groups: dict[str, list[int]] = {}
    for i, name in enumerate(names):
        stem, _, k = name.rpartition("_")
        group = groups.setdefault(stem, [])
        if k != str(len(group) + 1):
            raise InputError(
                f"{path}: column '{name}', expected names as v_ref_1, v_ref_2, ... in order"
            )
        group.append(i)
    return {stem: data[:, columns] for stem, columns in groups.items()}
