"""Options of controllers as data, and all controllers by their kind."""

import traceback
from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Annotated, Any, ClassVar

from pydrake.systems.framework import Context, System

from sdt_drake.io.arrays import Array
from sdt_drake.io.deprecated import renamed
from sdt_drake.io.errors import InputError, one_line
from sdt_drake.io.fields import EachJoint, FileOf, Input, Number, Positive, Problems, Text, field
from sdt_drake.io.trust import trusted_code
from sdt_drake.motion import Motion
from sdt_drake.robot.deviation import Deviation
from sdt_drake.systems.gains import STRUCTURES, FeedforwardKind

LINKS, MOTORS = "links' masses and geometry", "motors' inertia"
LARGEST_INERTIA = "largest inertia of each joint"
_FEEDFORWARD_NEEDS = {"none": (), "ctc": (LINKS,), "id": (LINKS, MOTORS)}


@dataclass(frozen=True)
class ControllerOptions(Input):
    """The controller: kind, gains, model, and the options of its kind."""

    kind: Text = "pi"
    """Name of a controller: a shipped one, or one that `file` registers."""
    file: Annotated[str, FileOf("controllers")] = ""
    """Python file that registers your own controllers, relative to the scenario's folder. It is run
    once it is trusted. None by default."""
    omega_r: Positive | None = field(None, unit="rad/s")
    """Lowest natural frequency of the robot's structure, for the SDF without changes. A chosen
    device scales it. The gains are tuned to it."""
    omega_ratio: Positive = field(0.5, unit="-")
    """Ratio omega_n / omega_r at the largest inertia."""
    zeta: EachJoint[Positive] | None = field(None, unit="-")
    """Damping ratio at the largest inertia; 1 by default."""
    kp: EachJoint[Positive] | None = field(None, unit="N m s/rad", side="motor")
    """Proportional gain K_PS. kp and ki replace omega_r, omega_ratio and zeta."""
    ki: EachJoint[Positive] | None = field(None, unit="N m/rad", side="motor")
    """Integral gain K_IS."""
    friction_compensation: bool = False
    """Friction compensation: whether the feedforward includes the plant's friction at the speed of
    the reference."""
    model: Deviation = field(Deviation)
    """Errors of the controller's model of the robot; none by default."""

    needs: ClassVar[tuple[str, ...]] = ()
    """Data needed to commission the controller, apart from those for its feedforward."""
    plants: ClassVar[tuple[str, ...]] = ("axis", "coupled")
    """Plants that the controller supports."""
    takes_feedforward: ClassVar[bool] = False
    """True if any torque feedforward can be added to the command, as in PI loops."""

    def problems(self) -> Problems:
        if (self.kp is None) != (self.ki is None):
            yield "kp" if self.kp is None else "ki", "missing, expected kp and ki or neither"
        elif self.kp is not None:
            for name, default in (("omega_r", None), ("omega_ratio", 0.5), ("zeta", None)):
                if getattr(self, name) != default:
                    yield name, "kp and ki are given; remove one or the other"

    @property
    def label(self) -> str:
        """Short name of the controller: kind and chosen feedforward, such as "p_pi+id"."""
        return self.kind

    @property
    def feedforward_in_use(self) -> str:
        """The torque feedforward that is added to the command, one of FEEDFORWARDS."""
        return "none"

    @property
    def feedforward_gain(self) -> Sequence[float] | None:
        """Factor on the torque feedforward [-], shape (n,); None for 1."""
        return None

    @property
    def position_gain(self) -> Sequence[float] | None:
        """Position gain K_V [1/s], shape (n,); None for omega_n / 4, or without position loops."""
        return None

    @property
    def all_needs(self) -> tuple[str, ...]:
        """Data needed to commission the controller with its feedforward."""
        friction = ("joints' friction",) * self.friction_compensation
        return (*self.needs, *_FEEDFORWARD_NEEDS[self.feedforward_in_use], *friction)

    @property
    def title(self) -> str:
        """Name of the controller in messages: its class."""
        return type(self).__name__

    def feedback(self, design: Any) -> System:
        """Make the feedback of a `Design`, from signals of the loop to `tau_fb` or `tau_cmd`."""
        raise NotImplementedError

    def linear(self, design: Any, sample: int) -> System:
        """Make the feedback alone, around a sample of the motion, for linear analysis.

        Raises:
            InputError: if there is no feedback that Drake can linearise.
        """
        text = f"controller.kind {self.kind}: has no linear feedback (Controller.linear)"
        raise InputError(text)

    def start(
        self, system: System, context: Context, design: Any, tau: Array, start: Motion | None
    ) -> None:
        """Set the state of the feedback so that its output is a torque in steady motion.

        Args:
            system: the system that `feedback` made.
            context: a context of the system.
            design: the design of the loop.
            tau: the output, motor side [N m], shape (n,).
            start: a motion of one sample, without acceleration; None for the first of the motion.
        """

    def in_words(self, design: Any) -> str:
        """Describe the feedback of a design in words."""
        return self.title

    @property
    def structure(self) -> str | None:
        """Old word for the set-point weight; None if it is neither 0 nor 1."""
        renamed("controller.structure", "controller.setpoint_weight")
        weight = getattr(self, "setpoint_weight", 1.0)
        return next((word for word, b in STRUCTURES.items() if b == weight), None)


