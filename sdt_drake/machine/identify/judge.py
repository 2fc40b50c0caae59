"""Validation of a robot by recordings, without any fit."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sdt_drake.io.arguments import a_path, positive
from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError
from sdt_drake.io.fields import check_joints
from sdt_drake.io.shown import Shown, Summary, of_joints
from sdt_drake.io.yaml_files import load_yaml
from sdt_drake.machine.diagnose.finding import Finding
from sdt_drake.machine.diagnose.recording import check_recording
from sdt_drake.machine.identify.base_parameters import Unknown
from sdt_drake.machine.identify.cutoff import CUTOFFS, chosen
from sdt_drake.machine.identify.equations import equations
from sdt_drake.machine.identify.friction import FrictionLaw, scenario_terms
from sdt_drake.machine.identify.plant import scenario_torque
from sdt_drake.machine.identify.procedure import belief, few_of, parts_of
from sdt_drake.machine.recordings.columns import Columns
from sdt_drake.machine.recordings.reading import Recordings, recordings_of
from sdt_drake.robot.device import Friction, friction_parameters
from sdt_drake.robot.lacks import MASSES
from sdt_drake.robot.robot import Robot, load_robot


@dataclass(frozen=True, eq=False, repr=False)
class Judged(Shown):
    """The share of recorded torques that a robot does not explain."""

    robot: Robot
    """The robot to validate."""
    cutoff: float
    """Cut-off frequency of the compared torques [Hz]."""
    left: Array
    """Torque not explained [-]: RMS residual over RMS torque while the joint moves, shape (n,)."""
    left_without: Array
    """Torque not explained by the robot without friction [-], shape (n,)."""
    findings: tuple[Finding, ...]
    """Findings in the recordings by themselves."""

    def summary(self) -> Summary:
        columns = {
            "torque not explained [%]": (".2f", 100 * self.left),
            "without friction [%]": (".2f", 100 * self.left_without),
        }
        title = f"{self.robot.name}, below {self.cutoff:.3g} Hz"
        return of_joints(title, columns, self.robot.joint_names)


def judge(
    robot: Robot | str | Path,
    recordings: Recordings,
    *,
    friction: Friction | str | Path | None = None,
    columns: Columns | str | Path | None = None,
    side: str | None = None,
    cutoff: float | None = None,
) -> Judged:
    """Compare a robot's torques with recordings, without any fit, as `sdt-drake judge`.

    Args:
        robot: The robot with its links, motors and damping, its file, or the name of a shipped one.
        recordings: One recording with q and tau or a list, as in `identify`.
        friction: Friction of the joints, joint side, or a file of `identify`; none by default.
        columns: Names of the files' columns, or a YAML file with them.
        side: Side of the torques, "joint" or "motor", as in `identify`.
        cutoff: Cut-off frequency of the compared torques [Hz]; by default chosen from the
            recordings.

    Raises:
        InputError: A wrong argument or recording. No joint moves, or a torque is constant.

    Examples:
        >>> import numpy as np
        >>> import sdt_drake as sdt
        >>> speeds = np.outer(np.sin(np.linspace(0, np.pi, 201)) ** 2, [0.1, 0.2, 0.2, 0.3])
        >>> motion = sdt.Motion.from_speeds(0.005, np.zeros(4), speeds)
        >>> design = sdt.design(sdt.load("real_device"), motion=motion)
        >>> sdt.simulate(design).save("run.csv")
        >>> print(sdt.judge("sdt", "run.csv"))
        Judged sdt, below 20 Hz
        joint        torque not explained [%]  without friction [%]
        1 planetary                      6.83                  6.83
        2 roll                          47.85                 47.85
        3 pitch                         10.90                 10.90
        4 yaw                           19.72                 19.72
    """
    if cutoff is not None:
        positive(cutoff, "cutoff")
    robot = (robot if isinstance(robot, Robot) else load_robot(robot)).having(MASSES)
    if friction is not None and not isinstance(friction, Friction):
        loaded, file = load_yaml(Friction, a_path(friction, "friction"))
        check_joints(loaded, file, robot.n)
        friction = loaded
    recorded = recordings_of(recordings, "recordings", robot, columns, side=side)
    if not recorded:
        raise InputError("none given, expected at least one", place="recordings")
    parts, _ = parts_of((), recorded, 1.0)
    nothing = Unknown.nothing()
    stretches = [stretch for *_, stretch in few_of(parts, CUTOFFS[-1])]
    cutoff, _ = chosen(robot, nothing, belief(robot, nothing), stretches, cutoff)
    own = friction_parameters(friction or Friction(), robot.n)
    laws = tuple(FrictionLaw("file", scenario_terms(x)) for x in {*own.stribeck_speed.tolist()})
    eq = equations(robot, nothing, few_of(parts, cutoff), cutoff, lambda fastest: laws)
    rubs = scenario_torque(eq, own)
    if not eq.moves.any():
        raise InputError(f"{recorded[0].path}: no joint moves more than the noise")
    every = np.ones(len(eq.time), dtype=bool)
    left, without = (eq.not_explained(tau, every) for tau in (eq.nominal + rubs, eq.nominal))
    checked = [finding for one in recorded for finding in check_recording(robot, one)]
    return Judged(robot, cutoff, left, without, tuple(checked))
