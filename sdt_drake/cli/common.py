"""What the commands share: options, texts, printing."""

from __future__ import annotations

import argparse
import contextlib
import os
import re
import sys
import textwrap
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

from sdt_drake.cli.bar import bar
from sdt_drake.io.errors import InputError, rewording
from sdt_drake.io.fields import Rule
from sdt_drake.io.files import checked_name, checked_output, checked_suffix
from sdt_drake.io.formats import BINARY, check_binary
from sdt_drake.io.shown import aligned, by_joint

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from sdt_drake.robot.robot import Robot
    from sdt_drake.run.design import Design
    from sdt_drake.show.documents import Table

# The heavy imports stand in the functions that run: --help and --version answer at once.

MOTION = "reference"
ROBOT = "sdt"


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


def number(kind: type[float] = float, **bounds: Any) -> Callable[[str], float]:
    """The type of an option: a number that a `Rule` of these takes; number(above=0, unit="s"), or
    number(int, minimum=1) for a whole one."""
    rule, whole = Rule(**bounds), "whole " if kind is int else ""

    def checked(text: str) -> float:
        with contextlib.suppress(ValueError):
            if rule.takes(value := kind(text)):
                return value
        raise argparse.ArgumentTypeError(f"{text}, expected a {whole}number{rule.bounds()}")

    return checked


def add_figure(parser: argparse.ArgumentParser, help_: str, kinds: Sequence[str]) -> None:
    """Add --out and --show; see `check_out` and `deliver`.

    Args:
        parser: of the command.
        help_: of --out.
        kinds: of files that it takes beside those of figures; "" for a folder.
    """
    add_out(parser, help_)
    parser.add_argument("--show", action="store_true", help="open the figure on the screen")
    parser.set_defaults(kinds=kinds)


def add_recorded(parser: argparse.ArgumentParser) -> None:
    """Add --columns and --side, of every command that takes recordings of a real machine."""
    parser.add_argument(
        "--columns", metavar="FILE", help="YAML file that says what the columns are called"
    )
    parser.add_argument(
        "--side",
        choices=("joint", "motor"),
        help="of the torques (default: of the motor in a recording of `simulate`, else of the "
        "joint)",
    )


def add_motion(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "motion",
        nargs="?",
        default=MOTION,
        help="name of one that ships, profile .yaml or motion .csv (default: %(default)s)",
    )


def add_robot(
    parser: argparse.ArgumentParser,
    help_: str = "SDF or URDF file (default: the shipped device)",
    default: str | None = ROBOT,
) -> None:
    parser.add_argument("--robot", default=default, help=help_)


