"""What the two shipped studies say, from their folders:

    sdt-drake study package://sdt/studies/monte_carlo.yaml --workers 2 --out mc
    sdt-drake size package://sdt/studies/sizing.yaml --workers 2 --out sizing
    python diagrams/studies.py mc sizing [FOLDER]

Writes monte_carlo_plot.png and sizing_plot.png into FOLDER, by default the folder of this script.
The studies take about a quarter of an hour each on two cores.
"""

import sys
from pathlib import Path

from sdt_drake.analysis.style import save
from sdt_drake.studies.plots import distributions
from sdt_drake.studies.plots_front import sizing_front
from sdt_drake.studies.results import read_study_table
from sdt_drake.studies.sizing import load_sizing
from sdt_drake.studies.verdicts import judge_candidates

OUTCOMES = ("max_abs_speed_error", "max_abs_position_error")


def main(monte_carlo: Path, sizing: Path, folder: Path) -> None:
    table = read_study_table(monte_carlo)
    title = "Devices that are not what their controllers know: share that stays below an error"
    save(distributions(title, table, OUTCOMES, "controller"), folder / "monte_carlo_plot.png")
    what, _ = load_sizing("package://sdt/studies/sizing.yaml")
    verdicts = judge_candidates(what, read_study_table(sizing))
    title = "Motor sets and structures, each in all motions"
    save(sizing_front(title, verdicts), folder / "sizing_plot.png")


if __name__ == "__main__":
    if len(sys.argv) < 3:
        sys.exit(__doc__)
    monte_carlo, sizing, *folder = map(Path, sys.argv[1:])
    main(monte_carlo, sizing, folder[0] if folder else Path(__file__).parent)
