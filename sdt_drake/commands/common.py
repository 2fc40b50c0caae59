"""What the commands share: options, texts, printing."""

from __future__ import annotations

import argparse
import os
import re
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

from sdt_drake.commands.bar import bar
from sdt_drake.errors import InputError, checked_name, checked_output
from sdt_drake.shown import aligned, by_joint

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from sdt_drake.design import Design
    from sdt_drake.robot import Robot
    from sdt_drake.tables import Results

# The heavy imports stand in the functions that run: --help and --version answer at once.

MOTION = "reference"
ROBOT = "sdt"
REPORTS = (".html", ".md")


# --- options ---------------------------------------------------------------------------------


def add_out(parser: argparse.ArgumentParser, help_: str, default: str | None = None) -> None:
    note = f" (default: {default})" if default else ""
    parser.add_argument("--out", type=some_path, default=default, help=help_ + note)


def some_path(text: str) -> Path:
    """The type of an option: a path to write to, where ~ is what the shell takes it for.

    Raises:
        argparse.ArgumentTypeError: if it is empty, which Python takes for the folder we are in, or
            cannot be a name.
    """
    if not text:
        raise argparse.ArgumentTypeError("empty, expected a path")
    try:
        return checked_name(text).expanduser()
    except (InputError, RuntimeError) as error:  # ~nobody
        raise argparse.ArgumentTypeError(f"{text}: {error}") from None


def add_figure(parser: argparse.ArgumentParser, help_: str) -> None:
    """--out and --show; see `check_out` and `deliver`."""
    add_out(parser, help_)
    parser.add_argument("--show", action="store_true", help="open the figure on the screen")


def add_motion(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "motion",
        nargs="?",
        default=MOTION,
        help="name of one that ships, profile .yaml or motion .csv (default: %(default)s)",
    )


def add_robot(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--robot", default=ROBOT, help="SDF or URDF file (default: the shipped device)"
    )


