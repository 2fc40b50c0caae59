"""How well the true device is found from one recording in which it moves for 30 s.

    python tests/benchmarks/bench_identified.py [SEEDS]

The truth: the shipped real_device with frames 8 % heavier, another pilot (18 kg more, 40 mm off),
other friction, and 1 % of noise on the torque. Prints what the findings in diagrams/README.md tell:
what of the torque is left on two training motions, friction, the payload alone, how often
intervals of 95 % hold the truth, and what two controllers make of the identified model.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import cast

import numpy as np

from sdt_drake.analysis.comparison import with_controller
from sdt_drake.io.arrays import Array
from sdt_drake.machine.identify.base_parameters import rigid_parameters
from sdt_drake.machine.identify.model import identified_robot, plant_friction
from sdt_drake.machine.identify.procedure import Identified, identify
from sdt_drake.machine.recordings import Recorded
from sdt_drake.robot.deviation import Deviation
from sdt_drake.robot.device import Friction
from sdt_drake.robot.robot import Robot, load_robot
from sdt_drake.run.design import Design, make_design
from sdt_drake.run.kinds import CONTROLLERS
from sdt_drake.run.scenario import Scenario, load_scenario, with_fields
from sdt_drake.run.simulate import Recording, simulate

EXCITING = str(Path(__file__).parents[2] / "diagrams" / "exciting.yaml")
TRUE = Deviation(
    payload_mass=18.0, payload_offset=[0.0, 0.03, 0.0265], link_scales=[1.08, 1.08, 1.08, 1.08, 1.0]
)
FRICTION = Friction(
    coulomb=[350.0, 60.0, 60.0, 30.0],
    viscous=[180.0, 16.0, 20.0, 6.0],
    breakaway=[500.0, 90.0, 90.0, 45.0],
    stribeck_speed=0.02,
)
NOISE = 0.01  # of the RMS of the torque


def truth(motion: str, kind: str = "pi", deviation: Deviation = TRUE) -> Scenario:
    scenario = with_controller(load_scenario("real_device", {"motion": motion}), kind)
    scenario.plant.deviation, scenario.plant.friction = deviation, FRICTION
    scenario.controller.model = Deviation()
    return scenario


def flown(motion: str, deviation: Deviation = TRUE) -> tuple[Design, Recording]:
    design = make_design(truth(motion, deviation=deviation))
    return design, simulate(design)


def recorded_of(design: Design, run: Recording, seed: int = 0) -> Recorded:
    """What encoders and drives tell, with noise on the torque, joint side."""
    rng, signals = np.random.default_rng(seed), {"q": run.q_measured}
    for name in ("tau", "tau_mean"):
        torque = getattr(run, name) * design.robot.gear_ratio
        size = NOISE * np.sqrt(np.mean(torque**2, axis=0))
        signals[name] = torque + size * rng.normal(size=torque.shape)
    return Recorded(Path("truth.csv"), run.time, signals)


def told(name: str, values: Array) -> None:
    print(f"  {name}: {' '.join(f'{100 * x:.3g}' for x in np.atleast_1d(values))} %")


def inside(nominal: Robot, design: Design, run: Recording, seeds: int) -> None:
    """How often intervals of 95 % hold the truth, of base parameters and of friction."""
    links, friction = [], []
    for seed in range(seeds):
        found = identify(nominal, [recorded_of(design, run, seed)])
        beta = found.unknown.base.combination @ rigid_parameters(design.robot)
        std = np.sqrt(np.diagonal(found.estimate.covariance))[: len(beta)]
        links.append(np.abs(found.estimate.beta - beta) < 1.96 * std)
        files = plant_friction(found)
        values = np.array([files.friction.coulomb, files.friction.viscous])
        wanted = np.array([FRICTION.coulomb, FRICTION.viscous])
        friction.append(np.abs(values - wanted) < 1.96 * files.std)
    told(f"{len(links[0])} base parameters within 95 % intervals", np.mean(links))
    told("friction within 95 % intervals", np.mean(friction))


def weighed(nominal: Robot) -> None:
    """The payload alone, all else as in the file but friction."""
    design, run = flown(EXCITING, deviation=replace(TRUE, link_scales=None))
    for seed in range(3):
        found = identify(nominal, [recorded_of(design, run, seed)], only="payload")
        (link,), (pseudo,) = found.consistent.links, found.consistent.pseudo
        (mass, com, _), (was, centre, _) = link.inertial(pseudo), link.inertial(link.pseudo)
        off = np.linalg.norm(com - centre - TRUE.payload_offset)
        print(f"  payload +{mass - was:.2f} kg of {TRUE.payload_mass:g}, {1e3 * off:.2f} mm off")


def tracked(found: Identified, kind: str) -> None:
    """Largest position error with the identified model over that with the exact one."""
    true = make_design(truth("reference", kind))
    exact = make_design(truth("reference", kind, Deviation()), robot=true.robot, motion=true.wanted)
    model = make_design(exact.scenario, robot=identified_robot(found), motion=exact.wanted)
    gains = {"kp": model.gains.kp.tolist(), "ki": model.gains.ki.tolist()}
    gains |= {"omega_r": None, "zeta": None}
    if "position_gain" in CONTROLLERS[exact.scenario.controller.kind].options:
        gains["position_gain"] = model.position_gain.tolist()
    fields = {f"controller.{k}": x for k, x in gains.items()}
    own = exact.variant(with_fields(exact.scenario, fields))
    own = own.with_feedforward(cast(Array, model.tau_ff))
    errors = [np.abs(simulate(x).position_error).max(axis=0) for x in (own, exact)]
    told(f"{kind}, error over that of the exact model", errors[0] / errors[1] - 1)


def main(seeds: int) -> None:
    nominal = load_robot()
    design, run = flown(EXCITING)
    training = [recorded_of(*flown(motion), seed=1) for motion in ("coriolis", "g_excess")]
    found = identify(nominal, [recorded_of(design, run)], validate=training)
    print(f"pi, below {found.cutoff:.1f} Hz, held against two training motions:")
    told("left held out", found.left(found.predicted, held_out=True))
    told("left by the file", found.left(found.equations.nominal, held_out=True))
    files = plant_friction(found)
    for name, std in zip(("coulomb", "viscous"), files.std, strict=True):
        wanted = np.array(getattr(FRICTION, name))
        told(f"{name} off by", np.array(getattr(files.friction, name)) / wanted - 1)
        told("    its std", std / wanted)
    for kind in ("pi_ctc", "p_pi+id"):
        tracked(found, kind)
    weighed(nominal)
    inside(nominal, design, run, seeds)


if __name__ == "__main__":
    main(int([*sys.argv, 100][1]))
