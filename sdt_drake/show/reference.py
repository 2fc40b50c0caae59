"""The reference of all files: their fields and columns as Markdown, and JSON Schemas."""

import inspect
import json
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import NamedTuple

from sdt_drake.analysis.stopping import Stopping
from sdt_drake.io.errors import InputError
from sdt_drake.io.files import write_text
from sdt_drake.io.schema import Part, json_schema, parts
from sdt_drake.io.yaml_files import parse_yaml
from sdt_drake.machine.accept.spec import Acceptance
from sdt_drake.machine.cueing.flight import FlightColumns
from sdt_drake.machine.drive_files.drives import Drives
from sdt_drake.machine.recordings.columns import Columns
from sdt_drake.motion import MotionProfile
from sdt_drake.pilot.observer import PerceptionModel
from sdt_drake.robot.motors import Catalogue
from sdt_drake.run.controllers import CONTROLLERS, option_names
from sdt_drake.run.recording import RECORDED_COLUMNS, Recording
from sdt_drake.run.scenario import Scenario
from sdt_drake.show.sections import TEMPLATES, code, marked
from sdt_drake.studies.sizing import Sizing
from sdt_drake.studies.study import Study

FILES: Mapping[str, type] = {
    "scenario": Scenario,
    "motion": MotionProfile,
    "motors": Catalogue,
    "drives": Drives,
    "stops": Stopping,
    "acceptance": Acceptance,
    "perception": PerceptionModel,
    "study": Study,
    "sizing": Sizing,
    "columns": Columns,
    "flight": FlightColumns,
}
"""Kinds of YAML files, with the class that each file is read into."""

_FIELDS = ("field", "takes", "unit", "default", "meaning")
_BEGIN, _END = "<!-- reference: `sdt-drake docs files --out models` -->", "<!-- end -->"

SCHEMAS = "schemas"
"""The folder of the JSON Schemas, in that of the reference."""


class Sheet(NamedTuple):
    """A table of the reference."""

    title: str
    """The title; "" for the first or only table of a chapter."""
    text: str
    """An introduction."""
    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    """Rows that begin with a name and end with its meaning."""

    def details(self, row: Sequence[str]) -> str:
        """Return the cells of a row between its name and its meaning: values, unit, default."""
        cells = dict(zip(self.header[1:-1], row[1:-1], strict=True))
        unit = f"[{unit}]" if (unit := cells.pop("unit", "")) else ""
        parts = [f"{cells.pop('takes', '')} {unit}".strip()]
        parts += [f"{header} {cell}" for header, cell in cells.items() if cell]
        return "; ".join(filter(None, parts))


@dataclass(frozen=True)
class Chapter:
    """A chapter of the reference, on one kind of file."""

    title: str
    sheets: Sequence[Sheet]

    def markdown(self, anchor: Callable[[str, str], str] | None = None) -> str:
        """Return the chapter as a section of a page; `anchor` names the place of each field."""
        parts = [f"## {marked(self.title)}"]
        for sheet in self.sheets:
            rows = []
            for row in sheet.rows:
                place = f'<a id="{anchor(sheet.title, row[0])}"></a>' if anchor else ""
                rows.append(f"- {place}{code(row[0])}: {sheet.details(row)}<br>\n  {row[-1]}")
            parts += [f"### {code(sheet.title)}"] * bool(sheet.title)
            parts += [sheet.text, "\n".join(rows)]
        return "\n\n".join(parts)


def anchor(title: str, field: str) -> str:
    """Return the name of a field's place on its page of the documentation."""
    name = field if field.startswith(title) else f"{title}.{field}"
    return re.sub(r"[^\w.]+", "-", name).strip("-.")


def _fields(topic: str, title: str, note: str = "") -> Chapter:
    """Make the chapter of one of FILES."""
    first, *rest = parts(FILES[topic])
    top = Part("", f"{first.text} {note}".strip(), first.entries)
    return Chapter(title, [Sheet(*part[:2], _FIELDS, part.entries) for part in (top, *rest)])


