"""Figure 6: single joint CTC, with the true load differing from its model by 5 %.

    python diagrams/figure6.py [FOLDER]

Writes figure6.dot, figure6.svg (where Graphviz is installed) and figure6_plot.png into FOLDER, by
default the folder of this script.
"""

import sys
from pathlib import Path

from sdt_drake.analysis import plots
from sdt_drake.analysis.block_diagrams import write_block_diagram
from sdt_drake.analysis.style import save
from sdt_drake.design import make_design
from sdt_drake.scenario import load_scenario
from sdt_drake.simulate import simulate


def main(folder: Path) -> None:
    design = make_design(load_scenario("package://sdt/scenarios/axis_pi_ctc.yaml"))
    write_block_diagram("figure6", design, folder)

    figure = plots.speed_errors(
        "Speed errors, PI + CTC on decoupled axes, load disturbed by 5 %",
        {"pi_ctc": simulate(design)},
        design.robot.joint_names,
        design.motion,
    )
    save(figure, folder / "figure6_plot.png")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent)
