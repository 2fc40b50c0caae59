"""The command `bode`."""

from __future__ import annotations

from typing import Annotated

import sdt_drake as sdt
from sdt_drake.cli import common
from sdt_drake.cli.common import Changes, Out, Scenario, Show, Trust, number
from sdt_drake.cli.printing import print_joints, say
from sdt_drake.io.results import RESULT_TABLES


def run(
    scenario: Scenario,
    /,
    *,
    time: Annotated[float | None, number(gte=0)] = None,
    out: Out = None,
    show: Show = False,
    changes: Changes = (),
    trust: Trust = False,
) -> None:
    """Tell the frequency response of each joint's loop: bandwidth, margins, peak.

    example: sdt-drake bode coupled_pi --out bode.png

    Args:
        time: linearise where the motion is at that time [s] (default: for each joint where its
            inertia is largest for the first time)
        out: the responses (.csv, .json), or a figure of them (.png, .svg, .pdf)
    """
    from sdt_drake.analysis.frequency_response import left_out

    common.check_out(out, show, RESULT_TABLES)
    design = common.design_of(scenario, changes)
    with common.naming_fields({"time": "--time"}):
        response = sdt.bode(design, time=time)
    chosen = design.scenario
    title = f"{chosen.name}: {chosen.controller.label}"
    say(f"{title} on the {chosen.plant.kind} plant")
    print_joints(design.robot.joint_names, response.columns())
    cut = f"the loop cut at {response.cut}"
    if response.at_positions:
        cut += f", sampled every {design.motion.period:g} s"
    say(f"speed of the link over its reference, without feedforward; {cut}")
    times = design.motion.time[response.sample]
    if time is None:
        joints = ", ".join(f"{t:.3f}" for t in times)
        say(f"linear at rest on the motion, where each joint's inertia is largest, at {joints} s")
    else:
        say(f"linear at rest where the motion is at {times[0]:.3f} s")
    for clause in left_out(design, response):
        say(f"note: {clause}")
    common.deliver(
        out,
        show,
        lambda: sdt.plots.bode(title, response, design.robot.joint_names),
        response.results(title).write,
    )
