"""What the commands share: types of their options, files to write, errors that name options."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter, Token
from cyclopts.validators import Number

from sdt_drake.cli import completion
from sdt_drake.cli.printing import say
from sdt_drake.io.errors import InputError, Problem, is_within, retelling
from sdt_drake.io.files import checked_name, checked_output, checked_suffix
from sdt_drake.io.formats import BINARY, FIGURES, check_binary

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from sdt_drake.robot.robot import Robot as RobotModel
    from sdt_drake.run.design import Design

# The heavy imports stand in the functions that run: --help and --version answer at once.

MOTION = "reference"
ROBOT = "sdt"


# --- options ---------------------------------------------------------------------------------


def _path(_: object, tokens: Sequence[Token]) -> Path:
    """A path to write to, where ~ is what the shell takes it for."""
    text = tokens[0].value
    if not text:  # which Python takes for the folder we are in
        raise ValueError("empty, expected a path")
    try:
        return checked_name(text).expanduser()
    except RuntimeError as error:  # ~nobody
        raise ValueError(f"{text}: {error}") from None


def _changes(_: object, tokens: Sequence[Token]) -> tuple[tuple[str, Any], ...]:
    """Dotted names of fields, and their values."""
    from sdt_drake.io.yaml_files import parse_yaml

    changes = []
    for token in tokens:
        name, equals, value = token.value.partition("=")
        if not name or not equals:
            raise ValueError(f"'{token.value}', expected FIELD=VALUE, controller.kind=p_pi")
        try:
            changes.append((name.strip(), parse_yaml(value)))
        except InputError as error:
            raise ValueError(f"{name}: {error}") from None
    return tuple(changes)


def _whole(_: object, tokens: Sequence[Token]) -> int:
    """A whole number: cyclopts would round others."""
    try:
        return int(tokens[0].value)
    except ValueError:
        raise ValueError(f"{tokens[0].value}, expected a whole number") from None


def number(**bounds: float) -> Parameter:
    """A finite number within bounds of cyclopts: number(gt=0), number(gte=1, lte=10)."""
    accepted = " and ".join(f"{_BOUNDS[kind]} {bound:g}" for kind, bound in bounds.items())
    limits = Number(**bounds), Number(gt=-math.inf, lt=math.inf)

    def check(type_: object, value: object) -> None:
        try:
            for limit in limits:
                limit(type_, value)
        except ValueError:
            raise ValueError(f"Expected a number {accepted}") from None

    return Parameter(validator=check)


_BOUNDS = {"gt": ">", "gte": ">=", "lt": "<", "lte": "<="}


def one_of(*kinds: str, **more: Any) -> Parameter:
    """A file, or the name of one of these kinds that ships; `more` are those of a parameter."""
    return Parameter(metavar="NAME|FILE", completer=completion.names(*kinds), **more)


Scenario = Annotated[
    str, one_of("scenario", help="name of one that ships (`sdt-drake scenarios`), or .yaml file")
]
Motion = Annotated[
    str, one_of("motion", help="name of one that ships, profile .yaml or motion .csv")
]
Robot = Annotated[str, one_of("robot", help="SDF or URDF file")]
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
        completer=completion.fields,
        help="a field of the scenario, as if it stood in the file, any number of times: "
        "`--set controller.kind=p_pi --set plant.deviation.payload_mass=20`",
    ),
]
Trust = Annotated[
    bool,
    Parameter(
        show_default=False,
        help="run the Python file that the scenario names, if any, without a question",
    ),
]
"""Of every command that loads scenarios; `app` sees to it, before the command begins."""
Whole = Annotated[int, Parameter(converter=_whole)]
Target = Annotated[Path, Parameter(converter=_path)]
Out = Annotated[Path | None, Parameter(converter=_path)]
Flag = Annotated[bool, Parameter(show_default=False)]
Show = Annotated[bool, Parameter(show_default=False, help="open the figure on the screen")]
OmegaR = Annotated[float | None, number(gt=0)]
Columns = Annotated[
    str | None,
    Parameter(metavar="FILE", help="YAML file that says what the columns are called"),
]
Side = Annotated[
    Literal["joint", "motor"] | None,
    Parameter(
        help="of the torques (default: of the motor in a recording of `simulate`, else of the "
        "joint)"
    ),
]


def refuse(why: str, **given: Any) -> None:
    """Refuse options that are given where they have no use, by their names in Python."""
    for name, value in given.items():
        if all(value is not nothing for nothing in (None, False, ())):
            option = "set" if name == "changes" else name.replace("_", "-")
            raise InputError(f"--{option}: {why}")


def refuse_changes(changes: Changes, thing: str) -> None:
    """Refuse --set where no scenario is given that it could change."""
    refuse(f"changes a scenario, which {thing} is not", changes=changes)


def design_of(
    path: str, changes: Changes = (), check: Callable[[RobotModel], None] | None = None
) -> Design:
    """The design of a scenario, by name or file, with --set; errors name it.

    Args:
        path: of the scenario.
        changes: of its fields.
        check: of its robot, before anything is planned.
    """
    from sdt_drake.run.design import load_device, make_design
    from sdt_drake.run.scenario import load_scenario

    with naming_changes(changes):
        scenario = load_scenario(path, dict(changes))
        with naming_file(path, scenario.name):
            robot = load_device(scenario)
            if check is not None:
                check(robot)
            return make_design(scenario, robot=robot)


def naming_changes(changes: Changes) -> AbstractContextManager[None]:
    """Errors within name the --set that they are about, or else all."""
    names = {name: f"--set {name}" for name, _ in changes}
    return naming_fields(names, f" (with --set {', '.join(names)})" if names else "")


def naming_fields(options: Mapping[str, str], otherwise: str = "") -> AbstractContextManager[None]:
    """Errors within about a field name the option that gave it; all others end with `otherwise`.

    Args:
        options: by dotted names of fields.
        otherwise: see above.
    """

    def named(problem: Problem) -> Problem:
        for field, option in options.items():
            if is_within(problem.place, field):
                return problem._replace(where="", place=problem.place.replace(field, option, 1))
        return Problem(f"{problem}{otherwise}", kind=problem.kind) if otherwise else problem

    return retelling(named)


def naming_robot(option: str) -> AbstractContextManager[None]:
    """Errors within that a motion is none of the robot's name the option that has another robot."""

    def named(problem: Problem) -> Problem:
        text = f"{problem}; {option} names the robot of the motion"
        return Problem(text) if problem.kind == "joints" else problem

    return retelling(named)


