"""What every command of `sdt-drake` returns, prints and writes, by the table commands.yaml.

Texts are compared with the files in test_commands/; `--regen-all` renews them.
"""

import csv
import json
import re
import shlex
import zipfile
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import yaml
from helpers import command_line
from helpers.figures import check_same_text

from sdt_drake.cli import COMMANDS
from sdt_drake.machine.cueing.flight import read_flight

TABLE = yaml.safe_load(Path(__file__).with_name("commands.yaml").read_text(encoding="utf-8"))
ELBOW = re.compile("<link name='lower'>.*?</link>|<joint name='elbow'.*?</joint>")
ONE = ELBOW.sub("", command_line.ARM)
FILES = {
    "motion.csv": ["plan", "../given/pulse.yaml", "--out", "motion.csv"],
    "run.csv": ["simulate", "../given/coupled.yaml", "--out", "run.csv"],
    "arm.csv": ["simulate", "../given/arm_run.yaml", "--out", "arm.csv"],
}
"""Files that command lines read, and the command lines that write them."""
CATALOGUES = ("list", "docs files")
"""Commands whose texts are those of other files: a few lines stand for all."""


@pytest.fixture(scope="module")
def prepared_files(tmp_path_factory):
    """Files that command lines write for others, each written once, when it is first read."""
    return tmp_path_factory.mktemp("files")


@pytest.fixture
def here(desk, good, prepared_files):
    """A working directory with all files that a command line reads."""
    for name, text in {**TABLE["files"], "one.sdf": ONE}.items():
        (desk.parent / "given" / name).write_text(text, encoding="utf-8")

    def provide(line: str) -> None:
        for name in FILES.keys() & set(line.replace("bare.csv", "arm.csv").split()):
            if not (prepared_files / name).exists():
                good(*FILES[name][:-1], str(prepared_files / name))
            (desk / name).write_bytes((prepared_files / name).read_bytes())
        if "bare.csv" in line:  # of another maker: it does not say which side its torques are of
            header, *rows = command_line.read_csv(desk / "arm.csv")
            kept = [k for k, name in enumerate(header) if re.match("time|q_ref|q_|tau_[1-4]", name)]
            text = "\n".join(",".join(row[k] for k in kept) for row in (header, *rows))
            (desk / "bare.csv").write_text(text, encoding="utf-8")

    return provide


@pytest.fixture
def short_flight(desk):
    """Two seconds of the shipped flight, in load factors and degrees, with z down."""
    flight = read_flight("turn")
    own = (flight.time >= 5) & (flight.time <= 7)
    down = [1, -1, -1]
    columns = np.column_stack([
        flight.time[own], flight.specific_force[own] * [1, -1, 1] / 9.81,
        np.degrees(flight.angular_rate[own] * down),
    ])  # fmt: skip
    np.savetxt("short.csv", columns, delimiter=",", header="time,NX,NY,NZ,P,Q,R", comments="")


@pytest.mark.parametrize("name", TABLE["lines"])
def test_commands_print_and_write_as_committed(
    name, here, call, desk, undrawn, request, file_regression
):
    lines = TABLE["lines"][name]
    for line in lines:
        here(line)
    if name == "fly":
        request.getfixturevalue("short_flight")
    said = []
    for line in lines:
        before = set(desk.rglob("*"))
        done = call(*shlex.split(line))
        new = sorted(path for path in set(desk.rglob("*")) - before if path.is_file())
        shown = done.out.splitlines()[: 8 if line.startswith(CATALOGUES) else None]
        said += [f"$ sdt-drake {line}", *shown, done.err.rstrip()]
        said += [f"=> {done.code}", *(f"+ {in_short(path, desk)}" for path in new), ""]
    text = plain("\n".join(said), desk.parent)
    # With another BLAS a search ends a little beside this optimum.
    check = partial(check_same_text, share=0.02 if name == "excite" else 2e-3)
    file_regression.check(text, basename=name.replace(" ", "_"), check_fn=check)


def plain(text: str, folder) -> str:
    """Without places, ports and times."""
    text = re.sub(r"localhost:\d+", "localhost:PORT", text.replace(str(folder), "FOLDER"))
    text = re.sub(r"\S*/models/schemas", "MODELS/schemas", text)
    text = re.sub(r", \S+ per second(, \S+ \S+ left)?", "", text)
    return re.sub(r"[ \t]+$", "", text, flags=re.M)


def in_short(path, folder) -> str:
    """A file by its name, and the RMS of its columns."""
    name, columns = str(path.relative_to(folder)), {}
    if path.suffix == ".json" and path.parent == folder:
        content = json.loads(path.read_text(encoding="utf-8"))
        columns = {k: v for k, v in content.items() if isinstance(v, int | float | list)}
        columns |= content.get("columns", {})
    elif path.suffix == ".csv":
        with path.open(encoding="utf-8", newline="") as file:
            header, *rows = csv.reader(file)
        columns = dict(zip(header, zip(*rows, strict=True), strict=True))
    elif path.suffix == ".fmu":
        with zipfile.ZipFile(path) as fmu:
            count = fmu.read("modelDescription.xml").count(b'causality="input"')
        return f"{name}: {count} inputs"
    elif path.suffix == ".svg":
        count = path.read_text(encoding="utf-8").count('<g id="axes_')
        return f"{name}: {count} axes"
    elif path.name == "top.dot" or path.suffix == ".md":
        return f"{name}: {len(path.read_text(encoding='utf-8').splitlines())} lines"
    return f"{name}{': ' * bool(columns)}" + ", ".join(
        f"{label} {size(column)}" for label, column in columns.items()
    )


def size(column) -> str:
    """RMS of numbers, a number, or the first of texts."""
    try:
        values = np.array(column, dtype=float)
        return f"{np.sqrt(np.nanmean(values**2)):.3g}"
    except (TypeError, ValueError):
        return str(column[0]) if column else "-"


def test_every_command_is_in_commands_yaml():
    own = {"reproduce", "size"}  # in files of their own
    assert {line.split()[0] for lines in TABLE["lines"].values() for line in lines} | own == set(
        COMMANDS
    )
