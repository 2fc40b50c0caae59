"""The command line `sdt-drake`."""

from __future__ import annotations

import argparse
import contextlib
import importlib
import logging
import os
import shlex
import sys
import traceback
import warnings
from collections.abc import Sequence
from typing import NoReturn

import sdt_drake
from sdt_drake.cli import COMMANDS
from sdt_drake.cli.bar import bar
from sdt_drake.cli.common import check_out, stop_printing
from sdt_drake.cli.completion import HOW, complete
from sdt_drake.io.errors import InputError
from sdt_drake.io.files import keeping_inputs
from sdt_drake.io.progress import watching

BAD_INPUT, FAULT, INTERRUPTED = 2, 70, 130

_ORDER = """What a command works on stands alone: a SCENARIO, MOTION, RECORDING or ROBOT; what it
needs beside that follows the name of an option: --scenario, --robot, --drive, --study."""

_LONGEST = 1000  # letters of a line about an error


class _Parser(argparse.ArgumentParser):
    """Errors as one line, like those of the program itself."""

    def error(self, message: str) -> NoReturn:
        raise InputError(f"{message} (see {self.prog} --help)")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command of the command line.

    Returns:
        The exit code: 0; 1 if runs of a study failed; after one line 2 for bad input, and 70 for
        what nobody foresaw; 130 if interrupted.
    """
    arguments = sys.argv[1:] if arguments is None else arguments
    _prepare_streams()
    code = 0
    lines: Sequence[str] = ()
    bar.begin()
    try:
        with watching(bar.tell) if bar.has_terminal else contextlib.nullcontext():
            code = _run(arguments)
    except KeyboardInterrupt:
        code = INTERRUPTED
    except InputError as error:
        code, lines = BAD_INPUT, error.lines
    except BrokenPipeError:
        pass  # whoever reads us has enough
    except OSError as error:
        code, lines = BAD_INPUT, [f"{error.filename or 'output'}: {error.strerror or error}"]
    except Exception as error:
        if isinstance(error.__context__, KeyboardInterrupt):
            return INTERRUPTED
        if "--traceback" in arguments:
            traceback.print_exc()
        fault = f"fault of the program, {type(error).__name__} ({error})"
        where = f"sdt-drake {shlex.join(arguments)}; --traceback shows where"
        code, lines = FAULT, [f"{fault}, in: {where}"]
    for line in lines:
        _print_error(line)
    for stream in (sys.stdout, sys.stderr):
        try:
            bar.end()
            stream.flush()
        except OSError:
            stop_printing(stream)
    return code


def _run(arguments: Sequence[str]) -> int:
    code = 0
    with keeping_inputs(), warnings.catch_warnings(record=True) as caught:
        try:
            parser = _parser([name for name in COMMANDS if name in arguments[:1]] or COMMANDS)
            complete(parser)
            options, unknown = parser.parse_known_args(arguments)
            if unknown:
                options.parser.error(f"unrecognized arguments: {' '.join(unknown)}")
            _check_surroundings(options)
            if "kinds" in options:
                check_out(options)
            options.command(options)
        except SystemExit as end:  # of --help with 0, of a study that failed with 1
            code = int(end.code or 0)
        sys.stdout.flush()
    for warning in caught:  # of libraries; where something went wrong, the error says it better
        _print_error(f"warning: {warning.message}")
    return code


def _check_surroundings(options: argparse.Namespace) -> None:
    try:
        os.getcwd()
        if getattr(options, "show", False):
            import matplotlib
        else:
            os.environ["MPLBACKEND"] = "agg"  # whatever a notebook has set: no screen is needed
    except FileNotFoundError:
        raise InputError("the current folder is gone, expected one that is there") from None
    except ValueError as error:
        raise InputError(f"$MPLBACKEND: {error}") from None


def _prepare_streams() -> None:
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="replace")  # a terminal that lacks a letter is no error
    # Drake also logs what it raises. (It sets the logger's level itself, when it is imported.)
    logging.getLogger("drake").addFilter(lambda record: False)
    logging.getLogger("matplotlib").setLevel(logging.ERROR)  # no folder for its cache, for one


def _print_error(message: str) -> None:
    """One line, which fits into a terminal and does nothing to it."""
    text = " ".join(message.split())
    if len(text) > _LONGEST:
        text = f"{text[: _LONGEST // 2]} ... {text[-_LONGEST // 2 :]}"
    letters = (x if x.isprintable() else x.encode("unicode_escape").decode() for x in text)
    with contextlib.suppress(OSError):  # a full disk, for one; the exit code tells
        bar.end()
        print(f"sdt-drake: {''.join(letters)}", file=sys.stderr)


def _parser(names: Sequence[str] = COMMANDS) -> argparse.ArgumentParser:
    """Of these commands: what others take need not be known to run one."""
    parser = _Parser(
        prog="sdt-drake",
        description="Motion control of spatial disorientation trainers, in Drake.",
        epilog=f"{_ORDER}\n\nexample: sdt-drake reproduce --out out\n\n{HOW}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"sdt-drake {sdt_drake.__version__}")
    commands = parser.add_subparsers(required=True, metavar="COMMAND", parser_class=_Parser)
    for name in names:
        module = importlib.import_module(f"sdt_drake.cli.{name}")
        does = " ".join((module.__doc__ or "").split())
        command = commands.add_parser(
            name,
            help=f"{does[0].lower()}{does[1:].removesuffix('.')}",
            description=does,
            epilog=f"example: {module.EXAMPLE}",
        )
        command.set_defaults(command=module.run, parser=command)
        command.add_argument(
            "--traceback", action="store_true", help="show where a fault of the program is"
        )
        module.add(command)
    return parser