def _recording() -> Chapter:
    (columns,) = parts(Recording)
    meaning = {entry.name: (entry.unit, entry.meaning) for entry in columns.entries}
    meaning["speed_error"] = ("rad/s, joint side", "v - v_ref.")
    text = (
        "`sdt-drake simulate SCENARIO --out run.csv` writes a recording; `pilot` and `view` read "
        "it. It has a row for each interpolation period. Column `name_k` belongs to joint k, base "
        "to tip; .parquet files have the same columns, and .mat files a matrix `name` with a "
        "column per joint. Signed errors are achieved less planned, here and everywhere in the "
        "package."
    )
    rows = [
        ("time", *meaning["time"]),
        *((f"{name}_k", *meaning[name]) for name in RECORDED_COLUMNS),
        ("probes.NAME_k", "", "Entry k of the output that a probe of the scenario names."),
    ]
    return Chapter("Recordings", [Sheet("", text, ("column", "unit", "meaning"), rows)])


def _written(topic: str) -> Chapter:
    """Read a chapter from templates/reference.yaml."""
    chapter = parse_yaml((TEMPLATES / "reference.yaml").read_text("utf-8"))[topic]
    return Chapter(chapter["title"], [Sheet(**sheet) for sheet in chapter["sheets"]])


def _controllers() -> Chapter:
    rows = []
    for name, options in CONTROLLERS.items():
        text = " ".join((inspect.getdoc(options) or "").split("\n\n")[0].split())
        plants, own = ", ".join(options.plants), ", ".join(option_names(options)) or "none"
        rows.append((name, plants, own, ", ".join(options().all_needs), text))
    text = (
        "Values of `controller.kind` in a scenario. Options are fields of `controller` that only "
        "some kinds use. Needs are the data that commissioning requires, in addition to those of "
        "a chosen feedforward."
    )
    header = ("kind", "plants", "options", "needs", "meaning")
    return Chapter("Controllers", [Sheet("", text, header, rows)])


TOPICS: Mapping[str, Callable[[], Chapter]] = {
    "scenario": partial(_fields, "scenario", "Scenarios"),
    "controllers": _controllers,
    "motion": partial(
        _fields, "motion", "Motion profiles", "A track or a joint has segments; a tag names each."
    ),
    "tables": partial(_written, "tables"),
    "recording": _recording,
    "robot": partial(_written, "robot"),
    "motors": partial(_fields, "motors", "Motors"),
    "drives": partial(_fields, "drives", "Drives"),
    "stops": partial(_fields, "stops", "Emergency stops"),
    "acceptance": partial(_fields, "acceptance", "Acceptance tests"),
    "perception": partial(_fields, "perception", "Perception models"),
    "study": partial(_fields, "study", "Studies"),
    "sizing": partial(_fields, "sizing", "Sizings"),
    "columns": partial(_fields, "columns", "Columns of other programs' recordings"),
    "flight": partial(_fields, "flight", "Columns of recorded flights"),
}


# --- files -----------------------------------------------------------------------------------


def schema_text(topic: str) -> str:
    """Return the JSON Schema of one of FILES."""
    schema = json_schema(FILES[topic], f"sdt_drake: {topic}")
    return json.dumps(schema, indent=1, ensure_ascii=False) + "\n"


def write_reference(folder: Path) -> list[Path]:
    """Write the reference into README.md and the JSON Schemas into the folder SCHEMAS.

    An existing README.md keeps its text outside the two marks.

    Raises:
        InputError: if an existing README.md has no marks.
    """
    page, old = folder / "README.md", f"# Files\n\n{_BEGIN}\n{_END}\n"
    try:  # not `read_text`: a file that is replaced is no input
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
    """Return a page with the reference of all files between its marks.

    Raises:
        InputError: if the page has no marks; the message begins with `where`.
    """
    if page.count(_BEGIN) != 1 or page.count(_END) != 1:
        raise InputError(f"{where}: expected one line {_BEGIN}, and one {_END} below it")
    text = "\n\n".join(make().markdown() for make in TOPICS.values())
    pattern = f"(?<={re.escape(_BEGIN)}).*?(?={re.escape(_END)})"
    return re.sub(pattern, lambda match: f"\n\n{text}\n\n", page, flags=re.DOTALL)
