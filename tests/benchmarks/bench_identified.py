"""How well the true device is found from one recording in which it moves for 30 s.

    python tests/benchmarks/bench_identified.py [SEEDS]

The truth: the shipped real_device with frames 8 % heavier, another pilot (18 kg more, 40 mm off),
other friction, and 1 % of noise on the torque. Prints what the findings in diagrams/README.md tell:
what of the torque is left on two training motions, friction, the payload alone, how often
intervals of 95 % hold the truth, and what two controllers make of the identified model.
"""

# ruff: noqa: E402

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path[:0] = [str(Path(__file__).parents[1])]

from helpers.known_truth import HEAVIER, PILOT

from sdt_drake.analysis.comparison import with_controller
from sdt_drake.machine.identify.base_parameters import rigid_parameters
from sdt_drake.machine.identify.model import identified_robot
from sdt_drake.machine.identify.procedure import identify
from sdt_drake.machine.recordings.recorded import Recorded
from sdt_drake.robot.deviation import Deviation
from sdt_drake.robot.device import Friction
from sdt_drake.robot.robot import load_robot
from sdt_drake.run.controllers import CONTROLLERS
from sdt_drake.run.design import make_design
from sdt_drake.run.scenario import load_scenario
from sdt_drake.run.simulate import simulate

EXCITING = str(Path(__file__).parents[2] / "diagrams" / "exciting.yaml")
TRUE = replace(PILOT, link_scales=HEAVIER.link_scales)
COULOMB, VISCOUS = np.array([350.0, 60.0, 60.0, 30.0]), np.array([180.0, 16.0, 20.0, 6.0])
FRICTION = Friction(
    coulomb=COULOMB.tolist(),
    viscous=VISCOUS.tolist(),
    breakaway=[500.0, 90.0, 90.0, 45.0],
    stribeck_speed=0.02,
)
NOISE = 0.01  # of the RMS of the torque


def truth(motion, kind="pi", deviation=TRUE):
    """The design of the true device along a motion."""
    changes = {"motion": motion, "plant.deviation": deviation, "plant.friction": FRICTION}
    changes["controller.model"] = Deviation()
    return make_design(with_controller(load_scenario("real_device", changes), kind))


def recorded_of(design, run, seed=0):
    """What encoders and drives tell, with noise on the torque, joint side."""
    rng, signals = np.random.default_rng(seed), {"q": run.q_measured}
    for name in ("tau", "tau_mean"):
        torque = getattr(run, name) * design.device.simulated.gear_ratio
        size = NOISE * np.sqrt(np.mean(torque**2, axis=0))
        signals[name] = torque + size * rng.normal(size=torque.shape)
    return Recorded(Path("truth.csv"), run.time, signals)


def told(name, values):
    print(f"  {name}: {' '.join(f'{100 * x:.3g}' for x in np.atleast_1d(values))} %")


def inside(nominal, design, run, seeds):
    """How often intervals of 95 % hold the truth, of base parameters and of friction."""
    links, friction = [], []
    for seed in range(seeds):
        found = identify(nominal, [recorded_of(design, run, seed)])
        beta = found.unknown.base.combination @ rigid_parameters(design.device.simulated)
        std = np.sqrt(np.diagonal(found.estimate.covariance))[: len(beta)]
        links.append(np.abs(found.estimate.beta - beta) < 1.96 * std)
        files = found.plant_friction
        off = np.array([files.friction.coulomb - COULOMB, files.friction.viscous - VISCOUS])
        friction.append(np.abs(off) < 1.96 * files.std)
    told(f"{len(links[0])} base parameters within 95 % intervals", np.mean(links))
    told("friction within 95 % intervals", np.mean(friction))


def weighed(nominal):
    """The payload alone, all else as in the file but friction."""
    design = truth(EXCITING, deviation=PILOT)
    run = simulate(design)
    for seed in range(3):
        found = identify(nominal, [recorded_of(design, run, seed)], only="payload")
        (link,), (pseudo,) = found.consistent.links, found.consistent.pseudo
        (mass, com, _), (was, centre, _) = link.inertial(pseudo), link.inertial(link.pseudo)
        off = np.linalg.norm(com - centre - PILOT.payload_offset)
        print(f"  payload +{mass - was:.2f} kg of {PILOT.payload_mass:g}, {1e3 * off:.2f} mm off")


def tracked(found, kind):
    """Largest position error with the identified model over that with the exact one."""
    true = truth("reference", kind)
    exact = truth("reference", kind, Deviation())
    exact = make_design(exact.scenario, robot=true.robot, motion=true.wanted)
    model = make_design(exact.scenario, robot=identified_robot(found), motion=exact.wanted)
    gains = {"kp": model.gains.kp.tolist(), "ki": model.gains.ki.tolist()}
    gains |= {"omega_r": None, "zeta": None}
    if "position_gain" in CONTROLLERS[kind.partition("+")[0]].options:
        gains["position_gain"] = model.position_gain.tolist()
    fields = {f"controller.{name}": x for name, x in gains.items()}
    own = exact.variant(exact.scenario.changed(fields)).with_feedforward(model.tau_ff)
    errors = [np.abs(simulate(x).position_error).max(axis=0) for x in (own, exact)]
    told(f"{kind}, error over that of the exact model", errors[0] / errors[1] - 1)


def main(seeds=100):
    nominal, design = load_robot(), truth(EXCITING)
    run, training = simulate(design), [truth(motion) for motion in ("coriolis", "g_excess")]
    held = [recorded_of(one, simulate(one), seed=1) for one in training]
    found = identify(nominal, [recorded_of(design, run)], validate=held)
    print(f"pi, below {found.cutoff:.1f} Hz, held against two training motions:")
    told("left held out", found.left(found.predicted, held_out=True))
    told("left by the file", found.left(found.equations.nominal, held_out=True))
    files = found.plant_friction
    for name, right, std in zip(("coulomb", "viscous"), (COULOMB, VISCOUS), files.std, strict=True):
        told(f"{name} off by", np.array(getattr(files.friction, name)) / right - 1)
        told("    its std", std / right)
    for kind in ("pi_ctc", "p_pi+id"):
        tracked(found, kind)
    weighed(nominal)
    inside(nominal, design, run, seeds)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
