"""The reference of all files: what each may hold, for people and for editors."""

from __future__ import annotations

import inspect
import json
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import NamedTuple

from sdt_drake.io.errors import InputError
from sdt_drake.io.files import write_text
from sdt_drake.io.schema import Part, json_schema, parts
from sdt_drake.io.yaml_files import parse_yaml
from sdt_drake.machine.drive_files import Drives
from sdt_drake.machine.fly.flight import FlightColumns
from sdt_drake.machine.recordings import Columns
from sdt_drake.motion import MotionProfile
from sdt_drake.robot.motors import Catalogue
from sdt_drake.run.controllers import controller_class
from sdt_drake.run.kinds import CONTROLLERS, OPTIONS
from sdt_drake.run.scenario import Scenario
from sdt_drake.run.simulate import RECORDED_COLUMNS, Recording
from sdt_drake.show.documents import TEMPLATES, render
from sdt_drake.studies.sizing import Sizing
from sdt_drake.studies.study import Study
from sdt_drake.systems.orientation import PerceptionModel

FILES: Mapping[str, type] = {
    "scenario": Scenario,
    "motion": MotionProfile,
    "motors": Catalogue,
    "drives": Drives,
    "perception": PerceptionModel,
    "study": Study,
    "sizing": Sizing,
    "columns": Columns,
    "flight": FlightColumns,
}
"""YAML files: what each is an object of."""

_FIELDS = ("field", "takes", "unit", "default", "meaning")
_BEGIN, _END = "<!-- reference: `sdt-drake reference --out models` -->", "<!-- end -->"

SCHEMAS = "schemas"
"""Folder of the JSON Schemas, beside that of the reference."""


class Sheet(NamedTuple):
    """A table of the reference: its title, "" for the only one or the first; what it is; the first
    cell of a row names it, the last one says what it means."""

    title: str
    text: str
    header: Sequence[str]
    rows: Sequence[Sequence[str]]


@dataclass(frozen=True)
class Chapter:
    """A kind of file: its title and its tables."""

    title: str
    sheets: Sequence[Sheet]

    def markdown(self) -> str:
        """The chapter as a section of a page."""
        return render("reference.md.j2", chapter=self).strip()


def _fields(topic: str, title: str, note: str = "") -> Chapter:
    """Of a kind of file, one of FILES."""
    first, *rest = parts(FILES[topic])
    top = Part("", f"{first.text} {note}".strip(), first.entries)
    return Chapter(title, [Sheet(*part[:2], _FIELDS, part.entries) for part in (top, *rest)])


def _recording() -> Chapter:
    (columns,) = parts(Recording)
    told = {entry.name: (entry.unit, entry.meaning) for entry in columns.entries}
    told["speed_error"] = ("rad/s, joint side", "v - v_ref.")
    text = (
        "What `simulate --out run.csv` writes and `pilot` and `view` read: a row for each period. "
        "Column `name_k` is joint k, base to tip; of .parquet, too, and column k of `name` in .mat."
        " Errors with a sign are achieved less wanted, here and wherever the package tells one."
    )
    rows = [("time", *told["time"]), *((f"{name}_k", *told[name]) for name in RECORDED_COLUMNS)]
    return Chapter("Recordings", [Sheet("", text, ("column", "unit", "meaning"), rows)])


def _written(topic: str) -> Chapter:
    """A chapter that stands in pages/reference.yaml."""
    chapter = parse_yaml((TEMPLATES / "reference.yaml").read_text("utf-8"))[topic]
    return Chapter(chapter["title"], [Sheet(**sheet) for sheet in chapter["sheets"]])


def _controllers() -> Chapter:
    rows = []
    for name, kind in CONTROLLERS.items():
        text = " ".join((inspect.getdoc(controller_class(name)) or "").split("\n\n")[0].split())
        plants, options = ", ".join(kind.plants), ", ".join(kind.options) or "none"
        needs = ", ".join(kind.needs_with(kind.feedforward))
        rows.append((name, plants, options, needs, text))
    text = (
        "What `controller.kind` of a scenario names. Options are fields of `controller` that only "
        f"some take, of {', '.join(OPTIONS)}; needs, what must be known to commission "
        "it, beside what a chosen feedforward needs."
    )
    header = ("kind", "plants", "options", "needs", "meaning")
    return Chapter("Controllers", [Sheet("", text, header, rows)])


TOPICS: Mapping[str, Callable[[], Chapter]] = {
    "scenario": partial(_fields, "scenario", "Scenarios"),
    "controllers": _controllers,
    "motion": partial(
        _fields, "motion", "Motion profiles", "A track or a joint has segments, each a tag."
    ),
    "tables": partial(_written, "tables"),
    "recording": _recording,
    "robot": partial(_written, "robot"),
    "motors": partial(_fields, "motors", "Motors"),
    "drives": partial(_fields, "drives", "Drives"),
    "perception": partial(_fields, "perception", "Perception models"),
    "study": partial(_fields, "study", "Studies"),
    "sizing": partial(_fields, "sizing", "Sizings"),
    "columns": partial(_fields, "columns", "Columns of recordings of others"),
    "flight": partial(_fields, "flight", "Columns of recordings of flights"),
}


# --- files -----------------------------------------------------------------------------------


def schema_text(topic: str) -> str:
    """The JSON Schema of a kind of file; one of FILES."""
    schema = json_schema(FILES[topic], f"sdt_drake: {topic}")
    return json.dumps(schema, indent=1, ensure_ascii=False) + "\n"


def write_reference(folder: Path) -> list[Path]:
    """Write README.md, between its marks if it is there, and the JSON Schemas below SCHEMAS.

    Raises:
        InputError: for a README.md without the marks.
    """
    page, old = folder / "README.md", f"# Files\n\n{_BEGIN}\n{_END}\n"
    try:  # no input: it is replaced
        old = page.read_text(encoding="utf-8")
    except FileNotFoundError:
        pass
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{page}: cannot be read ({error})") from None
    written = [write_text(page, with_reference(old, page))]
    for topic in FILES:
        written.append(write_text(folder / SCHEMAS / f"{topic}.json", schema_text(topic)))
    return written


def with_reference(page: str, where: str | Path) -> str:
    """A page with the reference of all files between its marks.

    Raises:
        InputError: naming `where`, if it has no marks.
    """
    if page.count(_BEGIN) != 1 or page.count(_END) != 1:
        raise InputError(f"{where}: expected one line {_BEGIN}, and one {_END} below it")
    text = "\n\n".join(make().markdown() for make in TOPICS.values())
    pattern = f"(?<={re.escape(_BEGIN)}).*?(?={re.escape(_END)})"
    return re.sub(pattern, lambda match: f"\n\n{text}\n\n", page, flags=re.DOTALL)
