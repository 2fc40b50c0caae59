"""Parts that commands share: types of options, checks of output files."""

import os
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Group, Parameter, Token
from cyclopts.validators import Number

from sdt_drake.cli import completion
from sdt_drake.cli.printing import echo
from sdt_drake.io.errors import MAX_NUMBER, InputError, at_most
from sdt_drake.io.files import checked_name, checked_output, checked_suffix
from sdt_drake.io.formats import BINARY, FIGURES, check_binary

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from sdt_drake.robot.robot import Robot as RobotModel
    from sdt_drake.run.design import Design

# Heavy imports are inside functions, so that --help and --version are fast.

COMMON = Group("Common options", sort_key=1)
"""The options that most commands have and that mean the same in all, behind a command's own."""

MOTION = "reference"
ROBOT = "sdt"


# --- options ---------------------------------------------------------------------------------


def _path(_: object, tokens: Sequence[Token]) -> Path:
    """Convert an option's value to a path to write to; expand ~ as shells do."""
    text = tokens[0].value
    if not text:  # for Python the current folder
        raise ValueError("empty, expected a path")
    try:
        return checked_name(text).expanduser()
    except InputError as error:
        raise ValueError(f"{error}") from None
    except RuntimeError as error:  # an unknown user in ~user
        raise ValueError(f"{text}: {error}") from None


def _changes(_: object, tokens: Sequence[Token]) -> tuple[tuple[str, Any], ...]:
    """Convert all --set options to dotted field names and values."""
    from sdt_drake.io.yaml_files import parse_yaml

    changes = []
    for token in tokens:
        name, equals, value = token.value.partition("=")
        if not name or not equals:
            raise ValueError(
                f"'{token.value}', expected FIELD=VALUE, for example controller.kind=p_pi"
            )
        try:
            changes.append((name.strip(), parse_yaml(value)))
        except InputError as error:
            raise ValueError(f"{name}: {error}") from None
    return tuple(changes)


def _whole(_: object, tokens: Sequence[Token]) -> int:
    """Convert an option's value to a whole number; cyclopts alone would round others."""
    try:
        return int(tokens[0].value)
    except ValueError:
        raise ValueError(f"{tokens[0].value}, expected a whole number") from None


def number(**bounds: float) -> Parameter:
    """Return a parameter for finite numbers within limits: number(gt=0), number(gte=1, lte=10)."""
    accepted = " and ".join(f"{_BOUNDS[kind]} {bound:g}" for kind, bound in bounds.items())
    limits = Number(**bounds), Number(gte=-MAX_NUMBER, lte=MAX_NUMBER)

    def check(type_: object, value: object) -> None:
        try:
            for limit in limits:
                limit(type_, value)
        except ValueError:
            raise ValueError(f"Expected a number {accepted}{at_most(value)}") from None

    return Parameter(validator=check)


_BOUNDS = {"gt": ">", "gte": ">=", "lt": "<", "lte": "<="}


def one_of(*kinds: str, **more: Any) -> Parameter:
    """Return a parameter for a file, or the name of a shipped file of these kinds.

    `more` are further arguments of cyclopts' Parameter.
    """
    return Parameter(metavar="NAME|FILE", completer=completion.names(*kinds), **more)


Scenario = Annotated[
    str,
    one_of("scenario", help="name of a shipped scenario (`sdt-drake list`), or .yaml file"),
]
Motion = Annotated[
    str, one_of("motion", help="name of a shipped motion, motion profile .yaml or motion file .csv")
]
Robot = Annotated[str, one_of("robot", help="SDF or URDF file, or name of a shipped robot")]
OtherRobot = Annotated[
    str | None, one_of("robot", help="SDF or URDF file (default: the shipped device)")
]
Changes = Annotated[
    tuple[tuple[str, Any], ...],
    Parameter(
        name="--set",
        metavar="FIELD=VALUE",
        converter=_changes,
        n_tokens=1,
        show_default=False,
        group=COMMON,
        completer=completion.fields,
        help="change a field of the scenario; repeat the option for more: "
        "`--set controller.kind=p_pi --set plant.deviation.payload_mass=20`",
    ),
]
Trust = Annotated[
    bool,
    Parameter(
        show_default=False,
        group=COMMON,
        help="run the Python file that the scenario names without asking",
    ),
]
"""The option of every command that runs Python files; `app` handles it before the command runs."""


@Parameter(name="*")
@dataclass(frozen=True)
class Given:
    """Options of every command that loads a scenario or a study."""

    changes: Changes = ()
    trust: Trust = False


@Parameter(name="*")
@dataclass(frozen=True)
class Held:
    """Options of commands that read the file of a robot."""

    hold: Annotated[
        str,
        Parameter(
            metavar="JOINT[=POSITION],...",
            show_default=False,
            help="joints whose links are welded, such as a gripper's, at 0 or at POSITION [rad, m]",
        ),
    ] = ""
    tip: Annotated[
        str,
        Parameter(
            metavar="LINK",
            show_default=False,
            help="link that ends the chain; all joints beside and beyond it are held",
        ),
    ] = ""

    @property
    def words(self) -> list[str]:
        """The options that are given, as words of a command."""
        return [
            word for name, value in vars(self).items() if value for word in (f"--{name}", value)
        ]

    def load(self, robot: str | None) -> "RobotModel":
        """Load a robot by file or name, the shipped device by default, with what is held."""
        from sdt_drake.robot.robot import load_robot

        return load_robot(robot or ROBOT, hold=self.hold, tip=self.tip)


