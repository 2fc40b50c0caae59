"""Simulated robots with a truth that is known, their recordings, and faults put in on purpose."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from tempfile import mkdtemp

import numpy as np
from oracles.dh import KUKA_KR300, UR10, DhTable
from scipy.interpolate import make_interp_spline

from helpers.known_truth import changed
from helpers.random_robots import random_table
from sdt_drake.machine.recordings.recorded import Recorded
from sdt_drake.robot.deviation import Deviation, deviated
from sdt_drake.robot.dynamics import inverse_dynamics
from sdt_drake.robot.robot import Robot, load_robot

_RIGHT = np.pi / 2
ARM = DhTable(
    name="arm3",
    d=[0.4, 0.0, 0.0],
    a=[0.0, 0.5, 0.4],
    alpha=[_RIGHT, 0.0, 0.0],
    theta=[0.0] * 3,
    mass=[12.0, 8.0, 4.0],
    com=[(0.0, -0.1, 0.02), (-0.25, 0.0, 0.03), (-0.15, 0.01, 0.02)],
    radius=0.12,
    speed=[2.5, 2.5, 3.0],
    effort=[200.0, 200.0, 90.0],
    rotor_inertia=[1.5e-4, 1.5e-4, 6e-5],
    gear_ratio=[100.0, 120.0, 80.0],
)
COBOT = replace(
    UR10,
    name="cobot",
    mass=[7.1, 12.7, 4.27, 2.0, 2.0, 1.4],
    com=[*UR10.com[:5], (0.03, 0.02, -0.026)],
    rotor_inertia=[2e-4, 2e-4, 1e-4, 4e-5, 4e-5, 4e-5],
    gear_ratio=[101.0] * 6,
)
HEAVY = replace(KUKA_KR300, name="heavy", com=[*KUKA_KR300.com[:5], (0.08, 0.05, -0.1)])
TABLES = {"arm3": ARM, "cobot": COBOT, "heavy": HEAVY}
ROBOTS = ("sdt", *TABLES)
FILES = {name: Path(__file__).parent / f"robot_files/{name}.urdf" for name in ("six", "seven")}
MOUNTINGS = {"ceiling": (np.pi, 0.0, 0.0), "wall": (_RIGHT, 0.0, 0.0), "tilt": (0.35, 0.0, 0.0)}


@cache
def file_robot(name: str, mounting: str = "") -> Robot:
    """The robot of the file; mounted otherwise, as it really stands."""
    if name == "sdt":
        return load_robot()
    if name in FILES:
        return load_robot(FILES[name])
    table = TABLES[name] if name in TABLES else random_table(int(name.removeprefix("random")))
    return mounted(table, mounting)


def mounted(table: DhTable, mounting: str = "") -> Robot:
    """The robot of a table, with its base turned."""
    if mounting:
        roll, pitch, yaw = np.add(table.base, MOUNTINGS[mounting])
        table = replace(table, base=(roll, pitch, yaw))
    return load_robot(table.write(Path(mkdtemp())))


def tip(robot: Robot) -> str:
    """The last link, which carries tools."""
    last = robot.plant.GetJointByName(robot.joint_names[-1]).child_body().name()
    return "payload" if robot.name == "sdt" else last


def weight(robot: Robot) -> float:
    """The robot's mass [kg]."""
    return float(robot.plant.CalcTotalMass(robot.plant.CreateDefaultContext()))


@dataclass(frozen=True, eq=False)
class Truth:
    """What really moved.

    Attributes:
        robot: of the file.
        recorded: what was recorded, without any fault.
        v: speeds [rad/s], shape (N, n).
        friction: friction torque, joint side [N m], shape (N, n).
    """

    robot: Robot
    recorded: Recorded
    v: np.ndarray
    friction: np.ndarray


def course(robot: Robot, rng: np.random.Generator, seconds: float, rate: float):
    """Time, q, v, vd of random harmonics in all joints, from rest to rest."""
    time = np.arange(0, seconds, 1 / rate)
    omega = 2 * np.pi * np.arange(1, 6) / 10
    lower, upper = np.maximum(robot.position_lower, -2.0), np.minimum(robot.position_upper, 2.0)
    size = rng.uniform(0.3, 1, (robot.n, 5)) / np.arange(1, 6) ** rng.uniform(0.6, 1.2)
    waves = np.sin(omega * time[:, None, None] + rng.uniform(0, 6, (robot.n, 5)))
    q = np.sum(size * waves, axis=2)
    q *= rng.uniform(0.5, 0.9, robot.n) * (upper - lower) / 2 / np.abs(q).max(axis=0)
    fade = np.clip(np.minimum(time, time[-1] - time) / 2.0, 0, 1)
    fade = fade**3 * (10 - 15 * fade + 6 * fade**2)
    q = (lower + upper) / 2 + fade[:, None] * q
    spline = make_interp_spline(time, q, k=5)
    v = spline(time, 1)
    slower = np.abs(v).max() / 0.7 / np.minimum(robot.velocity_limit, 1.5).min()
    if slower > 1:  # the same, in more time
        time = slower * time
        even = np.arange(0, time[-1], 1 / rate)
        spline = make_interp_spline(time, q, k=5)
        return even, spline(even), spline(even, 1), spline(even, 2)
    return time, q, v, spline(time, 2)


