"""The outcomes of a run: tracking errors of the joints, and loads of the motors."""

from collections.abc import Sequence
from itertools import zip_longest

import numpy as np

from sdt_drake.analysis.comparison import Compared
from sdt_drake.analysis.heat import winding_temperature
from sdt_drake.analysis.stopping import Stopping
from sdt_drake.analysis.stops import stops
from sdt_drake.analysis.tracking import motor_use
from sdt_drake.io.errors import InputError
from sdt_drake.motion import margins
from sdt_drake.pilot.head import has_head
from sdt_drake.robot.motors import as_driven, motors_in_use
from sdt_drake.robot.windings import windings_of
from sdt_drake.run.design import Design
from sdt_drake.run.recording import Recording
from sdt_drake.run.scenario import Scenario

TRACKING = (
    "max_abs_speed_error", "rms_speed_error", "constant_speed_error", "saturated_fraction",
    "max_abs_position_error", "peak_torque_share", "rms_torque_share",
)  # fmt: skip
"""Families of outcomes that every run has, one for each joint."""

LOADS = ("used_torque_share", "rated_torque_share", "winding_temperature", "torque_at_speed_share")
"""Families of outcomes that `motor_loads` returns, one for each joint."""


STOP_SHARE = "stop_share"
"""Outcome of a study with emergency stops."""

_NO_END = 1e9  # tables have no infinity


class InfeasibleError(InputError):
    """An error for a motion that is beyond the limits of the device."""


def outcome_names(base: Scenario, n: int, stops: Stopping | None = None) -> tuple[str, ...]:
    """Return the names of a run's outcomes. Those of joint k = 1..n end with _k.

    Those of a study with emergency stops end with `stop_share`.
    """
    loads = motor_load_names(n) if has_motor_loads(base) else ()
    own = () if stops is None else (STOP_SHARE,)
    return (*_of_joints(TRACKING, n), "felt_share", *loads, *own)


def stop_outcomes(
    stopping: Stopping | None, design: Design, recording: Recording
) -> tuple[float, ...]:
    """Return the largest share of any limit that a stop of the run takes; () without stops.

    A stop that does not end, or exceeds a limit of 0, has the share 1e9.
    """
    if stopping is None:
        return ()
    return (min(stops(design, stopping, run=recording).share, _NO_END),)


def outcomes_of(
    base: Scenario, design: Design, recording: Recording, commanded: float, pause: float
) -> tuple[float, ...]:
    """Return the outcomes of a run in the order of `outcome_names`; NaN where it has none.

    Args:
        base: base scenario of the study.
        design: design of the run.
        recording: the run.
        commanded: commanded duration of the motion [s].
        pause: rest between two runs, motors without current [s].
    """
    run = Compared(design.scenario.controller.label, design, recording)
    felt = run.head.felt.share if has_head(design.device.simulated) else np.nan
    own = (*np.concatenate([run.metrics[name] for name in TRACKING]).tolist(), felt)
    if has_motor_loads(base) and has_motor_loads(design.scenario):
        own += motor_loads(design, recording, commanded, pause)
    # Motor loads that other rows of the study have and this one does not.
    return own + (np.nan,) * (len(outcome_names(base, design.device.simulated.n)) - len(own))


# --- motors of a catalogue -----------------------------------------------------------------------


def has_motor_loads(scenario: Scenario) -> bool:
    """Return whether `motor_loads` applies: a rigid coupled plant, all motors of a catalogue."""
    device = scenario.device
    if scenario.plant.kind != "coupled" or not scenario.plant.elasticity.is_rigid:
        return False
    joints = list(zip_longest(device.motors, device.fitted, fillvalue=""))
    return bool(joints) and all(motor or fitted for motor, fitted in joints)


def motor_load_names(n: int) -> tuple[str, ...]:
    """Return the names of the numbers that `motor_loads` returns for n joints."""
    return (*_of_joints(LOADS, n), "stretch")


def motor_loads(
    design: Design, recording: Recording, commanded: float, pause: float = 0.0
) -> tuple[float, ...]:
    """Return the loads of the motors in the order of `motor_load_names`; less is better for each.

    used_torque_share: largest torque over the motor's peak torque [-].
    rated_torque_share: RMS of the motor's torque, pauses included, over the rated torque [-].
    winding_temperature: highest temperature rise of the winding above its coolant, over the rise
        at constant rated torque [-]; steady state of the repeated motion.
    torque_at_speed_share: largest torque of the planned motion over the driving torque available
        at that speed [-], by `drive.n1` and `n0` where they are given.
    stretch: extra duration of the planned motion over the commanded duration [-].

    Args:
        design: design of the run; all its motors are in the catalogue.
        recording: the run.
        commanded: commanded duration of the motion [s].
        pause: rest between two runs, motors without current [s].

    Raises:
        InputError: for a device with a motor that is not in the catalogue.
    """
    robot, motion = design.device.simulated, design.reference.tracked
    windings = windings_of(motors_in_use(design.scenario.device, robot.n))
    mean_square, rated = recording.tau_rms[1:] ** 2, windings.rated_torque
    share = margins(as_driven(robot, design.scenario.drive), motion).share
    at_speed = share.get("torque at speed", share["torque"])
    by_joint = (
        motor_use(recording, robot).peak_share,
        np.sqrt(mean_square.mean(axis=0) * motion.duration / (motion.duration + pause)) / rated,
        winding_temperature(
            mean_square / rated**2, windings.time_constant, motion.period, pause, windings.share
        ),
        at_speed.max(axis=0),
    )
    return (*np.concatenate(by_joint).tolist(), motion.duration / commanded - 1)


def _of_joints(names: Sequence[str], n: int) -> list[str]:
    return [f"{name}_{k + 1}" for name in names for k in range(n)]