Integer = Annotated[int, Parameter(converter=_whole)]
Target = Annotated[Path, Parameter(converter=_path)]
OptionalTarget = Annotated[Path | None, Parameter(converter=_path)]
Out = Annotated[OptionalTarget, Parameter(group=COMMON)]
OutFolder = Annotated[Target, Parameter(group=COMMON)]
Flag = Annotated[bool, Parameter(show_default=False)]
Show = Annotated[
    bool, Parameter(show_default=False, group=COMMON, help="open the figure on the screen")
]
OmegaR = Annotated[float | None, number(gt=0)]
Cutoff = Annotated[float | None, number(gte=0.1, lte=1000)]
Columns = Annotated[
    str | None,
    Parameter(metavar="FILE", help="YAML file with the names of the columns"),
]
Side = Annotated[
    Literal["joint", "motor"] | None,
    Parameter(
        help="side of the torques (default: motor for a recording of `simulate`, else joint)"
    ),
]


def refuse(why: str, **given: Any) -> None:
    """Raise InputError if an option in `given` (by its name in Python) has a value.

    `why` is the message: it has no effect here, and what is accepted.
    """
    for name, value in given.items():
        if all(value is not nothing for nothing in (None, False, ())) and value != "":
            option = "set" if name == "changes" else name.replace("_", "-")
            raise InputError(f"--{option}: {why}")


def refuse_changes(changes: Changes, thing: str) -> None:
    """Raise InputError if --set is given, since `thing` is no scenario."""
    refuse(f"changes fields of a scenario, but {thing} is no scenario", changes=changes)


def design_of(
    path: str, changes: Changes = (), check: "Callable[[RobotModel], None] | None" = None
) -> "Design":
    """Load a scenario, apply --set, and resolve it to a design.

    Args:
        path: shipped name or file of the scenario.
        changes: field names and values from --set.
        check: called with the robot before anything is planned; raises InputError to refuse it.

    Raises:
        InputError: naming the scenario's file and the --set that is wrong.
    """
    from sdt_drake.run.design import load_device, make_design
    from sdt_drake.run.scenario import load_scenario

    scenario = load_scenario(path, dict(changes))
    robot = load_device(scenario)
    if check is not None:
        check(robot)
    return make_design(scenario, robot=robot)


def is_scenario(path: str) -> bool:
    """Return whether a shipped name or a file is a scenario, and not a motion or a table.

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
    except InputError:  # loading it as a scenario raises the error
        return True
    return not isinstance(data, dict) or not {"tracks", "joints"} & data.keys()


def check_folder(folder: Path, names: Iterable[str] = ()) -> None:
    """Check that an existing or new folder can be written to.

    Args:
        folder: the folder.
        names: paths within the folder of the files to write; each is checked by `checked_output`.

    Raises:
        InputError: for a file, a broken link, or a place without permission, by its name.
    """
    _check_place(folder)
    for path in (folder / name for name in names):
        checked_output(path)
        _check_place(path.parent)


def _check_place(folder: Path) -> None:
    for place in (checked_name(folder), *folder.parents):
        if place.is_dir():
            if not os.access(place, os.W_OK | os.X_OK):
                raise InputError(f"{place}: cannot be written to, choose a folder with permission")
            return
        if place.is_symlink() and not place.exists():
            raise InputError(f"{place}: is a link that leads nowhere, expected a folder")
        if place.exists():
            raise InputError(f"{place}: is a file, expected a folder")


def check_out(out: Path | None, show: bool, kinds: Sequence[str]) -> None:
    """Check, before anything is computed, that --out can be written and --show has a screen.

    Args:
        out: value of --out, if any.
        show: whether --show is given.
        kinds: accepted suffixes beside those of figures; "" for a folder.

    Raises:
        InputError: naming the option or the file.
    """
    if show:
        from sdt_drake.show.style import check_screen

        check_screen("--show")
    if out is None:
        return
    if out.suffix in FIGURES:  # an import that fails or is interrupted now costs no results
        import sdt_drake.show.style  # noqa: F401
    if out.suffix or "" not in kinds:
        check_file(out, [*filter(None, kinds), *FIGURES])
    else:
        check_folder(out)
    if out.suffix in BINARY:
        check_binary(out)


def check_file(path: Path, suffixes: Sequence[str]) -> None:
    """Check that a file can be written and has one of the suffixes; raise InputError if not."""
    checked_output(path)
    checked_suffix(path, suffixes)
    check_folder(path.parent)


def deliver(
    out: Path | None, show: bool, figure: "Callable[[], Figure]", write: Callable[[Path], object]
) -> None:
    """Write --out and open --show.

    Args:
        out, show: the options, checked by `check_out`.
        figure: draws the figure; called once, and only if it is needed.
        write: writes a file that is no figure.
    """
    figure = cache(figure)
    if out is not None:
        if out.suffix in FIGURES:
            from sdt_drake.show.style import save

            save(figure(), out)
        else:
            write(out)
        echo(f"{out} written")
    if show:
        from sdt_drake.show import style

        style.show(figure())
