"""The command line `sdt-drake`."""

from __future__ import annotations

import argparse
import logging
import os
import sys
from collections.abc import Sequence
from typing import NoReturn

import sdt_drake
from sdt_drake.commands import COMMANDS
from sdt_drake.commands.common import stop_printing
from sdt_drake.errors import InputError

BAD_INPUT = 2


class _Parser(argparse.ArgumentParser):
    """Errors as one line, like those of the program itself."""

    def error(self, message: str) -> NoReturn:
        raise InputError(f"{message} (see {self.prog} --help)")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command; returns the exit code: 0, or 2 after one line about bad input."""
    if sys.stdout is None:  # closed by whoever called us
        sys.stdout = open(os.devnull, "w")  # noqa: SIM115
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="replace")  # a terminal that lacks a letter is no error
    # Drake also logs what it raises. (It sets the logger's level itself, when it is imported.)
    logging.getLogger("drake").addFilter(lambda record: False)
    try:
        options = _parser().parse_args(arguments)
        options.command(options)
        sys.stdout.flush()
    except InputError as error:
        return _refuse(str(error))
    except BrokenPipeError:
        stop_printing()
    except OSError as error:
        return _refuse(f"{error.filename or 'files'}: {error.strerror or error}")
    except KeyboardInterrupt:
        return 130
    except ImportError as error:
        if _was_interrupted(error):  # while Drake was being imported
            return 130
        raise
    return 0


def _was_interrupted(error: BaseException | None) -> bool:
    while error is not None and not isinstance(error, KeyboardInterrupt):
        error = error.__cause__
    return error is not None


def _refuse(message: str) -> int:
    print(f"sdt-drake: {' '.join(message.splitlines())}", file=sys.stderr)
    return BAD_INPUT


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="sdt-drake",
        description="Motion control of spatial disorientation trainers, in Drake.",
        epilog="example: sdt-drake reproduce --out out",
    )
    parser.add_argument("--version", action="version", version=f"sdt-drake {sdt_drake.__version__}")
    commands = parser.add_subparsers(required=True, metavar="COMMAND", parser_class=_Parser)
    for command in COMMANDS:
        command.add(commands)
    return parser
