"""The answer of a run: its largest errors, its motors, what the pilot feels, and its loops."""

from typing import Any

import numpy as np

from sdt_drake.analysis.comparison import Compared
from sdt_drake.analysis.frequency_response import FrequencyResponse
from sdt_drake.analysis.metrics import plain_number
from sdt_drake.analysis.tracking import stops_passed
from sdt_drake.io.arrays import Array
from sdt_drake.io.shown import listed
from sdt_drake.pilot.head import has_head
from sdt_drake.show.sections import Marked, bullets, said
from sdt_drake.show.style import joint_title

_NEXT = {
    "the loops are unstable": "lower `controller.omega_r`, and run `sdt-drake bode` on the "
    "scenario for the margins.",
    "motors saturate": "slow the motion down (`planner: retiming`), or run `sdt-drake size` for "
    "stronger motors.",
    "nothing saturates": "run {}`sdt-drake compare` for other controllers.",
}
"""The advice of a report, by the state of a run."""

_CAUSES = {
    "axis": "`sdt-drake budget` on the scenario for the causes of the error, and ",
    "coupled": "",  # whose errors are no sums of responses
}


def answer(run: Compared, response: FrequencyResponse | str) -> dict[str, Any]:
    """Return the answer of a run and what to do next, as values for its report.

    Args:
        run: the run.
        response: the linear analysis of its loops, or why there is none.
    """
    joints = run.design.device.simulated.joint_names
    names = [joint_title(k, x) for k, x in enumerate(joints)]

    def worst(largest: Array, errors: Array) -> dict[str, Any]:
        k = int(np.nanargmax(largest))
        time = run.recording.time[np.abs(errors[:, k]).argmax()]
        return {"k": k, "joint": names[k], "error": largest[k], "time": time}

    speed = worst(run.tracking.max_abs_speed_error, run.recording.speed_error)
    position = np.degrees(run.tracking.max_abs_position_error)
    planned = np.abs(run.recording.v_ref[:, speed["k"]]).max()
    relative = speed["error"] / planned if planned > 0 else 0
    share = run.motors.peak_share
    saturated = [
        f"joint {i} {plain_number(100 * x)} % of the time"
        for i, x in enumerate(run.tracking.saturated_fraction, 1)
        if x
    ]
    unstable = []
    if isinstance(response, FrequencyResponse):
        unstable = [names[k] for k in np.flatnonzero(~response.stable).tolist()]
    state = "motors saturate" if saturated else "nothing saturates"
    state = "the loops are unstable" if unstable else state
    return {
        "speed": speed,
        "position": worst(position, run.recording.position_error),
        "of_planned": said(": {:.1%} of the joint's largest planned speed", relative)
        if relative
        else "",
        "share": np.nanmax(share),
        "used": names[int(np.nanargmax(share))],
        "saturated": f"Saturated: {', '.join(saturated)}" if saturated else "No motor saturates",
        "state": state,
        "advice": Marked(_NEXT[state].format(_CAUSES[run.design.scenario.plant.kind])),
        "felt": run.head if has_head(run.design.device.simulated) else None,
        "unstable": "; ".join(unstable) or None,
        "margins": None if isinstance(response, str) or unstable else _margins(response),
        "notes": bullets(said("**Note:** {}.", x) for x in stops_passed(run.recording, joints))
        or None,
    }


def _margins(response: FrequencyResponse) -> Marked:
    """Return the smallest damping ratio and margins of stable loops."""
    damping, phase, gain = response.damping, response.phase_margin, response.gain_margins_db
    text = said(
        "all are stable. The smallest damping ratio is {:.2g} (joint {})",
        damping.min(), int(damping.argmin()) + 1,
    )  # fmt: skip
    if not np.isnan(phase).all():
        k = int(np.nanargmin(np.abs(phase)))
        of = "phase margin of a position loop" if response.at_positions else "phase margin"
        text = said("{}, the smallest {} {:.0f} deg (joint {})", text, of, phase[k], k + 1)
    if np.isnan(gain).all():
        return said("{}. The gain margins of all joints are unlimited.", text)
    place = int(np.nanargmin(np.abs(gain)))
    least = gain.flat[place]
    free = [str(k + 1) for k in np.flatnonzero(np.isnan(gain).all(axis=0))]
    joints = f"joint{'s' if len(free) > 1 else ''} {listed(free)}"
    others = f"; the gain margin of {joints} is unlimited" if free else ""
    return said(
        "{}. The gain of joint {} may {} by {:.1f} dB{}.",
        text, place % gain.shape[-1] + 1, "rise" if least > 0 else "fall", abs(least), others,
    )  # fmt: skip
