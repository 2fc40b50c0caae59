"""How fast the speed loops may be, with elastic joints.

    python diagrams/stability.py [FOLDER]

Writes stability_plot.png into FOLDER, by default the folder of this script.
"""

import sys
from pathlib import Path

from sdt_drake import paper
from sdt_drake.analysis import plots
from sdt_drake.analysis.stability import stability_sweep
from sdt_drake.design import make_design
from sdt_drake.device import ENCODERS
from sdt_drake.scenario import load_scenario


def main(folder: Path) -> None:
    design = make_design(load_scenario("package://sdt/scenarios/real_device.yaml"))
    drives = {"ideal drive": None, "sampled at 1 ms": design.scenario.drive}
    sweeps = {
        encoder: {
            label: stability_sweep(design, paper.OMEGA_R, encoder=encoder, drive=drive)
            for label, drive in drives.items()
        }
        for encoder in ENCODERS
    }
    figure = plots.stability(
        "Speed loops tuned for omega_n, joints elastic with omega_r = 66 rad/s",
        sweeps,
        design.robot.joint_names,
    )
    plots.save(figure, folder / "stability_plot.png")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent)
