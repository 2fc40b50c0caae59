"""Documents whose text stands in a file of pages/, made of what was computed."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from pathlib import Path

from sdt_drake.show import documents as doc


def from_template(
    text: str,
    blocks: Mapping[str, Iterable[doc.Block]],
    numbers: Mapping[str, object],
    folder: Path,
) -> doc.Document:
    """A document from Markdown with headings, paragraphs and pictures.

    Args:
        text: a paragraph {name} stands for blocks; in others {name:.2f} for a number. A picture
            may have its look as a title: ![caption](name.svg "wide").
        blocks, numbers: by these names.
        folder: of the document, with its pictures.
    """
    document = doc.Document("")
    for part in text.strip().split("\n\n"):
        part = " ".join(part.splitlines())
        own = re.fullmatch(r"\{(\w+)\}", part)
        picture = re.fullmatch(r'!\[(.*)\]\((\S*)(?: "(\w+)")?\)', part)
        if part.startswith("# "):
            document.title = part[2:].format_map(numbers)
        elif part.startswith("## "):
            document.sections.append(doc.Section(part[3:]))
        elif not document.sections:
            document.lead = part.format_map(numbers)
        elif picture:
            document.sections[-1].blocks.append(_figure(folder, *picture.groups()))
        elif own and own[1] in blocks:
            document.sections[-1].blocks += blocks[own[1]]
        elif part.startswith("### "):
            document.sections[-1].blocks.append(doc.Heading(part[4:]))
        else:
            document.sections[-1].blocks.append(doc.Text(part.format_map(numbers)))
    return document


def _figure(folder: Path, caption: str, name: str, look: str | None) -> doc.Block:
    """A picture of the folder; a block diagram, which has a .dot beside it, is wide."""
    svg = folder / name
    return doc.Figure(caption, svg, folder, look or "wide" * svg.with_suffix(".dot").exists())
