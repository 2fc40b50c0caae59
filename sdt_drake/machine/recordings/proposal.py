"""Proposal of a mapping for a recording's file, from its first lines."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError
from sdt_drake.machine.recordings.columns import Columns, Layout
from sdt_drake.machine.recordings.head import Head, read_head
from sdt_drake.machine.recordings.joint_names import families

MAX_RADIANS = 4 * np.pi
"""Largest position of a joint [rad]; larger ones are in degrees or of motors."""

_ALIKE = 0.9  # [-] correlation of a speed and the derivative of its position
_QUANTITIES = {  # regular expressions for names; the first that fits counts
    "torque": r"torq|tau|moment|drehm|effort|\bmom\b|\bnm\b",
    "current": r"curr|strom|\biq?\b|amp",
    "vd": r"acc|ddq|qdd|beschl|\bvd\b",
    "v": r"vel|speed|\bqd|\bdq|geschw|drehz|omega|rpm|\bv\b",
    "q": r"pos|ang|winkel|theta|\bq\b|deg|grad|joint|achs|axis|enc|ist",
}
_REFERENCE = r"soll|ref|target|\bdes|cmd|command|\bset"
_FED = r"\bff\b|feed|vorst"
_DEGREES = r"deg|grad|°"


@dataclass(frozen=True)
class Proposal:
    """The likely meaning of a file's columns."""

    words: str
    """The meaning as part of a sentence."""
    mapping: dict[str, Any]
    """Fields of a mapping that differ from the default."""
    is_in_degrees: bool = True
    """False if no name tells the unit of positions."""

    def after(self, error: InputError, reads: str = "") -> InputError:
        """Return an error with the proposal, and what it reads, after its first problem."""
        text = f"; {self.words}{reads}; as a mapping file (columns=...): {_in_a_line(self.mapping)}"
        first, *others = error.problems
        return InputError(first._replace(found=f"{first.found}{text}"), *others)


def proposal(path: Path, joints: Sequence[str]) -> Proposal | None:
    """Return the likely meaning of a file's columns.

    None if no positions are recognised, or if the default mapping fits.

    Args:
        path: Path of the file.
        joints: Names of the robot's joints.
    """
    head = read_head(path, len(joints) + 1)
    if head is None:
        return None
    time = head.likely_time()
    headless = head.style.get("header") is False
    found, named_by = (_in_blocks if headless else _signals)(head, joints, time)
    if "q" not in found:
        return None
    mapping, units = dict(head.style), dict.fromkeys(found, "")
    mapping |= time
    for signal, columns in found.items():
        mapping[signal] = columns if headless else _in_short(columns)
    words = " ".join(map(head.words, found["q"]))
    is_degrees = bool(re.search(_DEGREES, words))
    if is_degrees:
        mapping["angle"], units["q"] = "deg", " in degrees"
    if "tau" in found:
        words = head.words(found["tau"][0])
        if re.search("motor", words):
            mapping["side"], units["tau"] = "motor", ", motor side"
        if _quantity(words) == "current":
            units["tau"] = ", a current, which needs torque_factor [N m/A]"
    mapping = differing(mapping, Columns())
    if not mapping:
        return None
    signals = [s for s in ("q", "tau", "v") if s in found]
    likely = ", ".join(f"{s}_1 is probably '{found[s][0]}'{units[s]}" for s in signals)
    likely += f"; joints by their names in {named_by}" * bool(named_by)
    likely += "; columns by number, from 1, since the file has no header" * headless
    return Proposal(likely, mapping, is_degrees)


def differing(mapping: Mapping[str, Any], default: Layout) -> dict[str, Any]:
    """Return the fields of a mapping that differ from the default."""
    return {name: x for name, x in mapping.items() if getattr(default, name) not in (x, [x])}


def _in_a_line(mapping: Mapping[str, Any]) -> str:
    """Return a mapping in one line of YAML."""
    text = yaml.safe_dump(
        dict(mapping), default_flow_style=True, width=np.inf, sort_keys=False, allow_unicode=True
    )
    return text.strip()


