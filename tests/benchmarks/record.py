"""Measure the ratios of this version, and keep them in ratios.csv in place of earlier ones of it.

    python tests/benchmarks/record.py [FILE]

Ratios depend less on the machine than times, so those of releases can be compared. It takes some
ten minutes of two cores that have nothing else to do.
"""

from __future__ import annotations

import csv
import datetime
import sys
from importlib.metadata import version
from pathlib import Path

import bench_coupled_loop
import bench_identify
import bench_studies

from sdt_drake import __version__


def main(file: str | Path = Path(__file__).with_name("ratios.csv")) -> None:
    parts = {"loop": bench_coupled_loop, "identify": bench_identify, "studies": bench_studies}
    ratios = {f"{part}: {name}": x for part in parts for name, x in parts[part].main().items()}
    head, *rows = csv.reader(Path(file).read_text(encoding="utf-8").splitlines())
    kept = [row for row in rows if row[0] != __version__]
    about = [__version__, datetime.date.today().isoformat(), version("drake")]
    new = [[*about, name, f"{ratio:.3g}"] for name, ratio in ratios.items()]
    with open(file, "w", encoding="utf-8", newline="") as out:
        csv.writer(out, lineterminator="\n").writerows([head, *kept, *new])


if __name__ == "__main__":
    main(*sys.argv[1:])
