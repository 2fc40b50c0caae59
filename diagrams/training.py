"""Every training motion that ships with the package, simulated: what the pilot feels of it.

    python diagrams/training.py [FOLDER] [--only NAME ...] [--record]

Writes a figure for each motion into FOLDER, by default the folder of this script:
training_coriolis_plot.png, training_g_excess_plot.png, training_graveyard_spin_plot.png,
training_graveyard_spiral_plot.png, training_inversion_plot.png, training_leans_plot.png,
training_post_roll_plot.png, training_somatogravic_plot.png; with --record also training_NAME.html,
the device in 3D, which plays in any browser.
"""

import argparse
from pathlib import Path

from sdt_drake.analysis import plots_pilot
from sdt_drake.analysis.style import save
from sdt_drake.analysis.tracking import track_head
from sdt_drake.design import make_design
from sdt_drake.motion import shipped_motions, story_of
from sdt_drake.scenario import load_scenario
from sdt_drake.simulate import simulate
from sdt_drake.viewer import record_html


def main(folder: Path, names: list[str], *, record: bool) -> None:
    scenario = load_scenario("package://sdt/scenarios/training.yaml")
    for name in names:
        scenario.motion = name
        design = make_design(scenario)
        run = simulate(design)
        story = story_of(name, design.robot, design.motion)
        head = track_head(run, design.robot)
        figure = plots_pilot.pilot(name, run.time, head, story)
        save(figure, folder / f"training_{name}_plot.png")
        if record:
            record_html(
                design.robot, run.time, run.q, folder / f"training_{name}.html", story=story
            )


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("folder", nargs="?", type=Path, default=Path(__file__).parent)
    parser.add_argument("--only", nargs="+", choices=shipped_motions(), default=shipped_motions())
    parser.add_argument("--record", action="store_true")
    options = parser.parse_args()
    main(options.folder, options.only, record=options.record)
