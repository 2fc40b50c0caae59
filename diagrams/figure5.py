"""Figure 5: the PI controller with its proportional gain in the feedback path.

    python diagrams/figure5.py [FOLDER]

Writes figure5.dot, figure5.svg (where Graphviz is installed) and figure5_plot.png into FOLDER, by
default the folder of this script.
"""

import sys
from pathlib import Path

from sdt_drake import paper
from sdt_drake.analysis import plots
from sdt_drake.analysis.block_diagrams import write_block_diagram
from sdt_drake.analysis.reproduction import step_response
from sdt_drake.analysis.style import save
from sdt_drake.design import make_design
from sdt_drake.scenario import load_scenario


def main(folder: Path) -> None:
    design = make_design(load_scenario("package://sdt/scenarios/coupled_pi.yaml"))
    write_block_diagram("figure5", design, folder)

    zeta, i_eff = paper.FIGURE4_ZETA["p_in_feedback"], design.inertia.maximum[0]
    step = step_response("p_in_feedback", zeta, i_eff, paper.OMEGA_R)
    title = "Step response, axis 1, P in the feedback path"
    figure = plots.step_responses(title, {step.structure: step})
    save(figure, folder / "figure5_plot.png")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent)
