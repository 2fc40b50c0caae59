"""Figure 3: decoupling of the inverse dynamics into load and alleviating torque.

    python diagrams/figure3.py [FOLDER]

Writes figure3.dot, figure3.svg (where Graphviz is installed) and figure3_plot.png into FOLDER, by
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
    design = make_design(load_scenario("package://sdt/scenarios/axis_pi.yaml"))
    write_block_diagram("figure3", design, folder)

    recording = simulate(design)
    figure = plots.torques(
        "Torques, motor side: PI on decoupled axes, Algorithm 1 as printed",
        recording,
        design.loads,
        design.robot,
    )
    save(figure, folder / "figure3_plot.png")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent)
