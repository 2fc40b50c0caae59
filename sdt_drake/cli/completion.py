"""Completion by the shell, with argcomplete: commands, options, files, and names of what ships."""

from __future__ import annotations

import argparse
import os
from functools import partial
from typing import Any

from sdt_drake.io.errors import needing
from sdt_drake.io.resources import SHIPPED, shipped

HOW = """Tab completes names: pip install 'sdt_drake[completion]', and in ~/.bashrc or ~/.zshrc
  eval "$(register-python-argcomplete sdt-drake)"
"""


def complete(parser: argparse.ArgumentParser) -> None:
    """Answer the shell and end, if it is what runs us."""
    if "_ARGCOMPLETE" not in os.environ:
        return
    with needing("completion", "sdt_drake[completion]"):
        import argcomplete
    add_names(parser)
    argcomplete.autocomplete(parser)


def add_names(parser: argparse.ArgumentParser) -> None:
    """Tell argcomplete the names that an argument takes: those of the kinds that it is called."""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for command in action.choices.values():
                add_names(command)
            continue
        words = " ".join([*action.option_strings, f"{action.metavar}", action.dest]).lower()
        kinds = [kind for kind in SHIPPED if kind in words]
        if kinds and action.type is None:
            complete_names = partial(_names, kinds)
            setattr(action, "completer", complete_names)  # noqa: B010, an attribute of argcomplete's


def _names(kinds: list[str], prefix: str, **_: Any) -> list[str]:
    from argcomplete.completers import FilesCompleter

    return [*shipped(*kinds), *FilesCompleter()(prefix)]
