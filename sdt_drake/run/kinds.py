"""The kinds of controllers, as data: what a scenario must know of each, apart from its wiring."""

from __future__ import annotations

import traceback
from dataclasses import dataclass
from pathlib import Path

from sdt_drake.io.errors import InputError, one_line
from sdt_drake.io.trust import trusted_code

OPTIONS = ("anti_windup", "feedforward", "position_gain")
"""Fields of a scenario's `controller` that some kinds take and others do not."""

_LINKS, _MOTORS = "links' masses and geometry", "motors' inertia"
_LARGEST = "largest inertia of each joint"
_FEEDFORWARD_NEEDS = {"none": (), "ctc": (_LINKS,), "id": (_LINKS, _MOTORS)}


@dataclass(frozen=True)
class Kind:
    """What a scenario must know of a kind of controller.

    Attributes:
        needs: what must be known to commission it, beside what its feedforward needs.
        plants: the plants on which it makes sense.
        options: the fields of OPTIONS that it takes.
        feedforward: torque feedforward where that is no option: "none", "ctc" or "id".
        structure: structure of its PI controllers; None where the scenario chooses it.
        takes_feedforward: whether any torque feedforward can be added to its command.
        controller: its class, where it does not ship with the package.
    """

    needs: tuple[str, ...] = ()
    plants: tuple[str, ...] = ("axis", "coupled")
    options: tuple[str, ...] = ()
    feedforward: str = "none"
    structure: str | None = None
    takes_feedforward: bool = False
    controller: type | None = None

    def needs_with(self, feedforward: str) -> tuple[str, ...]:
        """What must be known to commission the controller with a torque feedforward."""
        return self.needs + _FEEDFORWARD_NEEDS[feedforward]


CONTROLLERS: dict[str, Kind] = {
    "pi": Kind((_LARGEST,), options=("anti_windup",), takes_feedforward=True),
    "pi_ctc": Kind(
        (_LARGEST,), options=("anti_windup",), feedforward="ctc", takes_feedforward=True
    ),
    "pi_id": Kind(
        (_LARGEST,),
        options=("anti_windup",),
        feedforward="id",
        structure="pi",
        takes_feedforward=True,
    ),
    "p_pi": Kind((_LARGEST,), options=OPTIONS, structure="pi", takes_feedforward=True),
    "pi_scheduled": Kind(
        ("inertia along the motion",),
        options=("anti_windup", "feedforward"),
        takes_feedforward=True,
    ),
    "inverse_dynamics": Kind((_LINKS, _MOTORS, "state of all joints at once"), ("coupled",)),
}
"""The kinds by name: those that ship with the package, and those that are registered."""

_loaded: dict[bytes, dict[str, Kind]] = {}  # what a content has registered


def load_controllers(path: str | Path) -> None:
    """Run a trusted Python file that registers controllers of one's own; the same content only
    once.

    Raises:
        InputError: if there is no such file, it is not trusted, or it fails, naming file, line and
            error.
    """
    file = Path(path)
    content = trusted_code(file)
    if content in _loaded:
        CONTROLLERS.update(_loaded[content])  # another content may have taken the names
        return
    before = dict(CONTROLLERS)
    try:
        code = compile(content, str(file), "exec")
        exec(code, {"__name__": f"controllers_of_{file.stem}", "__file__": str(file)})
    except (Exception, SystemExit) as error:
        frames = traceback.extract_tb(error.__traceback__)
        lines = [frame.lineno for frame in frames if frame.filename == str(file)]
        where = f"{file}, line {lines[-1]}" if lines else f"{file}"
        raise InputError(f"{where}: {type(error).__name__}: {one_line(error)}") from None
    _loaded[content] = {name: x for name, x in CONTROLLERS.items() if before.get(name) is not x}
