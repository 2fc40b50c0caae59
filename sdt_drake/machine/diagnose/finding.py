"""Finding: something that a recording shows, with its evidence in numbers and in a sentence."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from string import Formatter
from typing import Any

import yaml  # a dependency of Drake


@dataclass(frozen=True)
class Finding:
    """Something that a recording shows; `str` gives it in words."""

    kind: str
    """One of the kinds in findings.yaml."""
    sentence: str
    """The finding as a sentence without its end."""
    joints: tuple[int, ...] = ()
    """The joints that show it, from 1; empty for the whole recording."""
    evidence: Mapping[str, float] = field(default_factory=dict)
    """Numbers by name [SI units in the name, else -], as the sentence tells them."""
    remedy: str = ""
    """The remedy as an entry of the mapping file; "" if there is none."""
    source: str = ""
    """Name of the recording's file; "" for a finding from several."""

    @property
    def hides(self) -> bool:
        """True if units, order and signs of the torques show only after a correction."""
        return self.kind in ("order", "degrees", "clock")

    @property
    def spoils(self) -> bool:
        """True if a fit of the recording is wrong, so that it must be corrected first."""
        return self.hides or self.kind in ("rounded", "frozen", "clipped", "unit", "columns")

    def __str__(self) -> str:
        text = f"{self.source}: {self.sentence}" if self.source else self.sentence
        return f"{text} ({self.remedy} in the mapping file)" if self.remedy else text


def finding(name: str, joints: Sequence[int] = (), remedy: str = "", /, **values: Any) -> Finding:
    """Return the finding that findings.yaml has by a name.

    Args:
        name: A kind, or "kind/case".
        joints: The joints that show it, from 1; the sentence names the first of them.
        remedy: The remedy as an entry of the mapping file.
        values: Evidence and words of the sentence by name; the numbers are the evidence.
    """
    sentence = _Words().format(kinds()[name]["sentence"], joint=[*joints, 0][0], **values)
    evidence = {x: y for x, y in values.items() if not isinstance(y, str)}
    return Finding(name.partition("/")[0], sentence, tuple(joints), evidence, remedy)


@cache
def kinds() -> Any:
    """Return the content of findings.yaml: kinds and cases by name, with sentences."""
    return yaml.safe_load(Path(__file__).with_name("findings.yaml").read_text(encoding="utf-8"))


class _Words(Formatter):
    def format_field(self, value: Any, spec: str) -> str:
        if spec.endswith("%"):
            spec = spec[:-1] if spec[-2:-1].isalpha() else f"{spec[:-1]}f"
            return f"{100 * value:{spec}} %"
        return f"{1e3 * value:{spec[:-1]}}" if spec.endswith("m") else f"{value:{spec}}"
