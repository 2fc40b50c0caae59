"""Proposal of a mapping for a recording's file, from its first lines."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from sdt_drake.io.formats import BINARY
from sdt_drake.io.numbers import is_number, read_numbers
from sdt_drake.machine.recordings.columns import DECIMALS, DELIMITERS, Columns
from sdt_drake.machine.recordings.times import likely_factor

_START = 65536  # bytes that are read
_LINES = 40  # lines that are read
_MAX_RADIANS = 4 * np.pi  # larger positions are in degrees
_QUANTITIES = {  # regular expressions for names; the first that fits counts
    "torque": r"torq|tau|moment|drehm|effort|\bmom\b|\bnm\b",
    "current": r"curr|strom|\biq?\b|amp",
    "vd": r"acc|ddq|qdd|beschl|\bvd\b",
    "v": r"vel|speed|\bqd|\bdq|geschw|drehz|omega|rpm|\bv\b",
    "q": r"pos|ang|winkel|theta|\bq\b|deg|grad|joint|achs|axis|enc|ist",
}
_REFERENCE = r"soll|ref|target|\bdes|cmd|command|\bset"
_FED = r"\bff\b|feed|vorst"
_TIME = r"^(t|time|zeit|(time)?stamp|clock)\b|time|zeit"
_TIME_UNITS = {
    r"\bns\b|nano": 1e-9,
    r"\bus\b|µs|micro": 1e-6,
    r"\bms\b|milli": 1e-3,
    r"\bmin\b": 60.0,
}
_DEGREES = r"deg|grad|°"


@dataclass(frozen=True)
class _Head:
    """The beginning of a file: its format, the names of its columns, and rows of texts."""

    style: dict[str, Any]
    names: list[str]
    rows: list[list[str]]

    def numbers(self, name: str) -> np.ndarray[Any, Any]:
        """Return the numbers of a column that can be read."""
        at, mark = self.names.index(name), DECIMALS[self.style.get("decimal", "point")]
        cells = [row[at].replace(mark, ".") for row in self.rows]
        return np.array([float(cell) for cell in cells if is_number(cell)])


def proposal(path: Path, joints: Sequence[str]) -> str:
    """Return the likely meaning of a file's columns, with a mapping file in one line of YAML.

    The text is "" if no positions are recognised, or if the default mapping fits.

    Args:
        path: Path of the file.
        joints: Names of the robot's joints.
    """
    head = _head(path, len(joints))
    if head is None:
        return ""
    found = _signals(head.names, joints)
    if "q" not in found:
        return ""
    mapping, units = dict(head.style), dict.fromkeys(found, "")
    mapping |= _time(head)
    for signal, columns in found.items():
        mapping[signal] = _in_short(columns)
    words = " ".join(map(_words, found["q"]))
    largest = np.abs(head.numbers(found["q"][0])).max(initial=0)
    if re.search(_DEGREES, words) or largest > _MAX_RADIANS:
        mapping["angle"], units["q"] = "deg", " in degrees"
    if "tau" in found:
        words = _words(found["tau"][0])
        if re.search("motor", words):
            mapping["side"], units["tau"] = "motor", ", motor side"
        if _quantity(words) == "current":
            units["tau"] = ", a current, which needs torque_factor [N m/A]"
    default = Columns()
    mapping = {name: x for name, x in mapping.items() if getattr(default, name) not in (x, [x])}
    if not mapping:
        return ""
    signals = [s for s in ("q", "tau", "v") if s in found]
    likely = ", ".join(f"{s}_1 is probably '{found[s][0]}'{units[s]}" for s in signals)
    text = yaml.safe_dump(
        mapping, default_flow_style=True, width=np.inf, sort_keys=False, allow_unicode=True
    )
    return f"{likely}; as a mapping file (columns=...): {text.strip()}"


def _head(path: Path, n: int) -> _Head | None:
    """Read the beginning of a file; None if no table with more than n columns is found."""
    if path.suffix in BINARY:
        numbers = read_numbers(path)
        return _Head(
            {}, numbers.names, [list(map(repr, row)) for row in numbers.data[:_LINES].tolist()]
        )
    with path.open("rb") as file:
        start = file.read(_START)
    text, encoding = _decoded(start)
    lines = [line for line in text.splitlines() if line.strip()][:_LINES]
    style: dict[str, Any] = {"encoding": encoding} if encoding != "utf-8" else {}
    for name in ("pipe", "semicolon", "tab", "comma", "space"):
        table = [line.split(DELIMITERS[name]) for line in lines[:-1]]  # the last may be cut
        if not table or len(table[-1]) <= n:
            continue
        if any(not is_number(x) and is_number(x.replace(",", ".")) for x in table[-1]):
            style["decimal"] = "comma"
        mark = DECIMALS[style.get("decimal", "point")]
        first = sum(1 for row in table if sum(is_number(x.replace(mark, ".")) for x in row) <= n)
        if first == 0 or first == len(table) or len(table[first - 1]) < n:
            continue
        style |= {"delimiter": name, "skip": first - 1}
        names = [x.strip().strip('"').strip() for x in table[first - 1]]
        names[0] = names[0].lstrip("#").strip()
        rows = [row for row in table[first:] if len(row) >= len(names)]
        return _Head(style, names, rows) if rows else None
    return None


def _decoded(start: bytes) -> tuple[str, str]:
    """Return the text and the encoding of bytes that may end within a letter."""
    if start[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return start.decode("utf-16", errors="ignore"), "utf-16"
    try:
        return start[: start.rfind(b"\n")].decode("utf-8-sig"), "utf-8"
    except UnicodeDecodeError:
        return start.decode("latin-1"), "latin-1"


def _time(head: _Head) -> dict[str, Any]:
    """Return the column of times, and its unit by its name or its steps."""
    name = next((x for x in head.names if re.search(_TIME, _words(x))), None)
    if name is None:
        return {}
    factors = [x for unit, x in _TIME_UNITS.items() if re.search(unit, _words(name))]
    steps = np.diff(head.numbers(name))
    if not factors and len(steps) and np.median(steps) > 0:
        factors = [likely_factor(float(np.median(steps)))]
    return {"time": name, "time_factor": factors[0] if factors else 1.0}


def _signals(names: Sequence[str], joints: Sequence[str]) -> dict[str, list[str]]:
    """Return the columns of each recognised signal, one for each joint."""
    found: dict[str, list[str]] = {}
    for columns in _families(names, joints):
        words = _words(columns[0])
        signal: str | None = _quantity(words)
        if signal in ("torque", "current"):
            is_fed, is_reference = re.search(_FED, words), re.search(_REFERENCE, words)
            signal = "tau_ff" if is_fed else None if is_reference else "tau"
            if signal and re.search("mean", words):
                signal = "tau_mean"
        elif signal and re.search(_REFERENCE, words):
            signal += "_ref"
        elif signal == "vd":
            signal = None  # measured accelerations are not used
        if signal:
            found.setdefault(signal, columns)
    return found


def _families(names: Sequence[str], joints: Sequence[str]) -> Iterator[list[str]]:
    """Yield columns whose names differ only by the number or name of the joint."""
    n, families = len(joints), dict[str, dict[int, str]]()
    for name in names:
        for match in re.finditer(r"\d+", name):
            pattern = f"{name[: match.start()]}{{k}}{name[match.end() :]}"
            families.setdefault(pattern, {})[int(match[0])] = name
        for k, joint in enumerate(joints):
            if joint in name:
                families.setdefault(name.replace(joint, "{joint}"), {})[k + 1] = name
    for family in families.values():
        if sorted(family) in ([*range(1, n + 1)], [*range(n)]):
            yield [family[k] for k in sorted(family)]


def _quantity(words: str) -> str | None:
    """Return the first quantity of _QUANTITIES that fits; None if none does."""
    return next((name for name, parts in _QUANTITIES.items() if re.search(parts, words)), None)


def _words(name: str) -> str:
    """Split a name into lower-case words: "Achse1.IstPos_deg" gives "achse ist pos deg"."""
    name = re.sub(r"(?<=[a-z])(?=[A-Z])|[\W\d_]", " ", name.replace("°", " deg "))
    return re.sub(" +", " ", name.lower()).strip()


def _in_short(columns: list[str]) -> str | list[str]:
    """Return one text with {k} for columns that differ only by their number, from 1."""
    for match in re.finditer("1", columns[0]):
        pattern = f"{columns[0][: match.start()]}{{k}}{columns[0][match.end() :]}"
        if all(pattern.replace("{k}", str(k)) == x for k, x in enumerate(columns, start=1)):
            return pattern
    return columns
