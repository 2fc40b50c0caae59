"""The block diagrams of the paper, drawn from simulated loops with online inverse dynamics."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from pydrake.systems.framework import Diagram

from sdt_drake.paper.published import FIGURE4_ZETA, OMEGA_R
from sdt_drake.paper.step_loop import make_step_loop
from sdt_drake.run.design import Design
from sdt_drake.run.loop import make_loop
from sdt_drake.run.scenario import load_scenario
from sdt_drake.show.block_diagrams import page_of, write_page
from sdt_drake.systems.gains import STRUCTURES, tune


def _step_loop(structure: str, base: Design) -> Diagram:
    i_eff = base.inertia.maximum[0]
    gains = tune([i_eff], OMEGA_R, [FIGURE4_ZETA[structure]])
    return make_step_loop(gains=gains, i_eff=i_eff, setpoint_weight=STRUCTURES[structure])


def _loop(name: str, base: Design) -> Diagram:
    changes: dict[str, Any] = {"inverse_dynamics": "online"}
    if name.startswith("coupled"):
        changes["disturbance.amplitude"] = 0.05
    scenario = load_scenario(f"package://sdt/scenarios/{name}.yaml", changes)
    return make_loop(base.variant(scenario)).diagram


DIAGRAMS: dict[str, Callable[[Design], Diagram]] = {
    "figure3": partial(_loop, "axis_pi"),
    "figure4": partial(_step_loop, "pi"),
    "figure5": partial(_step_loop, "p_in_feedback"),
    "figure6": partial(_loop, "axis_pi_ctc"),
    "coupled_loop": partial(_loop, "coupled_pi_ctc"),
}
"""Functions that make the diagrams, by name, from a design of the reference device and motion."""


def write_block_diagram(name: str, base: Design, folder: str | Path) -> list[Path]:
    """Write one of DIAGRAMS as name.dot and name.svg.

    Args:
        name: a key of DIAGRAMS.
        base: a design of the reference device and motion.
        folder: created if it is missing.
    """
    page, path = page_of(DIAGRAMS[name](base)), Path(folder) / name
    return [write_page(page, path.with_suffix(f".{x}"), x) for x in ("dot", "svg")]