def add_period(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--period", type=float, default=0.005, help="interpolation period [s]")


def add_scenario(
    parser: argparse.ArgumentParser,
    help_: str = "name of one that ships (`sdt-drake scenarios`), or .yaml file",
    metavar: str = "SCENARIO",
    **more: Any,
) -> None:
    """Add a scenario, or what else the help says, and --set; `more` are those of `add_argument`."""
    parser.add_argument("scenario", metavar=metavar, help=help_, **more)
    add_changes(parser)


def add_changes(parser: argparse.ArgumentParser) -> None:
    """Add --set, of every command that takes a scenario; see `load` and `naming_changes`."""
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
    from sdt_drake.io.yaml_files import parse_yaml

    name, equals, value = text.partition("=")
    if not name or not equals:
        raise argparse.ArgumentTypeError(f"'{text}', expected FIELD=VALUE, controller.kind=p_pi")
    try:
        return name.strip(), parse_yaml(value)
    except InputError as error:
        raise argparse.ArgumentTypeError(f"{name}: {error}") from None


def add_omega_r(parser: argparse.ArgumentParser, default: str) -> None:
    """Add --omega-r; None if it is not given: the command says what it takes then."""
    parser.add_argument(
        "--omega-r",
        type=number(above=0),
        help=f"lowest natural frequency of the structure [rad/s] (default: {default})",
    )


def refuse_options(options: argparse.Namespace, why: str, *names: str) -> None:
    """Refuse options that are given where they have no use; names: of their values."""
    for name in names:
        if getattr(options, name) != options.parser.get_default(name):
            raise InputError(f"--{'set' if name == 'changes' else name}: {why}")


def refuse_changes(options: argparse.Namespace) -> None:
    """Refuse --set where no scenario is given that it could change."""
    refuse_options(options, f"changes a scenario, which {options.scenario} is not", "changes")


def design_of(options: argparse.Namespace, check: Callable[[Robot], None] | None = None) -> Design:
    """The design of the scenario that `add_scenario` asked for; errors name it.

    Args:
        options: with `scenario`, name or file, and `changes`.
        check: of its robot, before anything is planned.
    """
    from sdt_drake.run.design import load_device, make_design
    from sdt_drake.run.scenario import load_scenario

    path = options.scenario
    with naming_changes(options):
        scenario = load_scenario(path, dict(options.changes))
        own = re.compile(rf"^scenario '{re.escape(scenario.name)}'")
        with rewording(lambda line: own.sub(lambda _: path, line)):
            robot = load_device(scenario)
            if check is not None:
                check(robot)
            return make_design(scenario, robot=robot)


def naming_changes(options: argparse.Namespace) -> AbstractContextManager[None]:
    """Errors within name the --set that they are about, or else all."""
    names = {name: f"--set {name}" for name, _ in options.changes}
    return naming_fields(names, f" (with --set {', '.join(names)})" if names else "")


def naming_fields(names: Mapping[str, str], otherwise: str = "") -> AbstractContextManager[None]:
    """Errors within about a field name the option that gave it; all others end with `otherwise`.

    Args:
        names: options by dotted names of fields.
        otherwise: see above.
    """
    own = re.compile(rf"(?:^|: )({'|'.join(map(re.escape, names)) or '$.'})(?=[:.[]| gives )")

    def named(line: str) -> str:
        found = own.search(line)
        return f"{names[found[1]]}{line[found.end() :]}" if found else line + otherwise

    return rewording(named)


def naming_robot(option: str) -> AbstractContextManager[None]:
    """Errors within that a motion is none of the robot's name the option that has another robot."""
    other = re.compile(r"joints?, robot '|expected a joint of '|: (joints|start_deg|q0): \d+ value")
    hint = f"; {option} names the robot of the motion"
    return rewording(lambda line: line + hint if other.search(line) else line)


def is_scenario(path: str) -> bool:
    """Whether this is a scenario, not a motion or a table: the name of a shipped one, or YAML.

    Raises:
        InputError: if there is no such file.
    """
    from sdt_drake.io.resources import find_file
    from sdt_drake.io.yaml_files import read_yaml

    file = find_file(path, "scenario", "motion")
    if file.suffix not in (".yaml", ".yml"):
        return False
    try:
        data = read_yaml(file)
    except InputError:  # whoever loads it says what is wrong
        return True
    return not isinstance(data, dict) or not {"tracks", "joints"} & data.keys()


def check_folder(folder: Path, names: Iterable[str] = ()) -> None:
    """Refuse a folder, there or still to be made, that cannot be written to, is a file or below
    one, or a broken link.

    Args:
        folder: the folder.
        names: of files that will be written there, below it too; refused as `checked_output` does.

    Raises:
        InputError: naming the file.
    """
    _check_place(folder)
    for path in (folder / name for name in names):
        checked_output(path)
        _check_place(path.parent)


def _check_place(folder: Path) -> None:
    for place in (checked_name(folder), *folder.parents):
        if place.is_dir():
            if not os.access(place, os.W_OK | os.X_OK):
                raise InputError(f"{place}: cannot be written to, expected a folder that can")
            return
        if place.is_symlink() and not place.exists():
            raise InputError(f"{place}: is a link that leads nowhere, expected a folder")
        if place.exists():
            raise InputError(f"{place}: is a file, expected a folder")


def check_out(options: argparse.Namespace) -> None:
    """Refuse what `add_figure` lets one ask for and could not be written or shown, before anything
    is computed."""
    from sdt_drake.show import style

    path: Path | None = options.out
    if options.show:
        style.check_screen("--show")
    if path is None:
        return
    if path.suffix or "" not in options.kinds:
        check_file(path, [*filter(None, options.kinds), *style.FIGURES])
    else:
        check_folder(path)
    if path.suffix in BINARY:
        check_binary(path)


def check_file(path: Path, suffixes: Sequence[str]) -> None:
    """Refuse a file to write that is none, of another kind, or below a file; see `replacing`."""
    checked_output(path)
    checked_suffix(path, suffixes)
    check_folder(path.parent)


def deliver(
    options: argparse.Namespace, figure: Callable[[], Figure], write: Callable[[Path], object]
) -> None:
    """Do what --out and --show ask for.

    Args:
        options: with `out` (checked by `check_out`) and `show`.
        figure: draws it; not called if nobody wants it.
        write: a file of another kind.
    """
    from sdt_drake.show import style

    if options.out is not None:
        if options.out.suffix in style.FIGURES:
            style.save(figure(), options.out)
        else:
            write(options.out)
        say(f"{options.out} written")
    if options.show:
        style.show(figure())


def naming(path: str) -> AbstractContextManager[None]:
    """Errors within name the scenario file."""
    own = re.compile(r"^(scenario '.*?': )?")
    return rewording(lambda line: own.sub(lambda _: f"{path}: ", line))


# --- printing --------------------------------------------------------------------------------


def say(text: str = "") -> None:
    """Print a line; whoever reads us may have enough, the results are written all the same."""
    bar.end()
    try:
        print(text, flush=True)
    except BrokenPipeError:
        stop_printing(sys.stdout)


def say_wrapped(text: str, first: str = "", rest: str = "  ", width: int = 96) -> None:
    """Print running text in lines of at most so many characters, with what they begin with."""
    for line in textwrap.wrap(text, width, initial_indent=first, subsequent_indent=rest):
        say(line)


def stop_printing(stream: TextIO) -> None:
    """Send the rest of the output nowhere: its reader is gone."""
    # Python would complain once more at exit.
    os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def print_table(header: Sequence[str], rows: Sequence[Sequence[str]], keys: int = 1) -> None:
    """Print aligned columns within 80 characters; see `aligned`."""
    for line in aligned(header, rows, keys):
        say(line)


def print_document_table(table: Table) -> None:
    """Print a table of a report."""
    print_table(table.header, table.rows)


def print_joints(names: Sequence[str], columns: Sequence[tuple[str, str, Iterable[Any]]]) -> None:
    """Print a table with a row for each joint.

    Args:
        names: of the joints.
        columns: header, format and a value for each joint; NaN is a dash.
    """
    print_table(*by_joint(names, columns))
