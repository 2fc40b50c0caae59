"""The result of a search: a motion near a flight, and other motions to compare."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from sdt_drake.io.deprecated import renamed
from sdt_drake.io.shown import Shown, Summary, formatted
from sdt_drake.machine.cueing.candidate import Candidate
from sdt_drake.machine.cueing.search import Errors
from sdt_drake.motion.trajectory import Motion
from sdt_drake.pilot.orientation import Percept


@dataclass(frozen=True, eq=False, repr=False)
class CueingResult(Shown):
    """A motion near a flight in force and felt rotation, with other motions to compare."""

    chosen: Candidate
    """The best motion."""
    rest: Candidate
    """The device at rest, tilted along the mean of the force that is felt in flight."""
    alignment: Candidate
    """The best alignment of the device with the flight's force."""
    washout: Candidate
    """The motion of a classical washout."""
    unlimited: Candidate | None
    """The best motion without limits of torque; None with `compare=False`."""
    front: tuple[tuple[float, Candidate], ...]
    """Motions within the limits that no found one excels, by G error, after the weight of G that
    they were found by; NaN for a baseline."""
    felt: Percept | None
    """The percept in flight; None if the model has no solution."""
    numbers: dict[str, object]
    """The content of summary.json."""
    online: tuple[Candidate, ...] = ()
    """Motions of an online cueing, which does not know what comes."""

    @property
    def motion(self) -> Motion:
        """The best motion, from rest to rest."""
        return self.chosen.motion

    @property
    def candidates(self) -> list[Candidate]:
        """The best motion, and the motions to compare."""
        others = [self.rest, self.alignment, self.washout, self.unlimited, *self.online]
        return [self.chosen, *(one for one in others if one is not None)]

    @property
    def answer(self) -> str:
        """Gains and losses of the motion against a device at rest and alignment, in words."""
        own, rest, alignment = (
            x.errors(self.felt) for x in (self.chosen, self.rest, self.alignment)
        )
        better, worse = _told(own, rest), _told(rest, own)
        if not better:
            return "no motion was found that is nearer to the flight than standing still"
        only = "only " * (better == [0])
        text = f"moving is nearer than standing still {only}in {_joined(own, rest, better)}"
        if worse:
            text += f", and farther in {_joined(own, rest, worse)}"
        if beaten := _told(alignment, own):
            text += f"; alignment is nearer in {_joined(alignment, own, beaten)}"
        return text

    @property
    def online_answer(self) -> str:
        """Loss of an online cueing against the best motion, and its cost, in words."""
        online = self.numbers["online"]
        assert isinstance(online, dict)
        own, program = self.chosen.errors(self.felt), self.online[0].errors(self.felt)
        cost, every = online["program"], range(len(own))
        usual, most = (100 * cost[f"computing_share_{x}"] for x in ("median", "max"))
        return (
            f"without knowing what comes, the online program has {_joined(program, own, every)};"
            f" a plan takes {usual:.0f} % of the {1000 * cost['period_s']:.0f} ms between plans,"
            f" {most:.0f} % at most, and {cost['kept_plans']} plans were not taken"
        )

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


_FIGURES = (("G", "{:.3f}", "G"), ("felt rotation", "{:.1f}", "deg/s"),
            ("felt vertical", "{:.1f}", "deg"))  # fmt: skip


def _told(errors: Errors, others: Errors) -> list[int]:
    """Return the indices of errors that are smaller than others in the digits that are told."""
    pairs = enumerate(zip(errors, others, _FIGURES, strict=True))
    return [k for k, (one, other, (_, form, _)) in pairs
            if float(form.format(one)) < float(form.format(other))]  # fmt: skip


def _joined(errors: Errors, others: Errors, which: Sequence[int]) -> str:
    """Return errors beside others in words."""
    words = []
    for k in which:
        name, form, unit = _FIGURES[k]
        words.append(f"{name} ({form} instead of {form} {unit})".format(errors[k], others[k]))
    return ", ".join(words[:-1]) + " and " * (len(words) > 1) + words[-1]
