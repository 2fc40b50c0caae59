"""Texts of block diagrams: Greek letters, subscripts, and their size."""

import html
import re
import textwrap

SIZE = 11.0
"""The size of letters [points]."""
LINE = 13.0
"""The distance of lines [points]."""

_GREEK = {"alpha": "α", "beta": "β", "zeta": "ζ", "tau": "τ", "theta": "θ", "omega": "ω"}
_SYMBOL = re.compile(rf"\b(?:([A-Za-z]\u0307?)_|({'|'.join(_GREEK)})(?:_|\b))((?:\w|,(?=\w))*)")
_SUB, _END = "\0", "\1"  # around a subscript
_NARROW, _WIDE = set("iljtfrI.,:;'|()/ "), set("mwMW%")


def in_html(text: str) -> str:
    """Return a text as Graphviz's HTML, with Greek letters and subscripts.

    >>> in_html("tau_cmd"), in_html("load_torque")
    ('τ<SUB>cmd</SUB>', 'load torque')
    """
    text = html.escape(_marked(text)).replace("\n", "<BR/>")
    return text.replace(_SUB, "<SUB>").replace(_END, "</SUB>")


def in_mathtext(line: str) -> str:
    """Return a line as matplotlib's mathtext, with Greek letters and subscripts."""
    line = _marked(line).replace("$", r"\$")
    return line.replace(_SUB, r"$_{\text{").replace(_END, "}}$")


def _marked(text: str) -> str:
    def symbol(match: re.Match[str]) -> str:
        head = match[1] or _GREEK[match[2]]
        return f"{head}{_SUB}{match[3]}{_END}" if match[3] else head

    return _SYMBOL.sub(symbol, text).replace("_", " ")


def text_size(text: str) -> tuple[float, float]:
    """Estimate width and height [points], independent of the machine's fonts."""
    lines = _SYMBOL.sub(lambda match: "x" + match[3], text).split("\n")
    return max(sum(map(_letter, line)) for line in lines) * SIZE, LINE * len(lines)


def _letter(letter: str) -> float:
    wide = 0.85 if letter in _WIDE else 0.68 if letter.isupper() else 0.56
    return 0.32 if letter in _NARROW else wide


def wrapped(name: str, width: int = 11) -> str:
    """Break a name of several words into lines of up to `width` letters."""
    if _SYMBOL.match(name):
        return name
    return textwrap.fill(name.replace("_", " "), width, break_long_words=False)
