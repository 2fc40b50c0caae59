"""The reference of all files: what each may hold, for people and for editors."""

from __future__ import annotations

import inspect
import json
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import astuple, dataclass, fields
from pathlib import Path
from typing import NamedTuple

from sdt_drake.analysis.document import Block, Heading, Table, Text, write_text
from sdt_drake.controllers import CONTROLLERS, Controller
from sdt_drake.device import Catalogue
from sdt_drake.drive_files import Drives
from sdt_drake.errors import InputError
from sdt_drake.identification.recordings import Columns
from sdt_drake.motion import MotionProfile
from sdt_drake.scenario import Scenario
from sdt_drake.schema import Part, entry_of, json_schema, parts
from sdt_drake.simulate import COLUMNS, Recording
from sdt_drake.studies.sizing import Sizing
from sdt_drake.studies.study import Study

FILES: Mapping[str, type] = {
    "scenario": Scenario,
    "motion": MotionProfile,
    "motors": Catalogue,
    "drives": Drives,
    "study": Study,
    "sizing": Sizing,
    "columns": Columns,
}
"""YAML files: what each is an object of."""

_FIELDS = ("field", "takes", "unit", "default", "meaning")
_BEGIN, _END = "<!-- reference: `sdt-drake reference --out models` -->", "<!-- end -->"

SCHEMAS = "schemas"
"""Folder of the JSON Schemas, beside that of the reference."""


class Sheet(NamedTuple):
    """A table: its title, "" for the only one or the first; what it is; the first cell of a row
    names it, the last one says what it means."""

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
        """As a section of a page."""
        blocks: list[Block] = []
        for title, text, header, rows in self.sheets:
            named = [[f"`{name}`", *cells] for name, *cells in rows]
            blocks += [Heading(f"`{title}`")] * bool(title)
            blocks += [Text(text), Table(header, named)]
        return "\n\n".join([f"## {self.title}", *(block.markdown() for block in blocks)])


def _file(topic: str, title: str, note: str = "") -> Callable[[], Chapter]:
    def of_fields() -> Chapter:
        first, *rest = parts(FILES[topic])
        top = Part("", f"{first.text} {note}".strip(), first.entries)
        return Chapter(title, [_fields(part) for part in (top, *rest)])

    return of_fields


def _fields(part: Part) -> Sheet:
    return Sheet(part.title, part.text, _FIELDS, [astuple(entry) for entry in part.entries])


def _columns(title: str, text: str, columns: Sequence[tuple[str, str, str]]) -> Sheet:
    """Of a CSV file; all but the time are there for each joint."""
    rows = [(name + "_k" * (name != "time"), *rest) for name, *rest in columns]
    return Sheet(title, text, ("column", "unit", "meaning"), rows)


def _recording() -> Chapter:
    entries = {field.name: entry_of(Recording, field) for field in fields(Recording)}
    columns = {name: (name, entry.unit, entry.meaning) for name, entry in entries.items()}
    columns["speed_error"] = ("speed_error", "rad/s, joint side", "v - v_ref.")
    text = (
        "What `simulate --out run.csv` writes and `pilot` and `view` read: a row for each period. "
        "Column `name_k` is joint k, base to tip; of .parquet, too, and column k of `name` in .mat."
    )
    rows = [columns[name] for name in ("time", *COLUMNS)]
    return Chapter("Recordings", [_columns("", text, rows)])


_TIME = ("time", "s", "from 0 on, in equal steps")
_PLANNED = (
    _TIME,
    ("q_ref", "rad, joint side", "position"),
    ("v_ref", "rad/s, joint side", "speed; positions are its integral"),
    ("vd_ref", "rad/s², joint side", "acceleration, which holds until the next row"),
)
_FOR_DRIVES = (
    _TIME,
    ("q_motor", "rad, motor side", "position, gear ratio times that of the joint"),
    ("v_motor", "rad/s, motor side", "speed, likewise"),
    ("tau_motor", "N m, motor side", "whole torque, that for the motor's own inertia included"),
)


def _tables() -> Chapter:
    planned = (
        "A planned motion: `plan --out motion.csv` writes it, `motion` of a scenario takes it. A "
        "row for each period; with another period it is resampled."
    )
    drives = "For the drives: `plan --drive-table drive.csv`. A row holds until the next one."
    sheets = [
        _columns("motion.csv", planned, _PLANNED),
        _columns("drive.csv", drives, _FOR_DRIVES),
    ]
    return Chapter("Tables of a motion", sheets)


