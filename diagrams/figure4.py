"""Figure 4: step responses of axis 1 with both structures of the PI controller.

    python diagrams/figure4.py [FOLDER]

Writes figure4.dot, figure4.svg (where Graphviz is installed) and figure4_plot.png into FOLDER, by
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
    write_block_diagram("figure4", design, folder)

    i_eff = design.inertia.maximum[0]
    steps = {
        structure: step_response(structure, zeta, i_eff, paper.OMEGA_R)
        for structure, zeta in paper.FIGURE4_ZETA.items()
    }
    figure = plots.step_responses("Step responses, axis 1 at its largest inertia", steps)
    save(figure, folder / "figure4_plot.png")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent)
