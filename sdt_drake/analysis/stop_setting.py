"""The figures of an emergency stop, and what all stops of a motion share."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sdt_drake.analysis.metrics import Metric
from sdt_drake.analysis.stopping import Stopping, load_stopping
from sdt_drake.io.arguments import a_path
from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError
from sdt_drake.io.fields import check_joints
from sdt_drake.pilot.head import has_head, head_motion
from sdt_drake.robot.brakes import Brakes
from sdt_drake.robot.device import FrictionParameters
from sdt_drake.robot.dynamics import torque_groups
from sdt_drake.robot.motors import DeviceChoice
from sdt_drake.robot.robot import Robot
from sdt_drake.robot.stops import Stops as JointStops
from sdt_drake.run.stopping import Course, StopPlant, simulate_stop

_DEG = float(np.degrees(1))

FIGURES = {
    "stopping_time": Metric("stopping time", "s", 1, ".3f"),
    "stopping_angle": Metric("stopping angle", "deg", _DEG, ".2f"),
    "g": Metric("G at the head", "G", 1, ".3f"),
    "g_onset": Metric("onset of G", "G/s", 1, ".2f"),
    "head_rate": Metric("angular rate of the head", "deg/s", _DEG, ".1f"),
    "head_acceleration": Metric("angular acceleration of the head", "deg/s²", _DEG, ".1f"),
    "joint_stop_speed": Metric("speed at a joint stop", "deg/s", _DEG, ".2f"),
    "brake_load": Metric("gravity over static torque of a brake", "%", 100, ".1f"),
    "brake_energy": Metric("energy of a brake", "kJ", 1e-3, ".3f"),
    "drive_torque": Metric("torque of a ramp over that of its motor", "%", 100, ".1f"),
    "longer": Metric("ramp lengthened", "times", 1, ".3f"),
}
"""Figures of a stop by name; less is better for each. Those of joints have the shape (n,)."""

_LONGER = 1.005, 2.0  # least and largest factor from one trial of a ramp to the next
_MAX_LONGER = 10.0  # factor on a ramp; a motor that holds a joint with all its torque needs more
_NO_WEIGHT = 1e-6  # N m; a smaller torque of gravity is round-off


@dataclass(frozen=True, eq=False)
class Setting:
    """The robot, brakes and friction that all stops of a motion share, and the course of a stop."""

    robot: Robot
    """The robot, with the torque-speed envelope of its drives."""
    stopping: Stopping
    """The actions of drives and brakes in a stop."""
    brakes: Brakes
    """Brakes of the robot's motors."""
    friction: FrictionParameters | None
    """Friction of the joints, if any."""
    stops: JointStops | None
    """Stops of the joints that push back, if any."""
    accuracy: float
    """Accuracy of simulated speeds [rad/s]."""

    def plant(self) -> StopPlant:
        """Make a plant to simulate stops in one thread."""
        return StopPlant(self.robot, self.brakes, self.friction, self.stops, accuracy=self.accuracy)

    def course(self, plant: StopPlant, q: Array, v: Array) -> tuple[Course, float]:
        """Simulate a stop, with ramps as long as the torque of the motors requires.

        Args:
            plant: a plant of this setting.
            q: positions when the stop begins, joint side [rad], shape (n,).
            v: speeds then [rad/s], shape (n,).

        Returns:
            The course, and the factor on the duration of the ramps.
        """
        longer = 1.0
        while True:
            schedule = self.stopping.schedule(self.brakes, v, longer)
            course = simulate_stop(plant, q, v, schedule, self.stopping.longest)
            most = float(self.drive_torque(course).max())
            if most <= 1 or longer > _MAX_LONGER:
                return course, longer
            longer *= min(max(most, _LONGER[0]), _LONGER[1])

    def drive_torque(self, course: Course) -> Array:
        """Return the largest share of each motor's torque that its ramp takes [-], shape (n,)."""
        lowest, highest = self.robot.torque_range(course.v)
        needed = np.where(course.driven, course.torque, 0.0)
        available = np.where(needed > 0, highest, -lowest)
        none = np.where(needed != 0, np.inf, 0.0)  # of a motor at its no-load speed
        share = np.divide(np.abs(needed), available, out=none, where=available > 0)
        return np.asarray(share.max(axis=0))

    def figures(
        self, course: Course, longer: float, before: tuple[Array, Array]
    ) -> dict[str, Array]:
        """Return the FIGURES of a stop, shape (n,) or ().

        Args:
            course: the stop.
            longer: factor on the duration of its ramps.
            before: times before the stop [s], negative, and G at the head then.
        """
        robot, static = self.robot, self.brakes.static
        figures = {"stopping_time": course.stopping_time, "stopping_angle": course.angle}
        if has_head(robot):
            head = head_motion(robot, course.q, course.v, course.vd)
            g, window = head.resultant_g, self.stopping.onset_window
            whole = np.concatenate([before[0], course.time]), np.concatenate([before[1], g])
            onset = np.abs(g - np.interp(course.time - window, *whole)) / window
            figures |= {"g": g.max(), "g_onset": onset.max()}
            for name, vectors in (
                ("head_rate", head.angular_velocity),
                ("head_acceleration", head.angular_acceleration),
            ):
                figures[name] = np.linalg.norm(vectors, axis=1).max()
        beyond = (course.q < robot.position_lower) | (course.q > robot.position_upper)
        first = np.argmax(beyond, axis=0), np.arange(robot.n)
        figures["joint_stop_speed"] = np.where(beyond.any(axis=0), np.abs(course.v[first]), 0.0)
        rest = np.zeros(robot.n)
        weight = np.abs(torque_groups(robot, course.q[-1], rest, rest).gravity)
        none = np.where(weight > _NO_WEIGHT, np.inf, 0.0)
        figures["brake_load"] = np.divide(weight, static, out=none, where=static > 0)
        figures["brake_energy"] = course.brake_energy
        if self.stopping.category > 0:
            figures |= {"drive_torque": self.drive_torque(course), "longer": np.array(longer)}
        return figures


def make_setting(
    robot: Robot,
    stopping: Stopping | str | Path,
    device: DeviceChoice,
    friction: FrictionParameters | None = None,
    stops: JointStops | None = None,
    *,
    accuracy: float = 1e-4,
) -> Setting:
    """Check that an emergency stop fits a robot.

    Args:
        robot: the robot.
        stopping: what drives and brakes do: an object, a YAML file, or a shipped one by name.
        device: the choice of the robot's motors, which have the brakes.
        friction: friction of the joints, if any.
        stops: stops of the joints that push back, if any.
        accuracy: accuracy of simulated speeds [rad/s].

    Raises:
        InputError: naming what does not fit.
    """
    if not isinstance(stopping, Stopping):
        stopping = load_stopping(a_path(stopping, "stopping"), robot.n)
    check_joints(stopping, "stopping", robot.n)
    if (stopping.failed_motor or 0) > robot.n:
        text = f"{stopping.failed_motor}, expected 1 to {robot.n}"
        raise InputError(text, place="failed_motor")
    if robot.is_coupled:
        raise InputError(
            f"{robot.path}: a motor turns with two joints, and its brake would hold both; "
            "expected a motor for each joint"
        )
    return Setting(robot, stopping, stopping.brakes(robot, device), friction, stops, accuracy)