def truth(name: str, seed: int, mounting: str = "", together: bool = False) -> Truth:
    """A recording of a robot that is not quite as its file: links, payload, friction, noise.

    All joints move alike if `together`.
    """
    robot = file_robot(name)
    rng = np.random.default_rng([seed, ROBOTS.index(name) if name in ROBOTS else 9])
    real = file_robot(name, mounting) if mounting else robot
    links = len(real.sdf.split("<link ")) - 1
    deviation = Deviation(
        payload=tip(robot),
        payload_mass=float(rng.uniform(0, 0.05)) * weight(robot),
        link_scales=rng.uniform(0.85, 1.2, links).tolist(),
    )
    real = deviated(real, deviation)
    rate = float(rng.choice([100.0, 125.0, 250.0, 500.0]))
    time, q, v, vd = course(robot, rng, 20.0, rate)
    if together:
        q = q[0] + (q - q[0])[:, :1]
        v, vd = (np.repeat(x[:, :1], robot.n, 1) for x in (v, vd))
    rigid = inverse_dynamics(real, q, v, vd)
    size, fast = np.sqrt(np.mean(rigid**2, axis=0)), np.abs(v).max(axis=0)
    size = np.maximum(size, 0.05 * size.max())
    coulomb = rng.uniform(0.03, 0.25, robot.n) * size
    viscous = rng.uniform(0.03, 0.25, robot.n) * size / fast
    more, slow = rng.uniform(0, 0.6, robot.n), rng.uniform(0.02, 0.08, robot.n)
    stribeck = 1 + more * np.exp(-((v / slow) ** 2))
    friction = coulomb * stribeck * np.tanh(v / 0.002) + viscous * v
    tau = rigid + friction + rng.uniform(-0.03, 0.03, robot.n) * size
    tau += rng.uniform(0.005, 0.02) * size * rng.normal(size=tau.shape)
    quantum = 2 * np.pi / 2.0 ** rng.integers(17, 21)
    signals = {"q": quantum * np.round(q / quantum), "tau": tau}
    if rng.random() < 0.5:
        signals["v"] = v + 0.01 * fast * rng.normal(size=v.shape)
    recorded = Recorded(Path(f"{name}{seed}.csv"), time, signals)
    return Truth(robot, recorded, v, friction)


def late(values: np.ndarray, time: np.ndarray, delay: float | np.ndarray) -> np.ndarray:
    """Signals that are recorded later than they were."""
    return np.stack([np.interp(time - delay, time, x) for x in values.T], axis=1)


Fault = Callable[[Truth, np.random.Generator], Recorded]


def _rows(recorded: Recorded, kept: np.ndarray) -> Recorded:
    signals = {name: values[kept] for name, values in recorded.signals.items()}
    return replace(recorded, time=recorded.time[kept], signals=signals)


def jitter(x: Truth, rng: np.random.Generator) -> Recorded:
    """Steps that vary by a third; the samples are those of their times."""
    time, period = x.recorded.time, float(np.median(np.diff(x.recorded.time)))
    other = time + rng.uniform(-0.3, 0.3, len(time)) * period
    other[[0, -1]] = time[[0, -1]]
    signals = {name: late(y, time, time - other) for name, y in x.recorded.signals.items()}
    return replace(x.recorded, time=other, signals=signals)


def logger_clock(x: Truth, rng: np.random.Generator) -> Recorded:
    """Times at which a logger wrote samples of an even clock, of which one in fifty is lost."""
    time, period = x.recorded.time, float(np.median(np.diff(x.recorded.time)))
    written = replace(x.recorded, time=time + rng.uniform(-0.3, 0.3, len(time)) * period)
    return missing(replace(x, recorded=written), rng)


def rounded(x: Truth, rng: np.random.Generator) -> Recorded:
    """Times in whole periods of four, so that they stand still for no sample: to a third."""
    time, period = x.recorded.time, float(np.median(np.diff(x.recorded.time)))
    tick = 0.4 * period
    return replace(x.recorded, time=tick * np.round(time / tick))