def add_period(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--period", type=float, default=0.005, help="interpolation period [s]")


def add_scenario(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "scenario",
        metavar="SCENARIO",
        help="name of one that ships (`sdt-drake scenarios`), or .yaml file",
    )
    add_changes(parser)


def add_changes(parser: argparse.ArgumentParser) -> None:
    """--set, of every command that takes a scenario; see `load` and `naming_changes`."""
    parser.add_argument(
        "--set",
        dest="changes",
        type=_change,
        action="append",
        default=[],
        metavar="FIELD=VALUE",
        help="a field of the scenario, as if it stood in the file, any number of times: "
        "--set controller.kind=p_pi --set plant.deviation.payload_mass=20",
    )


def _change(text: str) -> tuple[str, Any]:
    """The type of an option: dotted name of a field, and its value."""
    from sdt_drake.yaml_files import parse_yaml

    name, equals, value = text.partition("=")
    if not name or not equals:
        raise argparse.ArgumentTypeError(f"'{text}', expected FIELD=VALUE, controller.kind=p_pi")
    try:
        return name.strip(), parse_yaml(value)
    except InputError as error:
        raise argparse.ArgumentTypeError(f"{name}: {error}") from None


def add_omega_r(parser: argparse.ArgumentParser, default: str) -> None:
    """--omega-r; None if it is not given: the command says what it takes then."""
    parser.add_argument(
        "--omega-r",
        type=float,
        help=f"lowest natural frequency of the structure [rad/s] (default: {default})",
    )


def refuse_changes(options: argparse.Namespace) -> None:
    """Where no scenario is given that --set could change."""
    if options.changes:
        raise InputError(f"--set: changes a scenario, which {options.scenario} is not")


def design_of(
    options: argparse.Namespace, check: Callable[[Robot], None] = lambda robot: None
) -> Design:
    """The design of the scenario that `add_scenario` asked for; errors name it.

    Args:
        options: with `scenario`, name or file, and `changes`.
        check: of its robot, before anything is planned.
    """
    from sdt_drake.design import load_device, make_design
    from sdt_drake.scenario import load_scenario

    path = options.scenario
    with naming_changes(options):
        scenario = load_scenario(path, dict(options.changes))
        try:
            robot = load_device(scenario)
            check(robot)
            return make_design(scenario, robot=robot)
        except InputError as error:
            own = f"scenario '{scenario.name}'"
            lines = (f"{path}{x[len(own) :]}" if x.startswith(own) else x for x in error.args)
            raise InputError(*lines) from None


@contextmanager
def naming_changes(options: argparse.Namespace) -> Iterator[None]:
    """Errors within name the --set that they are about, or else all."""
    try:
        yield
    except InputError as error:
        names = [re.escape(name) for name, _ in options.changes]
        own = re.compile(rf"(?:^|: )((?:{'|'.join(names)})(?=[:.[]).*)", re.DOTALL)
        also = f" (with --set {', '.join(name for name, _ in options.changes)})" if names else ""
        found = ((line, own.search(line) if names else None) for line in error.args)
        raise InputError(*(f"--set {x[1]}" if x else line + also for line, x in found)) from None


def is_motion(path: str) -> bool:
    """Whether this is a motion to plan: the name of a shipped one, or YAML that no scenario is."""
    from sdt_drake.resources import find_file
    from sdt_drake.yaml_files import read_yaml

    try:
        data = read_yaml(find_file(path, "scenario", "motion"))
    except InputError:  # whoever loads it says what is wrong
        return False
    return isinstance(data, dict) and ("tracks" in data or "joints" in data)


def check_folder(folder: Path) -> None:
    """Refuse a folder, there or still to be made, that is a file or below one, or a broken link.

    Raises:
        InputError: naming the file.
    """
    for place in (checked_name(folder), *folder.parents):
        if place.is_dir():
            return
        if place.is_symlink() and not place.exists():
            raise InputError(f"{place}: is a link that leads nowhere, expected a folder")
        if place.exists():
            raise InputError(f"{place}: is a file, expected a folder")


def check_out(
    path: Path | None,
    *,
    csv: bool = False,
    tables: Sequence[str] = (),
    report: bool = False,
    show: bool = False,
) -> None:
    """Refuse what could not be written or shown, before anything is computed.

    None: nothing is written.
    """
    from sdt_drake.analysis import style
    from sdt_drake.formats import BINARY, check_binary

    if show:
        style.check_screen("--show")
    if path is not None:
        check_file(path, csv * (".csv",) + tuple(tables) + style.FIGURES + report * REPORTS)
        if path.suffix in BINARY:
            check_binary(path)


def check_file(path: Path, suffixes: Sequence[str]) -> None:
    """Refuse a file to write that is none, of another kind, or below a file; see `replacing`."""
    checked_output(path)
    if path.suffix not in suffixes:
        raise InputError(f"{path}: unknown kind of file, expected {', '.join(suffixes)}")
    check_folder(path.parent)


def deliver(
    options: argparse.Namespace,
    figure: Callable[[], Figure],
    table: Callable[[Path], object] | None = None,
    report: Callable[[Path], object] | None = None,
    numbers: Callable[[], Results] | None = None,
) -> None:
    """Do what --out and --show ask for.

    Args:
        options: with `out` (checked by `check_out`) and `show`.
        figure: draws it; not called if nobody wants it.
        table: writes a table of joints.
        report: writes a report.
        numbers: what a .csv or .json file gets, where there is no `table`.
    """
    from sdt_drake.analysis import style
    from sdt_drake.tables import RESULTS, TABLES

    out: Path | None = options.out
    if out is not None and table is not None and out.suffix in TABLES:
        table(out)
    elif out is not None and numbers is not None and out.suffix in RESULTS:
        numbers().write(out)
    elif out is not None and report is not None and out.suffix in REPORTS:
        report(out)
    elif out is not None:
        style.save(figure(), out)
    if out is not None:
        say(f"{out} written")
    if options.show:
        style.show(figure())


@contextmanager
def naming(path: str) -> Iterator[None]:
    """Errors within name the scenario file."""
    try:
        yield
    except InputError as error:
        own = (re.sub(r"^scenario '.*?': ", "", x) for x in error.args)
        raise InputError(*(f"{path}: {x}" for x in own)) from None


# --- printing --------------------------------------------------------------------------------


def say(text: str = "") -> None:
    """Print a line; whoever reads us may have enough, the results are written all the same."""
    bar.end()
    try:
        print(text, flush=True)
    except BrokenPipeError:
        stop_printing(sys.stdout)


def stop_printing(stream: TextIO) -> None:
    """Send the rest of the output nowhere: its reader is gone."""
    # Python would complain once more at exit.
    os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def print_table(header: Sequence[str], rows: Sequence[Sequence[str]], keys: int = 1) -> None:
    """Print aligned columns within 80 characters; see `aligned`."""
    for line in aligned(header, rows, keys):
        say(line)


def print_joints(names: Sequence[str], columns: Sequence[tuple[str, str, Iterable[Any]]]) -> None:
    """Print a table with a row for each joint.

    Args:
        names: of the joints.
        columns: header, format and a value for each joint; NaN is a dash.
    """
    print_table(*by_joint(names, columns))
