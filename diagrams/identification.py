"""The identified device beside the file it began with.

    python diagrams/identification.py [FOLDER]

The real device of the scenario `real_device`, with frames 8 % heavier than its file says and
another pilot, flies exciting.yaml, which `sdt-drake excite` has made; its torques are recorded with
1 % of noise. Writes identification_plot.png into FOLDER, by default the folder of this script: the
torques that a training motion needs, and by how much the file and what was identified miss them.
"""

import sys
from pathlib import Path

import numpy as np

from sdt_drake.analysis.panels import Line, Panel, picture
from sdt_drake.analysis.style import PALETTE, Look, joint_title, save
from sdt_drake.design import make_design
from sdt_drake.deviation import Deviation
from sdt_drake.dynamics import inverse_dynamics
from sdt_drake.identification.model import identified_robot
from sdt_drake.identification.procedure import identify
from sdt_drake.identification.recordings import Recorded
from sdt_drake.motion import load_plan
from sdt_drake.scenario import load_scenario
from sdt_drake.simulate import simulate

HERE = Path(__file__).resolve().parent
NEEDED, FILE, IDENTIFIED = Look(PALETTE[0]), Look(PALETTE[7], "--"), Look(PALETTE[1])
TRUE = Deviation(
    payload_mass=18.0, payload_offset=[0.0, 0.03, 0.0265], link_scales=[1.08, 1.08, 1.08, 1.08, 1.0]
)


def main(folder: Path) -> None:
    scenario = load_scenario("real_device", {"motion": str(HERE / "exciting.yaml")})
    scenario.plant.deviation, scenario.controller.model = TRUE, Deviation()
    design = make_design(scenario)
    device, run = design.robot, simulate(design)
    tau = run.tau * device.gear_ratio
    noise = np.random.default_rng(0).normal(size=tau.shape)
    tau += 0.01 * np.sqrt(np.mean(tau**2, axis=0)) * noise
    recorded = Recorded(HERE / "exciting.csv", run.time, {"q": run.q, "tau": tau})
    identified = identified_robot(identify(design.nominal, [recorded]))

    motion = load_plan("coriolis").motion
    needed, file, found = (
        inverse_dynamics(robot, motion.q, motion.v, motion.vd)
        for robot in (device, design.nominal, identified)
    )
    torques, missed = [], []
    for k, name in enumerate(device.joint_names):
        line = [Line("what the device needs", NEEDED, needed[:, k])]
        torques.append(Panel(joint_title(k, name), "time [s]", "torque [N m]", motion.time, line))
        lines = [
            Line("missed by the file", FILE, (needed - file)[:, k]),
            Line("missed by what was identified", IDENTIFIED, (needed - found)[:, k]),
        ]
        missed.append(Panel("", "time [s]", "missed [N m]", motion.time, lines))
    title = "Torques of the links on the Coriolis motion; identified from another motion"
    save(picture(title, [torques, missed]), folder / "identification_plot.png")
    for name, torque in (("file", file), ("identified", found)):
        left = np.sqrt(np.mean((needed - torque) ** 2, axis=0) / np.mean(needed**2, axis=0))
        print(f"{name} misses {' '.join(f'{100 * x:.2f}' for x in left)} % of the RMS torque")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else HERE)
