"""The command line `sdt-drake`."""

from __future__ import annotations

import contextlib
import os
import shlex
import sys
import warnings
from collections.abc import Sequence
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

import sdt_drake
from sdt_drake.cli import COMMANDS, GROUPS, SUBCOMMANDS
from sdt_drake.cli.old_forms import modern
from sdt_drake.cli.printing import asked, bar, console, echo, echo_wrapped, stop_printing
from sdt_drake.cli.telling import in_options
from sdt_drake.io.errors import InputError
from sdt_drake.io.files import keeping_inputs
from sdt_drake.io.progress import watching
from sdt_drake.io.trust import asking, is_kept, keep, trusting

if TYPE_CHECKING:
    from cyclopts import App, CycloptsError

# cyclopts is imported inside functions: --help lists the commands without it, in half the time.

BAD_INPUT, FAULT, INTERRUPTED = 2, 70, 130

_HELP = """Motion control of spatial disorientation trainers, in Drake.

Name the SCENARIO, MOTION, RECORDING or ROBOT first; pass further files with options: --scenario, \
--robot, --drive, --study. Add --traceback to any command to see where an internal error occurred.

example: sdt-drake reproduce --out out
"""

_INSTALL = "--install-completion"
_OPTIONS = {
    "--help, -h": "Print this text; behind a command, its options.",
    "--version": "Print the version.",
    _INSTALL: "Install completion of commands, options and names by the Tab key.",
}

_MAX_LINE = 1000  # characters of a printed error


def overview() -> None:
    """Print the commands in their groups, from the first lines of their help."""
    echo("Usage: sdt-drake COMMAND\n")
    for paragraph in _HELP.strip().split("\n\n"):
        echo_wrapped(paragraph, rest="", width=80)
        echo()
    for job, names in {**GROUPS, "Options": tuple(_OPTIONS)}.items():
        echo(job, "bold")
        width = max(map(len, names)) + 2
        for name in names:
            text = _OPTIONS.get(name) or _line(name)
            echo_wrapped(f"{name:{width}}{text}", "  ", " " * (width + 2), width=80)
        echo()


def commands(name: str = "") -> App:
    """Make the app with its commands, and import those that the first word `name` needs.

    An option such as --version needs none, and "" needs all.
    """
    from cyclopts import App, Group, Parameter
    from cyclopts.help import DefaultFormatter, PanelSpec
    from rich.box import ROUNDED, SIMPLE

    box = ROUNDED if console.is_terminal else SIMPLE
    app = App(
        name="sdt-drake",
        help=_HELP,
        version=f"sdt-drake {sdt_drake.__version__}",
        help_format="markdown",
        group_commands=Group("Options", sort_key=len(GROUPS)),
        group_parameters=Group("Options", sort_key=0),
        console=console,
        help_formatter=DefaultFormatter(panel_spec=PanelSpec(box=box)),
        default_parameter=Parameter(negative=()),
        exit_on_error=False,
        print_error=False,
    )
    for k, (job, names) in enumerate(GROUPS.items()):
        group = Group(job, sort_key=k)
        for order, command in enumerate(names):
            _add(app, command, name, group=group, sort_key=order, help_format="markdown")
    if name not in COMMANDS:
        app.command("sdt_drake.cli.install:run", name=_INSTALL, help=_OPTIONS[_INSTALL])
    return app


def _add(app: App, command: str, name: str, **place: Any) -> None:
    """Add a command to the app of `commands(name)`, and its subcommands."""
    from cyclopts import App

    module = f"sdt_drake.cli.{command}"
    if command not in SUBCOMMANDS:
        app.command(f"{module}:run", name=command, **place)
        return
    has_run = "run" not in SUBCOMMANDS[command] and "\ndef run(" in _text(command)
    has_default = has_run and name in (command, "")
    line = None if has_default else _line(command)
    place["group_parameters"] = app.group_parameters
    own = App(name=command, help=line, group_commands="Commands", **place)
    for sub in SUBCOMMANDS[command]:
        own.command(f"{module}:{sub}", name=sub, help_format="markdown")
        if name in (command, ""):
            own[sub]  # imports it, for its line in --help
    if has_default:
        own.default(import_module(module).run)
    app.command(own)


@cache
def _line(command: str) -> str:
    """Return the first line of a command's help from its file, without an import."""
    text = _text(command)
    whole = text.partition("\ndef run(")[2] or text
    return whole.partition('"""')[2].partition("\n")[0]


