"""The coupled loop: the MultibodyPlant under PI, and under PI + CTC.

    python diagrams/coupled_loop.py [FOLDER]

Writes coupled_loop.dot, coupled_loop.svg (where Graphviz is installed) and coupled_loop_plot.png
into FOLDER, by default the folder of this script.
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
    runs = {}
    for label in ("pi", "pi_ctc"):
        design = make_design(load_scenario(f"package://sdt/scenarios/coupled_{label}.yaml"))
        runs[label] = simulate(design)
    write_block_diagram("coupled_loop", design, folder)

    figure = plots.speed_errors(
        "Speed errors on the coupled MultibodyPlant",
        runs,
        design.robot.joint_names,
        design.motion,
    )
    save(figure, folder / "coupled_loop_plot.png")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent)
