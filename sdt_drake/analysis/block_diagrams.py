"""The block diagrams of the paper: loops that are simulated, their inverse dynamics on line."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from pydrake.systems.framework import Diagram

from sdt_drake import paper
from sdt_drake.control import tune
from sdt_drake.design import Design
from sdt_drake.graphviz import has_graphviz, write_diagram
from sdt_drake.loops import make_axis_loop, make_coupled_loop, make_step_loop
from sdt_drake.scenario import load_scenario


def figure3(base: Design) -> Diagram:
    """Decoupling of the inverse dynamics: load and dynamic saturation around a PI controller."""
    return make_axis_loop(_online(base, "axis_pi"))


def figure4(base: Design) -> Diagram:
    """The loop of the red step response: both gains on the error."""
    return _step_loop(base, "pi")


def figure5(base: Design) -> Diagram:
    """The PI controller with its proportional gain in the feedback path, and its process."""
    return _step_loop(base, "p_in_feedback")


def figure6(base: Design) -> Diagram:
    """Single joint CTC: the load torque fed forward, the true load disturbed."""
    return make_axis_loop(_online(base, "axis_pi_ctc"))


def coupled_loop(base: Design) -> Diagram:
    """The MultibodyPlant under PI + CTC, with its load disturbed."""
    design = _online(base, "coupled_pi_ctc", disturbance_amplitude=0.05)
    return make_coupled_loop(design)


DIAGRAMS: dict[str, Callable[[Design], Diagram]] = {
    "figure3": figure3,
    "figure4": figure4,
    "figure5": figure5,
    "figure6": figure6,
    "coupled_loop": coupled_loop,
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


def _online(base: Design, name: str, disturbance_amplitude: float | None = None) -> Design:
    scenario = load_scenario(f"package://sdt/scenarios/{name}.yaml")
    scenario.inverse_dynamics = "online"
    if disturbance_amplitude is not None:
        scenario.disturbance.amplitude = disturbance_amplitude
    return base.variant(scenario)


def _step_loop(base: Design, structure: str) -> Diagram:
    i_eff = base.inertia.maximum[0]
    gains = tune([i_eff], paper.OMEGA_R, [paper.FIGURE4_ZETA[structure]])
    return make_step_loop(gains=gains, i_eff=i_eff, structure=structure)
