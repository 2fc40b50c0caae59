"""The command `bode`."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import sdt_drake as sdt
from sdt_drake.cli import common
from sdt_drake.cli.common import Flag, Given, Out, Scenario, Show, number
from sdt_drake.cli.printing import echo, print_joints
from sdt_drake.io.results import RESULT_TABLES
from sdt_drake.run.options import in_print

if TYPE_CHECKING:
    from sdt_drake.analysis.frequency_response import FrequencyResponse
    from sdt_drake.robot.robot import Robot as RobotModel


def run(
    scenario: Scenario,
    /,
    *,
    time: Annotated[float | None, number(gte=0)] = None,
    at_rest: Flag = False,
    out: Out = None,
    show: Show = False,
    given: Given = Given(),
) -> None:
    """Compute the frequency response of each joint's loop: bandwidth, margins, peak.

    example: sdt-drake bode coupled_pi --out bode.png

    Args:
        time: time of the motion at which to linearise [s] (default: for each joint where its
            inertia is largest for the first time)
        at_rest: linearise at the angles of that time, without the speeds
        out: file for the responses (.csv, .json), for a figure of them (.png, .svg, .pdf), or for
            a page with Nyquist curves, poles, zeros and singular values, too (.html)
    """
    from sdt_drake.analysis.frequency_response import left_out

    common.check_out(out, show, [*RESULT_TABLES, ".html"])
    design = common.design_of(scenario, given.changes)
    response = sdt.bode(design, time=time, at_rest=at_rest)
    chosen = design.scenario
    title = f"{chosen.name}: {in_print(chosen.controller.label)}"
    verdict = _verdict(response, design.device.simulated)
    echo(f"{chosen.summary().title}: {verdict}")
    columns = response.columns()
    columns.insert(1, ("[Hz]", ".3f", response.bandwidth / (2 * math.pi)))  # behind [rad/s]
    print_joints(design.device.simulated.joint_names, columns)
    cut = f"the loop is cut at {response.cut}"
    if response.at_positions:
        cut += f", sampled every {design.reference.tracked.period:g} s"
    notes = [f"The response is the link's speed over its reference, without feedforward; {cut}."]
    times = design.reference.tracked.time[response.sample]
    how = "at rest at the angles of the motion" if at_rest else "at angles and speeds of the motion"
    if time is None:
        joints = ", ".join(f"{t:.3f}" for t in times)
        notes += [f"Each joint is linearised {how} where its inertia is largest, at {joints} s."]
    else:
        notes += [f"All joints are linearised {how} at {times[0]:.3f} s."]
    notes += [f"note: {clause}" for clause in left_out(design, response)]
    for note in notes:
        echo(note)

    def write(path: Path) -> None:
        if path.suffix == ".html":
            from sdt_drake.show.reports.bode import write_bode_page

            write_bode_page(design, response, path, verdict, notes)
        else:
            response.results(title).write(path)

    names = design.device.simulated.joint_names
    common.deliver(out, show, lambda: sdt.plots.bode(title, response, names), write)


def _verdict(response: "FrequencyResponse", robot: "RobotModel") -> str:
    """Return whether the loops are stable, with the smallest margins and bandwidth."""
    import numpy as np

    if not response.stable.all():
        joints = ", ".join(robot.joint(k) for k in np.flatnonzero(~response.stable).tolist())
        return f"unstable: {joints}"
    parts = ["stable"]
    gain = 20 * np.log10(response.gain_margin)
    for name, values, unit in (
        ("phase margin", response.phase_margin, "deg"),
        ("gain margin", gain, "dB"),
        ("bandwidth", response.bandwidth, "rad/s"),
    ):
        if np.isinf(values).all():
            parts.append(f"{name} unlimited")
        elif not np.isnan(values).all():
            k = int(np.nanargmin(values))
            hertz = f" = {values[k] / (2 * np.pi):.3g} Hz" if unit == "rad/s" else ""
            parts.append(f"smallest {name} {values[k]:.4g} {unit}{hertz} ({robot.joint(k)})")
    return ", ".join(parts)