def _signals(
    head: Head, joints: Sequence[str], time: Mapping[str, Any]
) -> tuple[dict[str, list[str]], str]:
    """Return the columns of each signal, one for each joint, and what names the joints."""
    found: dict[str, list[str]] = {}
    named_by = ""
    for family in families(head.names, head.texts, joints):
        words = head.words(family.columns[0])
        signal: str | None = _quantity(words)
        if family.pattern == "{joint}":
            signal = "q"
        if signal in ("torque", "current"):
            is_fed, is_reference = re.search(_FED, words), re.search(_REFERENCE, words)
            signal = "tau_ff" if is_fed else None if is_reference else "tau"
            if signal and re.search("mean", words):
                signal = "tau_mean"
        elif signal and re.search(_REFERENCE, words):
            signal += "_ref"
        elif signal == "vd":
            signal = None  # measured accelerations are not used
        if signal and signal not in found:
            found[signal] = family.columns
            named_by = named_by or family.named_by
    return found, named_by


def _in_blocks(
    head: Head, joints: Sequence[str], time: Mapping[str, Any]
) -> tuple[dict[str, list[str]], str]:
    """Return the columns of each signal of a file without a header, and what names the joints.

    Positions come first, torques last, and speeds in between. A block of names, as ROS 2 writes
    it, tells the joints of the blocks after it.
    """
    n, names = len(joints), head.names
    where, named_by = [*range(n)], ""
    free = [x for x in names if x not in (time.get("time"), time.get("nanoseconds"))]
    texts = [x for x in free if head.texts.get(x)]
    numbers = [x for x in free if np.isfinite(head.columns[x]).all()]
    size = n
    told = families(
        [f"name{k}" for k in range(len(texts))] + [f"q{k}" for k in range(len(texts))],
        {f"name{k}": head.texts[x] for k, x in enumerate(texts)},
        joints,
    )
    if told and told[0].named_by:
        size, where = len(texts), [int(x[1:]) for x in told[0].columns]
        named_by = f"columns {texts[0]} to {texts[-1]}"
    blocks = [numbers[i : i + size] for i in range(0, len(numbers), size)]
    blocks = [[block[k] for k in where] for block in blocks if len(block) == size]
    if not blocks:
        return {}, ""
    found = {"q": blocks.pop(0)}
    if blocks and _is_derivative(head, found["q"], blocks[0], time):
        found["v"] = blocks.pop(0)
    if blocks:
        found["tau"] = blocks[-1]
    return found, named_by


def _is_derivative(head: Head, q: Sequence[str], v: Sequence[str], time: Mapping[str, Any]) -> bool:
    """Return True if most columns are like the derivatives of others."""
    t = head.seconds(time)
    pairs = [(np.gradient(head.columns[x], t), head.columns[y]) for x, y in zip(q, v, strict=True)]
    moving: list[tuple[Array, Array]] = [(a, b) for a, b in pairs if np.ptp(a) and np.ptp(b)]
    alike = [np.corrcoef(a, b)[0, 1] > _ALIKE for a, b in moving]
    return bool(alike) and bool(np.mean(alike) > 0.5)


def _quantity(words: str) -> str | None:
    """Return the first quantity of _QUANTITIES that fits; None if none does."""
    return next((name for name, parts in _QUANTITIES.items() if re.search(parts, words)), None)


def _in_short(columns: list[str]) -> str | list[str]:
    """Return one text with {k} for columns numbered from 1, or {k0} from 0, if they are so."""
    for mark, first in (("{k}", 1), ("{k0}", 0)):
        for match in re.finditer(str(first), columns[0]):
            pattern = f"{columns[0][: match.start()]}{mark}{columns[0][match.end() :]}"
            if all(pattern.replace(mark, str(k)) == x for k, x in enumerate(columns, first)):
                return pattern
    return columns