@dataclass(frozen=True)
class AntiWindup(ControllerOptions):
    """Options of controllers whose integral can follow the saturated torque."""

    anti_windup: bool = False
    """Anti-windup: whether back-calculation limits the integral of the PI controller while
    the motor saturates."""


@dataclass(frozen=True)
class FeedforwardGain(ControllerOptions):
    """Options of controllers to whose command the loop adds a torque feedforward."""

    feedforward_gain: EachJoint[Number] | None = field(None, unit="-")
    """Factor on the torque feedforward; 1 by default."""


@dataclass(frozen=True)
class ChosenFeedforward(FeedforwardGain):
    """Options of controllers whose torque feedforward the scenario chooses."""

    feedforward: FeedforwardKind | None = None
    """Torque feedforward: "none" (default), "ctc", "id"."""

    def problems(self) -> Problems:
        yield from super().problems()
        if self.feedforward_gain is not None and self.feedforward_in_use == "none":
            yield "feedforward_gain", f"{self.kind} has no feedforward"

    @property
    def feedforward_in_use(self) -> str:
        return self.feedforward or "none"

    @property
    def label(self) -> str:
        is_fed = self.feedforward_in_use != "none"
        return f"{self.kind}+{self.feedforward}" if is_fed else self.kind


SAME = {"pi+ctc": "pi_ctc", "pi+id": "pi_id"}
"""Kinds of controllers by other names, which the kinds with `feedforward` have."""
_IN_PRINT = {
    "pi": "PI", "pi_ctc": "PI + CTC", "pi_id": "PI + ID", "pi_dob": "PI + DOB", "p_pi": "P-PI",
    "pi_scheduled": "scheduled PI", "inverse_dynamics": "inverse dynamics",
}  # fmt: skip


def canonical(label: str) -> str:
    """Return the label of a controller by which `pi+ctc` is `pi_ctc`, and `pi+id` is `pi_id`."""
    return SAME.get(label, label)


def in_print(label: str) -> str:
    """Return the name of a controller in figures and pages.

    >>> [in_print(label) for label in ("pi_ctc", "pi+ctc", "p_pi+id", "pi_ctc, again", "mine")]
    ['PI + CTC', 'PI + CTC', 'P-PI + ID', 'PI + CTC, again', 'mine']
    """
    name, comma, more = label.partition(", ")
    kind, plus, feedforward = canonical(name).partition("+")
    if kind not in _IN_PRINT:
        return label
    return _IN_PRINT[kind] + f" + {feedforward.upper()}" * bool(plus) + comma + more


def option_names(options: type[ControllerOptions]) -> tuple[str, ...]:
    """Return the names of the options that a controller takes and others may not."""
    common = {field.name for field in fields(ControllerOptions)}
    return tuple(field.name for field in fields(options) if field.name not in common)


CONTROLLERS: dict[str, type[ControllerOptions]] = {}
"""Options of all controllers by kind, shipped and registered; see `sdt_drake.run.controllers`."""

_loaded: dict[bytes, dict[str, type[ControllerOptions]]] = {}
"""Registered controllers by the content of the file that registered them."""


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
