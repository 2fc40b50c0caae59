"""Measure the ratios of this version, and keep them in ratios.csv in place of earlier ones of it.

    python tests/benchmarks/record.py [loop] [identify] [studies]

Ratios depend less on the machine than times, so those of releases can be compared. It takes some
ten minutes of two cores that have nothing else to do.
"""

import csv
import datetime
import sys
from importlib.metadata import version
from pathlib import Path

import bench_coupled_loop
import bench_identify
import bench_studies

from sdt_drake import __version__

FILE = Path(__file__).with_name("ratios.csv")
PARTS = {"loop": bench_coupled_loop, "identify": bench_identify, "studies": bench_studies}


def main(*parts: str) -> None:
    about = [__version__, datetime.date.today().isoformat(), version("drake")]
    new = [
        [*about, f"{part}: {name}", f"{ratio:.3g}"]
        for part in parts or PARTS
        for name, ratio in PARTS[part].main().items()
    ]
    measured = {(row[0], row[3]) for row in new}
    rows = [row for row in csv.reader(FILE.open()) if (row[0], row[3]) not in measured]
    with FILE.open("w", encoding="utf-8", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows([*rows, *new])


if __name__ == "__main__":
    main(*sys.argv[1:])
