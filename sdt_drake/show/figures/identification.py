"""Figures of an identified robot: torques, torque not explained, and friction."""

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from sdt_drake.io.arrays import Array
from sdt_drake.machine.identify.plant import PlantFriction
from sdt_drake.machine.identify.procedure import Identified
from sdt_drake.robot.device import friction_parameters, sliding_friction
from sdt_drake.show.figures.scope import ERROR
from sdt_drake.show.panels import Line, Panel, over_time, picture
from sdt_drake.show.style import PALETTE, Look, joint_title

MEASURED, PREDICTED, NOMINAL = Look(PALETTE[0]), Look(PALETTE[1], "--"), Look(PALETTE[7], ":")

_MAX_DOTS = 800  # of a joint, as each is an element of the .svg


def torques_figure(found: Identified) -> Figure:
    """Draw measured and predicted torques, and the torque not explained, a row for each joint."""
    eq, time = found.equations, _running_time(found)
    lines = [
        ("measured", MEASURED, eq.tau),
        ("identified", PREDICTED, found.written),
        ("file as it is", NOMINAL, eq.nominal),
    ]
    left = [("measured - identified", ERROR, eq.tau - found.written)]
    names, held = found.nominal.joint_names, dict[str, Any](marked=~eq.fit[:, None])
    held["marked_label"] = "held out"
    torques = over_time("torque [N m], joint side", time, lines, names, **held)
    errors = over_time("not explained\n[N m], joint side", time, left, **held)
    return picture(f"{found.nominal.name} identified: torques, joint side", [torques, errors])


def residuals_figure(found: Identified, files: PlantFriction) -> Figure:
    """Draw the torque not explained, and friction, over the speed of each joint.

    Two friction laws are drawn. Noise may make that of the fit drive the joint; that of the table
    and of the scenario never does.
    """
    eq, estimate = found.equations, found.estimate
    laws, errors = [], []
    own, damping = friction_parameters(files.friction, eq.n), files.damping
    for k, name in enumerate(found.nominal.joint_names):
        order = np.argsort(eq.speed[:, k])[:: 1 + len(eq.v) // _MAX_DOTS]
        v = eq.speed[order, k]
        left = (eq.tau - found.written)[order, k]
        errors.append(
            Panel(joint_title(k, name), "speed [rad/s]", "not explained\n[N m], joint side", v,
                  [Line("measured - identified", ERROR, left, dots=True)])
        )  # fmt: skip
        grid = np.linspace(v[0], v[-1], 400)
        terms = np.column_stack([term.at(grid, 1e-3) for term in estimate.laws[k].terms])
        torque = terms @ found.friction[estimate.friction_of(k)]
        in_files = sliding_friction(own, grid[:, None] * np.ones(eq.n)) + np.outer(grid, damping)
        law = [
            Line("friction in table and scenario", MEASURED, in_files[:, k]),
            Line("friction of the fit", PREDICTED, torque),
        ]
        laws.append(Panel("", "speed [rad/s]", "friction [N m], joint side", grid, law))
    return picture(
        f"{found.nominal.name} identified: torque not explained, and friction, over speed",
        [errors, laws],
    )


def _running_time(found: Identified) -> Array:
    """Return the time of all samples, one recording after the other [s], shape (M,)."""
    eq, begin = found.equations, 0.0
    time = np.array(eq.time)
    for source, recorded in enumerate(found.recordings):
        time[eq.source == source] += begin
        begin += recorded.time[-1]
    return time
