"""The result of a search: a motion near a flight, and other motions to compare."""

import math
from dataclasses import dataclass

from sdt_drake.io.deprecated import renamed
from sdt_drake.io.shown import Shown, Summary, formatted
from sdt_drake.machine.cueing.candidate import Candidate
from sdt_drake.motion.trajectory import Motion
from sdt_drake.pilot.orientation import Percept


@dataclass(frozen=True, eq=False, repr=False)
class CueingResult(Shown):
    """A motion near a flight in force and felt rotation, with other motions to compare."""

    chosen: Candidate
    """The best motion."""
    alignment: Candidate
    """The best alignment of the device with the flight's force."""
    washout: Candidate
    """The motion of a classical washout."""
    unlimited: Candidate | None
    """The best motion without limits of torque; None with `compare=False`."""
    front: tuple[tuple[float, Candidate], ...]
    """Weights of the G error over the given one, in increasing order, with their motions."""
    felt: Percept | None
    """The percept in flight; None if the model has no solution."""
    numbers: dict[str, object]
    """The content of summary.json."""

    @property
    def motion(self) -> Motion:
        """The best motion, from rest to rest."""
        return self.chosen.motion

    @property
    def candidates(self) -> list[Candidate]:
        """The best motion, and the motions to compare."""
        others = [self.alignment, self.washout, self.unlimited]
        return [self.chosen, *(one for one in others if one is not None)]

    @property
    def options(self) -> list[Candidate]:
        """`candidates`, under the name that goes in 0.7."""
        renamed("options", "candidates")
        return self.candidates

    def summary(self) -> Summary:
        header = ("", "G error [G]", "felt rotation error [deg/s]", "felt vertical [deg]",
                  "largest torque [%]")  # fmt: skip
        rows = []
        for one in self.candidates:
            figures = one.figures(self.felt)
            vertical, torque = figures["felt_vertical_rms_deg"], figures["torque_share_max"]
            angle = formatted(math.nan if vertical is None else vertical, ".1f")
            rows.append((one.name, f"{one.g_error:.3f}", f"{one.felt_rotation:.1f}", angle,
                         f"{100 * (torque or 0):.1f}"))  # fmt: skip
        flight = self.chosen.flight
        title = f"{flight.name}: RMS errors over {flight.duration:.6g} s of flight"
        return Summary(title, header, rows)
