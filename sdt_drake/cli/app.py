"""The command line `sdt-drake`."""

from __future__ import annotations

import contextlib
import logging
import os
import shlex
import sys
import traceback
import warnings
from collections.abc import Sequence

from cyclopts import App, CycloptsError, Parameter

import sdt_drake
from sdt_drake.cli import COMMANDS
from sdt_drake.cli.printing import bar, console, stop_printing
from sdt_drake.io.errors import InputError
from sdt_drake.io.files import keeping_inputs
from sdt_drake.io.progress import watching
from sdt_drake.io.trust import asking, is_kept, keep, trusting

BAD_INPUT, FAULT, INTERRUPTED = 2, 70, 130

_HELP = """Motion control of spatial disorientation trainers, in Drake.

What a command works on stands alone: a SCENARIO, MOTION, RECORDING or ROBOT; what it needs beside \
that follows the name of an option: --scenario, --robot, --drive, --study. With --traceback any \
command shows where a fault of the program is.

example: sdt-drake reproduce --out out
"""

_COMPLETION = "Let Tab complete commands, options and names."

_LONGEST = 1000  # letters of a line about an error


def commands(name: str = "") -> App:
    """The commands with their options; all are imported now if the named one is none of them."""
    from cyclopts.help import DefaultFormatter, PanelSpec
    from rich.box import ROUNDED, SIMPLE

    box = ROUNDED if console.is_terminal else SIMPLE
    app = App(
        name="sdt-drake",
        help=_HELP,
        version=f"sdt-drake {sdt_drake.__version__}",
        help_format="plaintext",  # Markdown would take a fifth of the time
        console=console,
        help_formatter=DefaultFormatter(panel_spec=PanelSpec(box=box)),
        default_parameter=Parameter(negative=()),
        exit_on_error=False,
        print_error=False,
    )
    for k, command in enumerate(COMMANDS):
        path = f"sdt_drake.cli.{command}:run"
        app.command(path, name=command, sort_key=k, help_format="markdown")
        if name not in (*COMMANDS, "--version"):
            app[command]  # now, for its help
    if name not in COMMANDS:
        app.register_install_completion_command(help=_COMPLETION)
    return app


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
        with watching(bar.tell):
            code = _run([text for text in arguments if text != "--traceback"])
    except KeyboardInterrupt:
        code = INTERRUPTED
    except CycloptsError as error:
        prog = " ".join(["sdt-drake", *(name for name in arguments[:1] if name in COMMANDS)])
        told = f"{error}"
        told = told if told.endswith("...") else told.removesuffix(".")
        code, lines = BAD_INPUT, [f"{told} (see {prog} --help)"]
    except InputError as error:
        code, lines = BAD_INPUT, error.lines
    except (BrokenPipeError, SystemExit):  # as rich ends then
        pass  # whoever reads us has enough
    except OSError as error:
        code, lines = BAD_INPUT, [f"{error.filename or 'output'}: {error.strerror or error}"]
    except Exception as error:
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
    if not arguments:
        raise CycloptsError("COMMAND: missing")
    with keeping_inputs(), warnings.catch_warnings(record=True) as caught:
        command, bound, _ = commands(arguments[0]).parse_args(arguments)
        _check_surroundings(bool(bound.arguments.get("show")))
        with asking(_ask), trusting(bool(bound.arguments.get("trust"))):
            code: int | None = command(*bound.args, **bound.kwargs)
        sys.stdout.flush()
    for warning in caught:  # of libraries; where something went wrong, the error says it better
        _print_error(f"warning: {warning.message}")
    return code or 0


def _ask(path: str, digest: str) -> bool:
    """Whether a Python file may be run: as was answered before, or on a terminal is answered now;
    the answer is kept."""
    if is_kept(path, digest):
        return True
    if not (sys.stdin.isatty() and sys.stderr.isatty()):
        return False
    bar.end()
    print(_printable(path), f"SHA-256 {digest}", sep="\n", file=sys.stderr)
    print("is Python that would be run. Trust it? [y/N] ", end="", file=sys.stderr, flush=True)
    trusted = sys.stdin.readline().strip().lower() in ("y", "yes")
    if trusted:
        keep(path, digest)
    return trusted


def _check_surroundings(is_shown: bool) -> None:
    try:
        os.getcwd()
        if is_shown:
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
    logging.basicConfig(format="%(message)s")  # before Drake does so, with names of loggers
    # Drake also logs what it raises. (It sets the logger's level itself, when it is imported.)
    logging.getLogger("drake").addFilter(lambda record: False)
    logging.getLogger("matplotlib").setLevel(logging.ERROR)  # no folder for its cache, for one


def _print_error(message: str) -> None:
    """One line, which fits into a terminal and does nothing to it."""
    text = " ".join(message.split())
    if len(text) > _LONGEST:
        text = f"{text[: _LONGEST // 2]} ... {text[-_LONGEST // 2 :]}"
    with contextlib.suppress(OSError):  # a full disk, for one; the exit code tells
        bar.end()
        print(f"sdt-drake: {_printable(text)}", file=sys.stderr)


def _printable(text: str) -> str:
    return "".join(x if x.isprintable() else x.encode("unicode_escape").decode() for x in text)
