"""The numbers that a run ends with: how well joints follow, and what it takes of the motors."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import zip_longest

import numpy as np
from numpy.typing import ArrayLike

from sdt_drake.analysis.comparison import Compared
from sdt_drake.analysis.tracking import motor_use
from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError
from sdt_drake.motion import margins
from sdt_drake.robot.head import has_head
from sdt_drake.robot.motors import Motor, as_driven, motors_in_use
from sdt_drake.run.design import Design
from sdt_drake.run.scenario import Scenario
from sdt_drake.run.simulate import Recording

TRACKING = (
    "max_abs_speed_error", "rms_speed_error", "constant_speed_error", "saturated_fraction",
    "max_abs_position_error", "peak_torque_share", "rms_torque_share",
)  # fmt: skip
"""Of every run, one for each joint."""

LOADS = ("used_torque_share", "rated_torque_share", "winding_temperature", "torque_at_speed_share")
"""Of `motor_loads`, one for each joint."""


class InfeasibleError(InputError):
    """The device cannot do the motion."""


def outcome_names(base: Scenario, n: int) -> tuple[str, ...]:
    """Names of the numbers that a run ends with: joint k's of n are called name_k."""
    loads = motor_load_names(n) if has_motor_loads(base) else ()
    return (*_of_joints(TRACKING, n), "felt_share", *loads)


def outcomes_of(
    base: Scenario, design: Design, recording: Recording, commanded: float, pause: float
) -> tuple[float, ...]:
    """The numbers of a run, as `outcome_names` names them; NaN for those it does not have.

    Args:
        base: scenario of the study.
        design, recording, commanded, pause: as of `motor_loads`.
    """
    run = Compared(design.scenario.controller.label, design, recording)
    felt = run.head.felt.share if has_head(design.robot) else np.nan
    own = (*np.concatenate([run.metrics[name] for name in TRACKING]).tolist(), felt)
    if has_motor_loads(base) and has_motor_loads(design.scenario):
        own += motor_loads(design, recording, commanded, pause)
    # What other rows of the study have and this one does not.
    return own + (np.nan,) * (len(outcome_names(base, design.robot.n)) - len(own))


# --- motors of a catalogue -----------------------------------------------------------------------


def has_motor_loads(scenario: Scenario) -> bool:
    """Whether `motor_loads` can tell of a scenario: of a coupled plant with motors of a
    catalogue."""
    device = scenario.device
    if scenario.plant.kind != "coupled" or not scenario.plant.elasticity.is_rigid:
        return False
    joints = list(zip_longest(device.motors, device.fitted, fillvalue=""))
    return bool(joints) and all(motor or fitted for motor, fitted in joints)


def motor_load_names(n: int) -> tuple[str, ...]:
    """Names of the numbers that `motor_loads` tells of n joints."""
    return (*_of_joints(LOADS, n), "stretch")


def motor_loads(
    design: Design, recording: Recording, commanded: float, pause: float = 0.0
) -> tuple[float, ...]:
    """Numbers of a run, as `motor_load_names` names them; less is better for each of them.

    used_torque_share: largest torque over the motor's largest [-].
    rated_torque_share: RMS of the motor's torque, pauses included, over the rated torque [-].
    winding_temperature: highest temperature of the winding above that of its coolant, as a share
        of what the rated torque gives for ever [-], the run repeated for ever.
    torque_at_speed_share: of the planned motion, the largest torque over what the motor's envelope
        leaves to drive with at that speed [-]; that of `drive.n1` and `n0` where they are given.
    stretch: how much longer than commanded the motion lasts [-].

    Args:
        design: of a scenario with a device whose motors are all of the catalogue.
        recording: its run.
        commanded: how long the motion should last [s].
        pause: rest between two runs, motors without current [s].

    Raises:
        InputError: for a device with a motor of no catalogue.
    """
    robot, motion = design.robot, design.motion
    motors = motors_in_use(design.scenario.device, robot.n)
    mean_square = recording.tau_rms[1:] ** 2
    rated = _each(motors, "rated_torque")
    share = margins(as_driven(robot, design.scenario.drive), motion).share
    at_speed = share.get("torque at speed", share["torque"])
    by_joint = (
        motor_use(recording, robot).peak_share,
        np.sqrt(mean_square.mean(axis=0) * motion.duration / (motion.duration + pause)) / rated,
        winding_temperature(
            mean_square / rated**2, _each(motors, "thermal_time_constant"), motion.period, pause
        ),
        at_speed.max(axis=0),
    )
    return (*np.concatenate(by_joint).tolist(), motion.duration / commanded - 1)


def winding_temperature(
    heat: Array, time_constant: ArrayLike, period: float, pause: float = 0.0
) -> Array:
    """Highest temperature theta of windings in a cycle that goes on for ever, shape (n,).

    Copper losses grow with the torque squared, and the winding is one lump of heat (assumed), so
    with theta = 1 for the rated torque

        T d theta/dt + theta = (tau / tau_rated)²

    Over a period of constant heat this is solved exactly. After a cycle of length t_c + t_p that
    starts at theta_0 the winding must be at theta_0 again: with f, what a cycle that starts cold
    ends with, theta_0 = f exp(-t_p / T) / (1 - exp(-(t_c + t_p) / T)).

    Args:
        heat: (tau / tau_rated)², mean over each period [-], shape (N, n).
        time_constant: T [s], shape (n,).
        period: [s].
        pause: t_p at the end of the cycle, without torque [s].
    """
    T = np.asarray(time_constant, dtype=float)
    kept = np.exp(-period / T)
    cold = np.zeros((len(heat) + 1, len(T)))
    for i, added in enumerate((1 - kept) * heat):
        cold[i + 1] = kept * cold[i] + added
    time = period * np.arange(len(cold))[:, None]
    start = cold[-1] * np.exp(-pause / T) / -np.expm1(-(time[-1] + pause) / T)
    return (cold + start * np.exp(-time / T)).max(axis=0)


def _of_joints(names: Sequence[str], n: int) -> list[str]:
    return [f"{name}_{k + 1}" for name in names for k in range(n)]


def _each(motors: Sequence[Motor], name: str) -> Array:
    return np.array([getattr(motor, name) for motor in motors])
