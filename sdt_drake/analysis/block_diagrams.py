"""The block diagrams of the paper: loops that are simulated, their inverse dynamics on line."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from pydrake.systems.framework import Diagram

from sdt_drake import paper
from sdt_drake.control import tune
from sdt_drake.design import Design
from sdt_drake.graphviz import has_graphviz, write_diagram
from sdt_drake.loops import make_loop, make_step_loop
from sdt_drake.scenario import load_scenario


def _step_loop(structure: str) -> Callable[[Design], Diagram]:
    def make(base: Design) -> Diagram:
        i_eff = base.inertia.maximum[0]
        gains = tune([i_eff], paper.OMEGA_R, [paper.FIGURE4_ZETA[structure]])
        return make_step_loop(gains=gains, i_eff=i_eff, structure=structure)

    return make


def _loop(name: str, disturbance_amplitude: float | None = None) -> Callable[[Design], Diagram]:
    def make(base: Design) -> Diagram:
        scenario = load_scenario(f"package://sdt/scenarios/{name}.yaml")
        scenario.inverse_dynamics = "online"
        if disturbance_amplitude is not None:
            scenario.disturbance.amplitude = disturbance_amplitude
        return make_loop(base.variant(scenario))

    return make


DIAGRAMS: dict[str, Callable[[Design], Diagram]] = {
    "figure3": _loop("axis_pi"),
    "figure4": _step_loop("pi"),
    "figure5": _step_loop("p_in_feedback"),
    "figure6": _loop("axis_pi_ctc"),
    "coupled_loop": _loop("coupled_pi_ctc", disturbance_amplitude=0.05),
}
"""The diagrams by name, made from any design of the reference device and motion."""

CAPTIONS = {
    "figure3": "Decoupled axes with load torque and dynamic saturation (Figure 3).",
    "figure4": "PI controller on the error (Figure 4).",
    "figure5": "PI controller with its proportional gain in the feedback path (Figure 5).",
    "figure6": "Single joint CTC: the load torque fed forward, the true load disturbed (Figure 6).",
    "coupled_loop": "The MultibodyPlant under PI + CTC, with its load disturbed.",
}


def write_block_diagram(name: str, base: Design, folder: str | Path) -> list[Path]:
    """Write one of DIAGRAMS as name.dot, and name.svg where Graphviz is installed.

    Args:
        name: a key of DIAGRAMS.
        base: any design of the reference device and motion.
        folder: made if need be.
    """
    diagram = DIAGRAMS[name](base)
    formats = ("dot", "svg") if has_graphviz() else ("dot",)
    return [
        write_diagram(diagram, Path(folder) / f"{name}.{format_}", format_=format_)
        for format_ in formats
    ]