# Element of an SDF, what it takes, unit and side, default, meaning; "" must be given.
ELEMENTS = (
    ("model", "name", "", "", "the robot: one chain of joints from the world to the tip"),
    ("link", "name", "", "", "`payload` is needed where a payload is changed, or scaled around"),
    ("link/inertial/mass", "a number >= 0", "kg", "", "0 where its joint has others to move"),
    ("link/inertial/pose", "6 numbers", "m, rad", "0", "of the centre of mass, in the link"),
    (
        "link/inertial/inertia/ixx",
        "a number",
        "kg m²",
        "",
        "about the centre of mass, likewise iyy and izz; ixy, ixz, iyz are 0 by default",
    ),
    ("joint", "revolute or fixed", "", "", "its name, `<parent>` and `<child>`"),
    ("link/pose", "6 numbers", "m, rad", "0", "x, y, z and roll, pitch, yaw, in the model"),
    ("joint/pose", "6 numbers", "m, rad", "0", "likewise, in the child link"),
    ("joint/axis/xyz", "3 numbers", "-", "", "direction about which the joint turns"),
    ("joint/axis/limit/effort", "a number > 0", "N m, joint side", "", "largest torque"),
    ("joint/axis/limit/velocity", "a number > 0", "rad/s, joint side", "none", "largest speed"),
    (
        "joint/axis/limit/drake:acceleration",
        "a number > 0",
        "rad/s², joint side",
        "none",
        "largest acceleration",
    ),
    ("joint/axis/limit/lower", "a number", "rad, joint side", "none", "stop, of the planner"),
    ("joint/axis/limit/upper", "a number", "rad, joint side", "none", "stop, of the planner"),
    (
        "joint/axis/dynamics/damping",
        "a number >= 0",
        "N m s/rad, joint side",
        "0",
        "viscous friction of the joint",
    ),
    ("joint/drake:rotor_inertia", "a number >= 0", "kg m², motor side", "0", "motor and gearbox"),
    ("joint/drake:gear_ratio", "a number > 0", "-", "1", "motor speed over joint speed"),
    ("frame", "name", "", "none", "`head`: where the pilot's head is; x forward, z up"),
)


def _robot() -> Chapter:
    text = (
        "SDF (1.x) elements that are read. Of a URDF, the same: `<inertial>`, `<limit>`, "
        "`<dynamics>` and, within `<transmission>`, `<drake:rotor_inertia>`, `<drake:gear_ratio>` "
        "or `<mechanicalReduction>`. Shapes are left out; elements that would be misread, or have "
        "no effect, are refused."
    )
    header = ("element", *_FIELDS[1:])
    return Chapter("Robots", [Sheet("", text, header, ELEMENTS)])


def _controllers() -> Chapter:
    rows = []
    for kind, controller in CONTROLLERS.items():
        text = " ".join((inspect.getdoc(controller) or "").split("\n\n")[0].split())
        plants, options = ", ".join(controller.plants), ", ".join(controller.options) or "none"
        needs = ", ".join(controller.needs_with(controller.feedforward))
        rows.append((kind, plants, options, needs, text))
    text = (
        "What `controller.kind` of a scenario names. Options are fields of `controller` that only "
        f"some take, of {', '.join(Controller.OPTIONS)}; needs, what must be known to commission "
        "it, beside what a chosen feedforward needs."
    )
    header = ("kind", "plants", "options", "needs", "meaning")
    return Chapter("Controllers", [Sheet("", text, header, rows)])


TOPICS: Mapping[str, Callable[[], Chapter]] = {
    "scenario": _file("scenario", "Scenarios"),
    "controllers": _controllers,
    "motion": _file("motion", "Motion profiles", "A track or a joint has segments, each a tag."),
    "tables": _tables,
    "recording": _recording,
    "robot": _robot,
    "motors": _file("motors", "Motors"),
    "drives": _file("drives", "Drives"),
    "study": _file("study", "Studies"),
    "sizing": _file("sizing", "Sizings"),
    "columns": _file("columns", "Columns of recordings of others"),
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
