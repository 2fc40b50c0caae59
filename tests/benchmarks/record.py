"""Measure the ratios of this version, and keep them in ratios.csv in place of earlier ones of it.

    python tests/benchmarks/record.py [loop] [identify] [studies] [suspicions] [mutants] [online]

Ratios depend less on the machine than times, so those of releases can be compared. It takes some
ten minutes of two cores that have nothing else to do; suspicions, three minutes, online,
six, and mutants, a quarter of an hour, are tried if they are asked for.
"""

import csv
import datetime
import sys
from importlib import import_module
from importlib.metadata import version
from pathlib import Path

from sdt_drake import __version__

FILE = Path(__file__).with_name("ratios.csv")
BY_DEFAULT = ("loop", "identify", "studies")
BENCHMARKS = {"loop": "coupled_loop"}  # the others have the names of their parts


def main(*parts: str) -> None:
    about = [__version__, datetime.date.today().isoformat(), version("drake")]
    new = [
        [*about, f"{part}: {name}", f"{ratio:.3g}"]
        for part in parts or BY_DEFAULT
        for name, ratio in import_module(f"bench_{BENCHMARKS.get(part, part)}").main().items()
    ]
    measured = {(row[0], row[3]) for row in new}
    rows = [row for row in csv.reader(FILE.open()) if (row[0], row[3]) not in measured]
    with FILE.open("w", encoding="utf-8", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows([*rows, *new])


if __name__ == "__main__":
    main(*sys.argv[1:])
