"""Marks in texts of documents, as HTML: `code`, **bold**, *emphasis*, and symbols of equations."""

from __future__ import annotations

import html
import re

_GREEK = {"omega": "ω", "zeta": "ζ", "tau": "τ"}
_SYMBOL = re.compile(
    r"(?<![A-Za-z_])(?:(omega|zeta|tau|I|K|d)_([A-Za-z0-9]+(?:,(?:max|min|\d)(?![\w]))?)"
    r"|(omega|zeta|tau)(?![A-Za-z_]))"
)


def marked(text: str, *, symbols: bool) -> str:
    """HTML of a text; code is taken as it is."""
    words, *rest = re.split(r"`([^`]*)`", html.escape(text))
    result = _marked(words, symbols)
    for code, words in zip(rest[::2], rest[1::2], strict=True):
        result += f"<code>{code}</code>{_marked(words, symbols)}"
    return result


def _marked(text: str, symbols: bool) -> str:
    text = re.sub(r"\*\*(.+?)\*\*", r"<b>\1</b>", text)
    text = re.sub(r"\*(\S[^*]*)\*", r"<i>\1</i>", text)
    return _SYMBOL.sub(_symbol, text) if symbols else text


def _symbol(match: re.Match[str]) -> str:
    """As it is printed in an equation."""
    letter, index, alone = match.groups()
    if alone:
        return _GREEK[alone]
    return f"{_GREEK.get(letter, letter)}<sub>{index}</sub>"
