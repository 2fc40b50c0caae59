"""Texts in a picture: Greek letters, subscripts, and how wide they are."""

from __future__ import annotations

import html
import re
import textwrap

FACE = "Helvetica,Arial,sans-serif"
SIZE = 11.0  # points
LINE = 13.0  # points from one line to the next

_GREEK = {"alpha": "α", "beta": "β", "zeta": "ζ", "tau": "τ", "theta": "θ", "omega": "ω"}
_SYMBOL = re.compile(rf"\b(?:([A-Za-z])_|({'|'.join(_GREEK)})(?:_|\b))((?:\w|,(?=\w))*)")
_NARROW, _WIDE = set("iljtfrI.,:;'|()/ "), set("mwMW%")


def rich(text: str) -> str:
    """A text for Graphviz, with Greek letters and subscripts: tau_cmd, K_IS, load_torque."""

    def symbol(match: re.Match[str]) -> str:
        head = match[1] or _GREEK[match[2]]
        return f"{head}\0{match[3].replace('_', ' ')}\1" if match[3] else head

    text = html.escape(_SYMBOL.sub(symbol, text).replace("_", " "))
    return text.replace("\0", "<SUB>").replace("\1", "</SUB>").replace("\n", "<BR/>")


def text_size(text: str) -> tuple[float, float]:
    """Width and height [points], the same whatever fonts are there."""
    lines = _SYMBOL.sub(lambda match: "x" + match[3], text).split("\n")
    return max(sum(map(_letter, line)) for line in lines) * SIZE, LINE * len(lines)


def _letter(letter: str) -> float:
    wide = 0.85 if letter in _WIDE else 0.68 if letter.isupper() else 0.56
    return 0.32 if letter in _NARROW else wide


def wrapped(name: str, width: int = 11) -> str:
    """A name in lines of up to `width` letters, where it is of several words."""
    if _SYMBOL.match(name):
        return name
    return textwrap.fill(name.replace("_", " "), width, break_long_words=False)