def naming_file(path: str, scenario: str) -> AbstractContextManager[None]:
    """Errors within name the file of a scenario, not the scenario."""
    own = f"scenario '{scenario}'"

    def named(problem: Problem) -> Problem:
        is_own = problem.where.startswith(own)
        return problem._replace(where=path + problem.where.removeprefix(own)) if is_own else problem

    return retelling(named)


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


def check_out(out: Path | None, show: bool, kinds: Sequence[str]) -> None:
    """Refuse --out and --show that could not be written or shown, before anything is computed.

    Args:
        out: of figures, or else of other kinds.
        show: whether there has to be a screen.
        kinds: of files beside those of figures; "" for a folder.
    """
    if show:
        from sdt_drake.show.style import check_screen

        check_screen("--show")
    if out is None:
        return
    if out.suffix in FIGURES:  # what cannot be imported, or is interrupted then, costs no work
        import sdt_drake.show.style  # noqa: F401
    if out.suffix or "" not in kinds:
        check_file(out, [*filter(None, kinds), *FIGURES])
    else:
        check_folder(out)
    if out.suffix in BINARY:
        check_binary(out)


def check_file(path: Path, suffixes: Sequence[str]) -> None:
    """Refuse a file to write that is none, of another kind, or below a file; see `replacing`."""
    checked_output(path)
    checked_suffix(path, suffixes)
    check_folder(path.parent)


def deliver(
    out: Path | None, show: bool, figure: Callable[[], Figure], write: Callable[[Path], object]
) -> None:
    """Do what --out and --show ask for.

    Args:
        out, show: as `check_out` has found them good.
        figure: draws it; not called if nobody wants it.
        write: a file of another kind.
    """
    if out is not None:
        if out.suffix in FIGURES:
            from sdt_drake.show.style import save

            save(figure(), out)
        else:
            write(out)
        say(f"{out} written")
    if show:
        from sdt_drake.show import style

        style.show(figure())