def _text(command: str) -> str:
    return Path(__file__).with_name(f"{command}.py").read_text(encoding="utf-8")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command of the command line.

    Returns:
        The exit code: 0 for success; 1 if failed runs leave a study without an answer; 2 for bad
        input and 70 for an internal error, both with one line on stderr; 130 if interrupted.
    """
    arguments = sys.argv[1:] if arguments is None else arguments
    _prepare_streams()
    words, old = modern([text for text in arguments if text != "--traceback"])
    code = 0
    lines: Sequence[str] = ()
    bar.begin()
    try:
        with watching(bar.report):
            code = _run(words)
    except KeyboardInterrupt:
        code = INTERRUPTED
    except InputError as error:
        code, lines = BAD_INPUT, error.lines
    except BrokenPipeError:
        pass  # the reader of our output has ended
    except OSError as error:
        code, lines = BAD_INPUT, [f"{error.filename or 'output'}: {error.strerror or error}"]
    except (Exception, SystemExit) as error:  # a library or own code may raise the latter
        if "--traceback" in arguments:
            sys.excepthook(type(error), error, error.__traceback__)
        fault = f"internal error, {type(error).__name__} ({error})"
        where = f"sdt-drake {shlex.join(arguments)}; add --traceback to see where"
        code, lines = FAULT, [f"{fault}, in: {where}"]
    for line in (*lines, *[old] * (old != "" and not lines)):
        _print_error(line)
    for stream in (sys.stdout, sys.stderr):
        try:
            bar.end()
            stream.flush()
        except OSError:
            stop_printing(stream)
    return code


def _run(arguments: Sequence[str]) -> int:
    if list(arguments) in (["--help"], ["-h"]):
        overview()
        return 0
    from cyclopts import CycloptsError

    with keeping_inputs(), warnings.catch_warnings(record=True) as caught:
        try:
            if not arguments:
                raise CycloptsError("COMMAND: missing")
            command, bound, _ = commands(arguments[0]).parse_args(arguments)
        except CycloptsError as error:
            raise _wrong_usage(error, arguments) from None
        given = bound.arguments
        if arguments[0] in COMMANDS:
            _check_surroundings(bool(given.get("show")))
        trust = getattr(given.get("given"), "trust", given.get("trust", False))
        try:
            with asking(_ask), trusting(trust):
                code: int | None = command(*bound.args, **bound.kwargs)
        except InputError as error:
            raise in_options(error, bound) from None
        sys.stdout.flush()
    for warning in caught:  # of libraries; after an error they are left out
        _print_error(f"warning: {warning.message}")
    return code or 0


def _wrong_usage(error: CycloptsError, words: Sequence[str]) -> InputError:
    """Return an error of the parser with the --help that describes what would be right."""
    names = [name for name in words[:1] if name in COMMANDS]
    names += [x for x in words[1:2] if x in SUBCOMMANDS.get(words[0], ())]
    text = f"{error}"
    text = text if text.endswith("...") else text.removesuffix(".")
    return InputError(f"{text} (see {' '.join(['sdt-drake', *names])} --help)")


def _ask(path: str, digest: str) -> bool:
    """Return whether a Python file may be run: from a stored answer, or ask on a terminal.

    The answer "yes" is stored for files with this digest.
    """
    if is_kept(path, digest):
        return True
    trusted = asked(
        f"{_printable(path)}\nSHA-256 {digest}\nThis Python file would be run. Trust it?"
    )
    if trusted:
        keep(path, digest)
    return trusted


def _check_surroundings(is_shown: bool) -> None:
    import logging

    logging.basicConfig(format="%(message)s")  # otherwise Drake sets one with names of loggers
    # Drake logs the errors that it raises, too, and resets the level of its logger when imported.
    logging.getLogger("drake").addFilter(lambda record: False)
    logging.getLogger("matplotlib").setLevel(logging.ERROR)  # of a missing cache folder
    try:
        os.getcwd()
        if is_shown:
            import matplotlib
        else:
            os.environ["MPLBACKEND"] = "agg"  # no screen is needed, also in a notebook
    except FileNotFoundError:
        raise InputError(
            "the current folder does not exist any more, change to another one"
        ) from None
    except ValueError as error:
        raise InputError(f"$MPLBACKEND: {error}") from None


def _prepare_streams() -> None:
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="replace")  # for characters that a terminal lacks


def _print_error(message: str) -> None:
    """Print one line to stderr, shortened and without control characters."""
    text = " ".join(message.split())
    if len(text) > _MAX_LINE:
        text = f"{text[: _MAX_LINE // 2]} ... {text[-_MAX_LINE // 2 :]}"
    with contextlib.suppress(OSError):  # a full disk, for example; the exit code remains
        bar.end()
        print(f"sdt-drake: {_printable(text)}", file=sys.stderr)


def _printable(text: str) -> str:
    return "".join(x if x.isprintable() else x.encode("unicode_escape").decode() for x in text)