def missing(x: Truth, rng: np.random.Generator) -> Recorded:
    """One sample in fifty is not there."""
    kept = rng.random(len(x.recorded.time)) > 0.02
    kept[[0, -1]] = True
    return _rows(x.recorded, kept)


def repeated(x: Truth, rng: np.random.Generator) -> Recorded:
    """One row in thirty is that before it."""
    count = len(x.recorded.time)
    of = np.maximum(np.arange(count) - (rng.random(count) < 0.03), 0)
    return replace(_rows(x.recorded, of), time=x.recorded.time)


def held(x: Truth, rng: np.random.Generator) -> Recorded:
    """Torques are sampled at a quarter of the rate."""
    of = np.arange(len(x.recorded.time)) // 4 * 4
    return changed(x.recorded, tau=x.recorded.signals["tau"][of])


def _joint(x: Truth, rng: np.random.Generator) -> int:
    return int(rng.integers(x.robot.n))


def _frozen(name: str) -> Fault:
    """A signal of a joint stands for half a second while the joint moves."""

    def fault(x: Truth, rng: np.random.Generator) -> Recorded:
        values, k = np.array(x.recorded.signals[name]), _joint(x, rng)
        count = round(0.5 / np.median(np.diff(x.recorded.time)))
        fast = np.abs(x.v[:-count, k]) > 0.4 * np.abs(x.v[:, k]).max()
        start = int(rng.choice(np.flatnonzero(fast)))
        values[start : start + count, k] = values[start, k]
        return changed(x.recorded, **{name: values})

    return fault


frozen_q, frozen_tau = _frozen("q"), _frozen("tau")


def _all_frozen(name: str) -> Fault:
    """A signal of all joints stands for half a second in the middle of the motion."""

    def fault(x: Truth, rng: np.random.Generator) -> Recorded:
        values = np.array(x.recorded.signals[name])
        count = round(0.5 / np.median(np.diff(x.recorded.time)))
        fast = np.all(np.abs(x.v[:-count]) > 0.1 * np.abs(x.v).max(axis=0), axis=1)
        start = int(rng.choice(np.flatnonzero(fast)))
        values[start : start + count] = values[start]
        return changed(x.recorded, **{name: values})

    return fault


frozen_all_q, frozen_all_tau = _all_frozen("q"), _all_frozen("tau")


def clipped(x: Truth, rng: np.random.Generator) -> Recorded:
    """A torque is cut off at 60 % of its range."""
    tau, k = np.array(x.recorded.signals["tau"]), _joint(x, rng)
    low, high = tau[:, k].min(), tau[:, k].max()
    tau[:, k] = np.minimum(tau[:, k], low + 0.6 * (high - low))
    return changed(x.recorded, tau=tau)


def torque_late(x: Truth, rng: np.random.Generator) -> Recorded:
    """All torques are recorded 12 ms late."""
    return changed(x.recorded, tau=late(x.recorded.signals["tau"], x.recorded.time, 0.012))


def torque_of_one_late(x: Truth, rng: np.random.Generator) -> Recorded:
    """That of the second joint alone is 30 ms late."""
    tau = np.array(x.recorded.signals["tau"])
    tau[:, 1] = late(tau, x.recorded.time, 0.03)[:, 1]
    return changed(x.recorded, tau=tau)


def noisy_speeds(x: Truth, rng: np.random.Generator) -> np.ndarray:
    return x.v + 0.01 * np.abs(x.v).max(axis=0) * rng.normal(size=x.v.shape)


def speeds_in_degrees(x: Truth, rng: np.random.Generator) -> Recorded:
    """Speeds in degrees per second beside positions in radians."""
    return changed(x.recorded, v=np.degrees(noisy_speeds(x, rng)))


def speeds_of_motors(x: Truth, rng: np.random.Generator) -> Recorded:
    """Speeds of the motors beside positions of the joints."""
    return changed(x.recorded, v=noisy_speeds(x, rng) * x.robot.gear_ratio)


def speeds_late(x: Truth, rng: np.random.Generator) -> Recorded:
    """Speeds that a filter delays by 40 ms."""
    return changed(x.recorded, v=late(noisy_speeds(x, rng), x.recorded.time, 0.04))


def clock(x: Truth, rng: np.random.Generator) -> Recorded:
    """A clock that goes twice too fast beside speeds of the true one."""
    return replace(changed(x.recorded, v=noisy_speeds(x, rng)), time=x.recorded.time / 2)


def degrees(x: Truth, rng: np.random.Generator) -> Recorded:
    """Positions in degrees, no speeds."""
    signals = x.recorded.signals
    return replace(x.recorded, signals={"q": np.degrees(signals["q"]), "tau": signals["tau"]})


