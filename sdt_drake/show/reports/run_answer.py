"""The answer of a run: its largest errors, its motors, what the pilot feels, and its loops."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from sdt_drake.analysis.comparison import Compared
from sdt_drake.analysis.frequency_response import FrequencyResponse, frequency_response
from sdt_drake.analysis.metrics import plain_number
from sdt_drake.analysis.tracking import stops_passed
from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError
from sdt_drake.pilot.head import has_head
from sdt_drake.show.sections import Block, Marked, bullets, joined, prose, said
from sdt_drake.show.style import joint_title


@dataclass(frozen=True)
class Answer:
    """The largest errors of a run, its motors and its loops."""

    run: Compared
    response: FrequencyResponse | str
    """The linear analysis, or why there is none."""

    @property
    def has_head(self) -> bool:
        return has_head(self.run.design.device.simulated)

    def _joint(self, k: int) -> str:
        return joint_title(k, self.run.design.device.simulated.joint_names[k])

    def _worst(self, largest: Array, errors: Array) -> dict[str, Any]:
        """Return index, name, error and time of the joint with the largest error."""
        k = int(np.nanargmax(largest))
        time = self.run.recording.time[np.abs(errors[:, k]).argmax()]
        return {"k": k, "joint": self._joint(k), "error": largest[k], "time": time}

    @property
    def speed(self) -> dict[str, Any]:
        found = self.run.tracking.max_abs_speed_error
        return self._worst(found, self.run.recording.speed_error)

    @property
    def position(self) -> dict[str, Any]:
        found = np.degrees(self.run.tracking.max_abs_position_error)
        return self._worst(found, self.run.recording.position_error)

    @property
    def unstable(self) -> list[str]:
        if isinstance(self.response, str):
            return []
        return [self._joint(k) for k in np.flatnonzero(~self.response.stable).tolist()]

    @property
    def saturated(self) -> list[str]:
        return [
            f"joint {i} {plain_number(100 * share)} % of the time"
            for i, share in enumerate(self.run.tracking.saturated_fraction, 1)
            if share
        ]

    def lead(self) -> list[Block]:
        """Return the answer, and what to do next."""
        scenario, design = self.run.design.scenario, self.run.design
        state = "nothing saturates"
        advice = (
            "run `sdt-drake budget` on the scenario for the causes of the error, and `sdt-drake "
            "compare` for other controllers."
        )
        if self.unstable:
            state = "the loops are unstable"
            advice = (
                "lower `controller.omega_r`, and run `sdt-drake bode` on the scenario for the "
                "margins."
            )
        elif self.saturated:
            state = "motors saturate"
            advice = (
                "slow the motion down (`planner: retiming`), or run `sdt-drake size` for stronger "
                "motors."
            )
        answer = said(
            "**The largest speed error is {v[error]:.4g} rad/s ({v[joint]}), the largest position "
            "error {q[error]:.4g} deg ({q[joint]}); {}.**",
            state, v=self.speed, q=self.position,
        )  # fmt: skip
        motion, duration = Path(scenario.motion).stem, design.reference.planned.duration
        ran = said("{} on {}, {:g} s.", design.device.simulated.name, motion, duration)
        return [answer, said("Next: {} {}", Marked(advice), ran)]

    def in_short(self) -> Marked:
        """Return the result on speed, position, motors, pilot and loops, and notes, as a list."""
        run, speed, share = self.run, self.speed, self.run.motors.peak_share
        planned = np.abs(run.recording.v_ref[:, speed["k"]]).max()
        relative = speed["error"] / planned if planned > 0 else 0
        of_planned = said(": {:.1%} of the joint's largest planned speed", relative)
        k, saturated = int(np.nanargmax(share)), ", ".join(self.saturated)
        first = prose(
            "run_in_short", speed=speed, position=self.position, share=share[k],
            of_planned=of_planned if relative else "", used=self._joint(k),
            saturated=f"Saturated: {saturated}" if saturated else "No motor saturates",
        )  # fmt: skip
        return joined([first, bullets(self._more())], "\n")

    def _more(self) -> Iterator[Marked]:
        """Return the result on pilot and loops, and notes."""
        run = self.run
        if self.has_head:
            yield said(
                "**Pilot:** the error can be felt {:.1%} of the time; if only positions were "
                "wrong, {:.1%}.",
                run.head.felt.share, run.head.felt_from_angles.share,
            )  # fmt: skip
        if self.unstable:
            yield said("**Loops:** unstable in linear analysis: {}.", "; ".join(self.unstable))
        elif isinstance(self.response, FrequencyResponse):
            yield _margins(self.response)
        for line in stops_passed(run.recording, run.design.device.simulated.joint_names):
            yield said("**Note:** {}.", line)


def answer_of(run: Compared) -> Answer:
    """Return the answer of a run, with the linear analysis of its loops if there is one."""
    try:
        return Answer(run, frequency_response(run.design))
    except InputError as error:  # a user's controller that Drake cannot linearise
        return Answer(run, str(error))


def _margins(response: FrequencyResponse) -> Marked:
    """Return the smallest damping ratio and margins of stable loops."""
    damping, phase, gain = response.damping, response.phase_margin, response.gain_margins_db
    text = said(
        "**Loops:** all are stable. The smallest damping ratio is {:.2g} (joint {})",
        damping.min(), int(damping.argmin()) + 1,
    )  # fmt: skip
    if not np.isnan(phase).all():
        k = int(np.nanargmin(np.abs(phase)))
        of = "phase margin of a position loop" if response.at_positions else "phase margin"
        text = said("{}, the smallest {} {:.0f} deg (joint {})", text, of, phase[k], k + 1)
    if np.isnan(gain).all():
        return said("{}. Gain margins are unlimited.", text)
    place = int(np.nanargmin(np.abs(gain)))
    least = gain.flat[place]
    return said(
        "{}. The gain of joint {} may {} by {:.1f} dB.",
        text, place % gain.shape[-1] + 1, "rise" if least > 0 else "fall", abs(least),
    )  # fmt: skip
