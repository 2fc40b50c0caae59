"""Edits of an XML text that leave all else in it as it is: comments, order, spaces, quotes."""

import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterator
from typing import NamedTuple
from xml.parsers import expat
from xml.sax.saxutils import quoteattr


class _Place(NamedTuple):
    """The place of an element in the bytes of a text."""

    start: int
    head: int
    """End of the start tag."""
    tail: int
    """Start of the end tag; `head` if there is none, as in <a/>."""
    end: int


def edited_text(text: str, edit: Callable[[ET.Element], None]) -> str:
    """Return an XML text with edited attributes, new elements and without removed ones.

    Args:
        text: the text; its prefixes are parts of names.
        edit: a function that changes the root element in place, but no text between tags.
    """
    data = text.encode()
    root, places = _parsed(data)
    before = {element: (dict(element.attrib), list(element)) for element in places}
    edit(root)
    parts, at = [], 0
    for start, end, new in sorted(_changes(root, data, places, before)):
        parts += [data[at:start], new.encode()]
        at = end
    return b"".join([*parts, data[at:]]).decode()


def _parsed(data: bytes) -> tuple[ET.Element, dict[ET.Element, _Place]]:
    """Return the root and the places of all elements."""
    builder, reader = ET.TreeBuilder(), expat.ParserCreate()
    places: dict[ET.Element, _Place] = {}
    open_: list[tuple[ET.Element, int, int]] = []

    def start(tag: str, attributes: dict[str, str]) -> None:
        at = reader.CurrentByteIndex
        open_.append((builder.start(tag, attributes), at, _tag_end(data, at)))

    def end(tag: str) -> None:
        builder.end(tag)
        element, at, head = open_.pop()
        is_empty = data[head - 2 : head] == b"/>"
        tail = head if is_empty else reader.CurrentByteIndex
        places[element] = _Place(at, head, tail, head if is_empty else data.index(b">", tail) + 1)

    reader.StartElementHandler, reader.EndElementHandler = start, end
    reader.Parse(data, True)
    return builder.close(), places


def _tag_end(data: bytes, at: int) -> int:
    """Return the end of the tag that starts at a byte; a value in quotes may contain ">"."""
    quote = b""
    while data[at : at + 1] != b">" or quote:
        byte = data[at : at + 1]
        if byte in (b'"', b"'") and quote in (b"", byte):
            quote = b"" if quote else byte
        at += 1
    return at + 1


def _changes(
    element: ET.Element, data: bytes, places: dict[ET.Element, _Place],
    before: dict[ET.Element, tuple[dict[str, str], list[ET.Element]]],
) -> Iterator[tuple[int, int, str]]:  # fmt: skip
    """Yield start, end and new text of what changed in an element."""
    (start, head, tail, end), (attributes, children) = places[element], before[element]
    new = "".join(ET.tostring(one, encoding="unicode") for one in element if one not in places)
    is_empty = head == end
    if attributes != element.attrib or (new and is_empty):
        inner = "".join(f" {name}={quoteattr(value)}" for name, value in element.items())
        whole = f">{new}</{element.tag}>" if new else "/>"
        yield start, head, f"<{element.tag}{inner}{whole if is_empty else '>'}"
    if new and not is_empty:
        yield tail, tail, new
    kept = set(element)
    for child in children:
        if child in kept:
            yield from _changes(child, data, places, before)
        else:
            first = places[child].start
            yield len(data[:first].rstrip()), places[child].end, ""
