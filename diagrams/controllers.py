"""Controllers compared on the coupled plant.

    python diagrams/controllers.py [FOLDER]

Writes controllers_plot.png into FOLDER, by default the folder of this script.
"""

import sys
from pathlib import Path

from sdt_drake.analysis import plots
from sdt_drake.analysis.comparison import compare
from sdt_drake.analysis.style import save
from sdt_drake.design import make_design
from sdt_drake.scenario import load_scenario

LABELS = ("pi", "pi_ctc", "pi_id", "p_pi", "p_pi+id", "pi_scheduled", "inverse_dynamics")


def main(folder: Path) -> None:
    design = make_design(load_scenario("package://sdt/scenarios/coupled_pi.yaml"))
    figure = plots.comparison(
        "Controllers on the coupled MultibodyPlant, model known exactly", compare(design, LABELS)
    )
    save(figure, folder / "controllers_plot.png")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent)
