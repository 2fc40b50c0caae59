"""Texts of files as literal Markdown."""

import re


def escaped(value: object) -> str:
    """Return Markdown that shows a text literally, in one line.

    >>> escaped("a_b [x](y) [N m]")
    'a_b \\\\[x\\\\](y) [N m]'
    """
    text = re.sub(r"\s*[\r\n]\s*", " ", str(value).strip())
    return _SPECIAL.sub(lambda m: m["unit"] or f"{m['number'] or ''}\\{m['mark'] or ''}", text)


_SPECIAL = re.compile(
    r"(?P<unit>\[[\w/²³°%., -]{1,40}\](?![\[(:]))|^(?P<number>\d{1,9})(?=[.)](?:\s|$))"
    r"|(?P<mark>[\\`*|~$\[\]]|(?<![^\W_])_|_(?![^\W_])|<(?=[A-Za-z/!?])|&(?=[#A-Za-z])|(?<!\S)#"
    r"|^>|^[-+=](?=[-+=\s]|$))"
)