def of_motors(x: Truth, rng: np.random.Generator) -> Recorded:
    """Positions of the motors, no speeds."""
    return changed(x.recorded, q=x.robot.of_motors(x.recorded.signals["q"]))


def scaled(factor: float) -> Fault:
    """All torques in another unit."""
    return lambda x, rng: changed(x.recorded, tau=factor * x.recorded.signals["tau"])


def motor_side(x: Truth, rng: np.random.Generator) -> Recorded:
    """Torques of the motors, where those of the joints are meant."""
    return changed(x.recorded, tau=x.recorded.signals["tau"] / x.robot.gear_ratio)


def amperes(x: Truth, rng: np.random.Generator) -> Recorded:
    """Currents, of motors with other constants."""
    per = rng.uniform(7, 13, x.robot.n) * np.where(x.robot.effort_limit > 100, 1.4, 1.0)
    return changed(x.recorded, tau=x.recorded.signals["tau"] / per)


def per_mille(x: Truth, rng: np.random.Generator) -> Recorded:
    """Per mille of the rated torque, a third of the largest."""
    return changed(x.recorded, tau=3000 * x.recorded.signals["tau"] / x.robot.effort_limit)


def swapped(x: Truth, rng: np.random.Generator) -> Recorded:
    """The torques of joints 2 and 3 are swapped."""
    order = [0, 2, 1, *range(3, x.robot.n)]
    return changed(x.recorded, tau=x.recorded.signals["tau"][:, order])


def _shuffled(*names: str) -> Fault:
    """Columns of the joints moved on by one, that of the tip to the base."""

    def fault(x: Truth, rng: np.random.Generator) -> Recorded:
        order = np.roll(np.arange(x.robot.n), 1)
        return changed(x.recorded, **{name: x.recorded.signals[name][:, order] for name in names})

    return fault


shuffled, shuffled_torques, shuffled_positions = (
    _shuffled(*names) for names in (("q", "tau"), ("tau",), ("q",))
)


def reversed_order(x: Truth, rng: np.random.Generator) -> Recorded:
    """All columns from the tip to the base."""
    signals = {name: values[:, ::-1] for name, values in x.recorded.signals.items()}
    return replace(x.recorded, signals=signals)


def torque_sign(x: Truth, rng: np.random.Generator) -> Recorded:
    """A torque is counted the other way."""
    sign = np.where(np.arange(x.robot.n) == _joint(x, rng), -1, 1)
    return changed(x.recorded, tau=sign * x.recorded.signals["tau"])


def direction(x: Truth, rng: np.random.Generator) -> Recorded:
    """Position, speed and torque of a joint are counted the other way."""
    sign = np.where(np.arange(x.robot.n) == _joint(x, rng), -1, 1)
    signals = {name: sign * values for name, values in x.recorded.signals.items()}
    return replace(x.recorded, signals=signals)


def zero(x: Truth, rng: np.random.Generator) -> Recorded:
    """The zero of the second joint is off by 90 degrees."""
    off = np.where(np.arange(x.robot.n) == 1, _RIGHT * rng.choice([-1, 1]), 0.0)
    return changed(x.recorded, q=x.recorded.signals["q"] + off)


def drift(x: Truth, rng: np.random.Generator) -> Recorded:
    """Friction that is twice as large in the last third: another temperature."""
    later = x.recorded.time > x.recorded.time[-1] * 2 / 3
    return changed(x.recorded, tau=x.recorded.signals["tau"] + later[:, None] * x.friction)


def hysteresis(x: Truth, rng: np.random.Generator) -> Recorded:
    """A gear with springs and play at the second joint: friction builds up over 0.05 rad."""
    tau, q, k = np.array(x.recorded.signals["tau"]), x.recorded.signals["q"], 1
    built, z = np.zeros(len(q)), 0.0
    for i, step in enumerate(np.diff(q[:, k], prepend=q[0, k])):
        z = float(np.clip(z + step / 0.05, -1, 1))
        built[i] = z
    size = 0.3 * np.std(tau[:, k])
    tau[:, k] += size * (built - np.tanh(x.v[:, k] / 0.002))
    return changed(x.recorded, tau=tau)


def spring(x: Truth, rng: np.random.Generator) -> Recorded:
    """A counterbalance at the second joint: a spring across a triangle, as no link acts."""
    tau, q = np.array(x.recorded.signals["tau"]), x.recorded.signals["q"]
    angle = q[:, 1] - q[:, 1].mean()
    tau[:, 1] += 0.8 * np.std(tau[:, 1]) * angle**3 / np.std(angle**3)
    return changed(x.recorded, tau=tau)
