"""Further faults of simulated recordings, for the benchmark of suspicions."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from oracles.dh import DATA, KUKA_KR300, UR10

from helpers.known_truth import changed
from helpers.simulated_recordings import (
    Fault,
    Truth,
    late,
    mounted,
    noisy_speeds,
    tip,
    truth,
    weight,
)
from sdt_drake.machine.recordings.columns import Columns
from sdt_drake.machine.recordings.reading import read_recording
from sdt_drake.machine.recordings.recorded import Recorded
from sdt_drake.robot.deviation import Deviation, deviated
from sdt_drake.robot.dynamics import inverse_dynamics
from sdt_drake.robot.robot import Robot


def real(name: str, mounting: str = "") -> Truth:
    """A published recording, of a robot whose file has another mounting; friction is unknown."""
    table, path = REAL[name]
    robot = mounted(table, mounting)
    columns = None
    if name == "kuka":
        columns = Columns(q=["q_motor_{k}"], tau=["motor_torque_{k}"], side="motor", v=[])
    recorded = read_recording(DATA / path, robot, columns)
    v = np.gradient(recorded.signals["q"], recorded.time, axis=0)
    return Truth(robot, recorded, v, np.zeros_like(v))


def _of(name: str, change) -> Fault:
    """One signal changed."""
    return lambda x, rng: changed(x.recorded, **{name: change(x, x.recorded.signals[name], rng)})


def _swap(values: np.ndarray, j: int, k: int) -> np.ndarray:
    order = np.arange(values.shape[1])
    order[[j, k]] = k, j
    return values[:, order]


def _every(change) -> Fault:
    """All signals changed alike."""

    def fault(x: Truth, rng: np.random.Generator) -> Recorded:
        signals = {name: change(y) for name, y in x.recorded.signals.items()}
        return replace(x.recorded, signals=signals)

    return fault


def _without_speeds(name: str, change) -> Fault:
    def fault(x: Truth, rng: np.random.Generator) -> Recorded:
        signals = {key: y for key, y in x.recorded.signals.items() if key != "v"}
        signals[name] = change(x, signals[name], rng)
        return replace(x.recorded, signals=signals)

    return fault


def _of_one(values: np.ndarray, k: int, factor: float) -> np.ndarray:
    return values * np.where(np.arange(values.shape[1]) == k, factor, 1.0)


def _speeds(factor) -> Fault:
    """Noisy speeds, times a factor of each joint."""
    return lambda x, rng: changed(x.recorded, v=factor(x) * noisy_speeds(x, rng))


def _low_pass(values: np.ndarray, time: np.ndarray, seconds: float) -> np.ndarray:
    """A filter of first order."""
    share, out = 1 - np.exp(-np.median(np.diff(time)) / seconds), values.copy()
    for i in range(1, len(out)):
        out[i] = out[i - 1] + share * (values[i] - out[i - 1])
    return out


def _gravity(x: Truth) -> np.ndarray:
    q = x.recorded.signals["q"]
    return inverse_dynamics(x.robot, q, 0 * q, 0 * q)


def _offset(x: Truth, degrees: float, k: int) -> np.ndarray:
    return np.where(np.arange(x.robot.n) == k, np.radians(degrees), 0.0)


def _coupled(x: Truth, tau: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """The last motor also turns with the joint before; its friction is at the motor."""
    v, rubs = x.v[:, -1] + x.v[:, -2], 0.3 * np.std(tau[:, -1])
    motor = rubs * (np.tanh(v / 0.002) + v / np.abs(v).max())
    own = np.column_stack([motor, motor - x.friction[:, -1]])
    return np.column_stack([tau[:, :-2], tau[:, -2:] + own])


def _saturated(x: Truth, tau: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """The second torque stops at 70 % of its range on both sides."""
    most = 0.7 * np.abs(tau[:, 1]).max()
    return np.column_stack([tau[:, :1], np.clip(tau[:, 1], -most, most), tau[:, 2:]])


def _picked(x: Truth, tau: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """A tool is picked up after two thirds: torques of a point mass at the last link."""
    later = x.recorded.time > x.recorded.time[-1] * 2 / 3
    return tau + later[:, None] * _added(x, 0.2)


def _added(x: Truth, share: float, offset: Sequence[float] = (0.0, 0.0, 0.0)) -> np.ndarray:
    """Torques of more mass at the last link, a share of the robot's, and of its shifted centre."""
    own = Deviation(payload=tip(x.robot), payload_mass=share * weight(x.robot),
                    payload_offset=list(offset))  # fmt: skip
    q, v = x.recorded.signals["q"], x.v
    vd = np.gradient(v, x.recorded.time, axis=0)
    more = deviated(x.robot, own)
    return inverse_dynamics(more, q, v, vd) - inverse_dynamics(x.robot, q, v, vd)


def with_tool(name: str, share: float) -> tuple[Robot, Recorded]:
    """A robot, and a recording of it with a tool that its file lacks, a share of its mass."""
    x = real(name) if name in REAL else truth(name, 100)
    tau = x.recorded.signals["tau"] + _added(x, share, (0.2, 0.1, 0.1))
    return x.robot, changed(x.recorded, tau=tau)


REAL = {"ur10": (UR10, "ur10/exciting.csv"), "kuka": (KUKA_KR300, "kuka_kr300/recording_A.csv")}
UNREAL = {"drift", "coupled_motors"}
"""Faults that need the friction, which real recordings do not tell."""

MORE = {
    "percent": _of("tau", lambda x, y, rng: 300 * y / x.robot.effort_limit),
    "swapped_at_wrist": _of("tau", lambda x, y, rng: _swap(y, x.robot.n - 2, x.robot.n - 1)),
    "swapped_positions": _without_speeds("q", lambda x, y, rng: _swap(y, 1, 2)),
    "swapped_joints": _every(lambda y: _swap(y, y.shape[1] - 2, y.shape[1] - 1)),
    "all_signs": _of("tau", lambda x, y, rng: -y),
    "position_sign": _without_speeds("q", lambda x, y, rng: _of_one(y, 1, -1.0)),
    "zero_10": _of("q", lambda x, y, rng: y + _offset(x, 10 * rng.choice([-1, 1]), 1)),
    "one_in_milli": _of("tau", lambda x, y, rng: _of_one(y, 1, 1e3)),
    "wrong_gear": _of("tau", lambda x, y, rng: _of_one(y, 1, 5.0)),
    "no_gravity": _of("tau", lambda x, y, rng: y - _gravity(x)),
    "picked_up": _of("tau", _picked),
    "saturated": _of("tau", _saturated),
    "torque_filtered": _of("tau", lambda x, y, rng: _low_pass(y, x.recorded.time, 0.05)),
    "positions_late": _without_speeds("q", lambda x, y, rng: late(y, x.recorded.time, 0.02)),
    "counts": _without_speeds("q", lambda x, y, rng: np.round(y * 2**17 / 2 / np.pi)),
    "turns": _without_speeds("q", lambda x, y, rng: y / 2 / np.pi),
    "speeds_in_rpm": _speeds(lambda x: 30 / np.pi),
    "speed_sign": _speeds(lambda x: np.where(np.arange(x.robot.n) == 1, -1.0, 1.0)),
    "milliseconds": lambda x, rng: replace(x.recorded, time=1e3 * x.recorded.time),
    "coupled_motors": _of("tau", _coupled),
}
"""Further faults by name."""

TOOLS = [(name, share) for name in ("six", "seven", "cobot", "ur10")
         for share in (0.02, 0.05, 0.1, 0.2, 0.4)]  # fmt: skip
"""Robots with tools that their files lack, by their share of the robot's mass."""
