"""Texts of `templates/`, of which pages and reports are made."""

from __future__ import annotations

import json
from pathlib import Path

_TEMPLATES = Path(__file__).with_name("templates")


def page_text(name: str) -> str:
    """Read a text of `templates/`."""
    return (_TEMPLATES / name).read_text(encoding="utf-8")


def json_in_page(value: object) -> str:
    """Write data as JSON for a script in a page; "<" is escaped, as "</script" ends a script."""
    return json.dumps(value, separators=(",", ":")).replace("<", "\\u003c")
