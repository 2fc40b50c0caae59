"""How fast the loops may be, with elastic joints.

    python diagrams/stability.py [FOLDER]

Writes stability_plot.png into FOLDER, by default the folder of this script.
"""

import copy
import sys
from pathlib import Path

from sdt_drake.analysis import plots
from sdt_drake.analysis.stability import IDEAL, stability_sweep
from sdt_drake.analysis.style import save
from sdt_drake.design import make_design
from sdt_drake.device import ENCODERS
from sdt_drake.scenario import load_scenario


def main(folder: Path) -> None:
    scenario = load_scenario("package://sdt/scenarios/real_device.yaml")
    cascade = copy.deepcopy(scenario)
    cascade.controller.kind = "p_pi"
    design = make_design(scenario)
    loops = {
        "pi, ideal drive": (design, IDEAL),
        "pi, sampled at 1 ms": (design, scenario.drive),
        "p_pi, ideal drive": (design.variant(cascade), IDEAL),
    }
    omega_r = scenario.controller.omega_r
    sweeps = {
        encoder: {
            label: stability_sweep(of, omega_r, encoder=encoder, drive=drive)
            for label, (of, drive) in loops.items()
        }
        for encoder in ENCODERS
    }
    figure = plots.stability(
        f"Loops tuned for ω_n, joints elastic with ω_r = {omega_r:.1f} rad/s",
        sweeps,
        design.robot.joint_names,
    )
    save(figure, folder / "stability_plot.png")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent)
