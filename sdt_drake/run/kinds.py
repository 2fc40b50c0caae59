"""The kinds of controllers as data, apart from their wiring: options, needs and plants of each."""

from __future__ import annotations

import traceback
from dataclasses import dataclass
from pathlib import Path

from sdt_drake.io.errors import InputError, one_line
from sdt_drake.io.trust import trusted_code

OPTIONS = ("anti_windup", "feedforward", "position_gain")
"""Fields of a scenario's `controller` that only some kinds accept."""

_LINKS, _MOTORS = "links' masses and geometry", "motors' inertia"
_LARGEST = "largest inertia of each joint"
_FEEDFORWARD_NEEDS = {"none": (), "ctc": (_LINKS,), "id": (_LINKS, _MOTORS)}


@dataclass(frozen=True)
class Kind:
    """A kind of controller, as scenarios and comparisons need it."""

    needs: tuple[str, ...] = ()
    """Data needed to commission the controller, apart from those for its feedforward."""
    plants: tuple[str, ...] = ("axis", "coupled")
    """Plants that the controller supports."""
    options: tuple[str, ...] = ()
    """Fields of OPTIONS that the controller accepts."""
    feedforward: str = "none"
    """Torque feedforward if it is no option: "none", "ctc" or "id"."""
    structure: str | None = None
    """Structure of the PI controllers; None if the scenario chooses it."""
    takes_feedforward: bool = False
    """Whether any torque feedforward can be added to the command."""
    controller: type | None = None
    """Class of a controller of your own; None for a shipped one."""

    def needs_with(self, feedforward: str) -> tuple[str, ...]:
        """Return the data needed to commission the controller with a torque feedforward."""
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
"""Kinds by name, shipped and registered."""

_loaded: dict[bytes, dict[str, Kind]] = {}
"""Registered kinds by the content of the file that registered them."""


def load_controllers(path: str | Path) -> None:
    """Run a trusted Python file that registers your own controllers.

    A second file of the same content is not run again.

    Raises:
        InputError: if the file is missing or not trusted, or fails; with file, line and error.
    """
    file = Path(path)
    content = trusted_code(file)
    if content in _loaded:
        CONTROLLERS.update(_loaded[content])  # another file may have registered the same names
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
