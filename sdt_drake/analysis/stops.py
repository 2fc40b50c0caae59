"""Emergency stops at every instant of a motion: what happens to joints and pilot, and when."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from queue import SimpleQueue
from typing import NamedTuple

import numpy as np

from sdt_drake.analysis.stop_setting import FIGURES, Setting, make_setting
from sdt_drake.analysis.stopping import Stopping
from sdt_drake.io.arguments import a_path, instance_of, takes
from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError
from sdt_drake.io.progress import with_progress
from sdt_drake.io.shown import DataFrame, Figure, Shown, Summary, higher, joint_count
from sdt_drake.io.tables import data_frame, write_table
from sdt_drake.motion import Motion
from sdt_drake.motion.trajectory import resampled
from sdt_drake.pilot.head import has_head, head_motion_of_samples
from sdt_drake.robot.motors import as_driven
from sdt_drake.run.design import Design, as_design
from sdt_drake.run.recording import Recording
from sdt_drake.run.scenario import Scenario
from sdt_drake.run.simulate import simulate
from sdt_drake.run.stopping import Course, StopPlant
from sdt_drake.run.threads import threads

_THREADS = 2
_SLOWER = [2 ** (k / 8) for k in range(17)]  # durations of a motion over its own that are tried


class Worst(NamedTuple):
    """The worst value of a figure over all instants."""

    figure: str
    """Name in FIGURES."""
    joint: int | None
    """Number of the joint, 1..n; None for the head and the whole stop."""
    value: float
    """The largest value [SI]."""
    time: float
    """Time of the motion at which that stop begins [s]."""
    limit: float
    """The largest allowed value; inf without a limit."""

    @property
    def share(self) -> float:
        """Share of its limit that the value takes [-]; 0 without a limit."""
        if self.limit > 0:
            return self.value / self.limit
        return np.inf if self.value > 0 else 0.0

    @property
    def is_allowed(self) -> bool:
        """True if it is within its limit."""
        return self.value <= self.limit

    def text(self, value: float) -> str:
        """Return a value of this figure with its unit."""
        metric = FIGURES[self.figure]
        return f"{metric.text(value)} {metric.unit}"


@dataclass(frozen=True, eq=False, repr=False)
class Stops(Shown):
    """Stops at instants of a motion, and the worst of them. No statement on safety."""

    setting: Setting
    """Robot, brakes, and what a stop does."""
    time: Array
    """Times of the motion at which a stop begins [s], shape (N,)."""
    q: Array
    """Positions then, joint side [rad], shape (N, n)."""
    v: Array
    """Speeds then [rad/s], shape (N, n)."""
    figures: Mapping[str, Array]
    """Figures of the stops by name in FIGURES [SI], shape (N,) or (N, n)."""

    @cached_property
    def worst(self) -> tuple[Worst, ...]:
        """The worst value of each figure, for figures of joints that of each joint."""
        limits, found = self.setting.stopping.limits.by_figure(self.setting.brakes), []
        for name, values in self.figures.items():
            columns = values.T if values.ndim > 1 else values[None]
            most = np.broadcast_to(limits.get(name, np.inf), len(columns))
            for k, (column, limit) in enumerate(zip(columns, most.tolist(), strict=True)):
                i, joint = int(column.argmax()), k + 1 if values.ndim > 1 else None
                found.append(Worst(name, joint, float(column[i]), float(self.time[i]), limit))
        return tuple(found)

    @property
    def share(self) -> float:
        """Largest share of any limit that a stop takes [-]; 0 without limits."""
        return max(worst.share for worst in self.worst)

    @property
    def hardest(self) -> float:
        """Time of the stop that takes most of its limit or, without limits, has the largest G.

        Without a head it is the longest stop [s].
        """
        worst = max(self.worst, key=lambda worst: worst.share)
        if worst.share == 0:
            first = "g" if "g" in self.figures else "stopping_time"
            worst = max((x for x in self.worst if x.figure == first), key=lambda x: x.value)
        return worst.time

    def course(self, time: float) -> Course:
        """Simulate the stop that begins at the instant next to a time of the motion [s]."""
        i = int(np.abs(self.time - time).argmin())
        return self.setting.course(self.setting.plant(), self.q[i], self.v[i])[0]

    def summary(self) -> Summary:
        rows = [
            (
                FIGURES[x.figure].title
                if x.joint is None
                else f"{FIGURES[x.figure].title} {x.joint}",
                x.text(x.value),
                "–" if np.isinf(x.limit) else x.text(x.limit),
                f"{x.time:.3f}",
            )
            for x in self.worst
        ]
        category, count = self.setting.stopping.category, len(self.time)
        title = f"of category {category} at {count} instants of {self.time[-1]:g} s"
        return Summary(title, ("worst", "value", "limit", "stop at [s]"), rows)

    def plot(self) -> Figure:
        """Return a figure of the figures over the time of the stop."""
        return higher("show.figures.stops:stops_figure")(self)

    def to_pandas(self) -> DataFrame:
        """Return a data frame of the figures [SI]; its index is the time of the stop [s].

        Raises:
            InputError: if pandas is not installed.
        """
        return data_frame(self.time, self.figures)

    @takes(path=a_path)
    def save(self, path: str | Path) -> None:
        """Write the figures of all instants [SI] as .csv, .mat or .parquet.

        Raises:
            InputError: if the file cannot be written, or needs a package that is not installed.
        """
        write_table(path, self.time, self.figures)


# --- all instants ------------------------------------------------------------------------------


def stops(
    design: Design | Scenario,
    stopping: Stopping | str | Path = "stops",
    *,
    run: Recording | None = None,
) -> Stops:
    """Simulate an emergency stop from every instant of a run.

    The coupled plant stops with its friction and deviations; drives follow their ramps exactly.
    Around the worst instants of each figure, further stops begin down to each period of the run.

    Args:
        design: the design or scenario of the run, on the coupled plant with rigid joints.
        stopping: what drives and brakes do: an object, a YAML file, or a shipped one by name.
        run: the recording of the run; simulated by default.

    Raises:
        InputError: naming what does not fit: the plant, the robot, a motor without a name.

    Examples:
        >>> import numpy as np
        >>> import sdt_drake as sdt
        >>> motion = sdt.Motion.from_speeds(0.005, np.zeros(4), np.tile([0.5, 0, 0, 0], (5, 1)))
        >>> found = sdt.stops(sdt.design(sdt.load("coupled_pi"), motion=motion))
        >>> [round(x.value, 1) for x in found.worst if x.figure == "stopping_time"]
        [1.3, 0.1, 0.1, 0.1]
    """
    design = as_design(design)
    setting = setting_of(design, stopping)
    if run is None:
        run = simulate(design)
    instance_of(Recording, "sdt_drake.simulate")(run, "run")
    if run.q.shape[1] != design.nominal.n:
        found = joint_count(run.q.shape[1])
        raise InputError(f"{found}, expected {design.nominal.n}", place="run")
    return stops_along(setting, run.time, run.q, run.v)


def setting_of(design: Design, stopping: Stopping | str | Path) -> Setting:
    """Check that an emergency stop fits a design; arguments and errors as in `stops`."""
    scenario = design.scenario
    if scenario.plant.kind != "coupled":
        text = "axis, expected coupled, as joints accelerate each other in a stop"
        raise InputError(text, place="plant.kind")
    if not scenario.plant.elasticity.is_rigid:
        raise InputError("elastic joints, expected rigid ones", place="plant.elasticity")
    return make_setting(
        as_driven(design.device.simulated, scenario.drive), stopping, scenario.device,
        design.friction, scenario.plant.stops, accuracy=scenario.accuracy,
    )  # fmt: skip


def stops_along(setting: Setting, time: Array, q: Array, v: Array) -> Stops:
    """Simulate the stops along a motion, and more of them around the worst ones.

    Args:
        setting: robot, brakes, and what a stop does.
        time: samples of the motion in equal steps [s], shape (N,).
        q: positions [rad], shape (N, n).
        v: speeds [rad/s], shape (N, n).
    """
    return Along(setting, time, q, v).everywhere()


class Along:
    """The stops along a motion; those that are known are not simulated again."""

    def __init__(self, setting: Setting, time: Array, q: Array, v: Array) -> None:
        """Make it; arguments as in `stops_along`."""
        self._setting, self._time, self._q, self._v = setting, time, q, v
        self.period = float(time[1] - time[0])
        self._g = np.ones(len(time))
        if has_head(setting.robot):
            self._g = head_motion_of_samples(setting.robot, self.period, q, v).resultant_g
        self._known: dict[int, dict[str, Array]] = {}
        self._plants: SimpleQueue[StopPlant] = SimpleQueue()
        for _ in range(_THREADS):
            self._plants.put(setting.plant())

    def stops(self, rows: Sequence[int]) -> Stops:
        """Simulate the stops that begin at samples of the motion; return all so far."""
        new = sorted({*rows} - self._known.keys())
        with threads(_THREADS) as pool:
            found = with_progress(pool.map(self._figures, new), len(new))
            self._known |= dict(zip(new, found, strict=True))
        known = sorted(self._known)
        names = self._known[known[0]]
        figures = {name: np.array([self._known[i][name] for i in known]) for name in names}
        return Stops(self._setting, self._time[known], self._q[known], self._v[known], figures)

    def everywhere(self) -> Stops:
        """Simulate the stops of the whole motion, and more of them around the worst ones."""
        count = len(self._time)
        step = max(1, round(self._setting.stopping.every / self.period))
        found = self.stops([*range(0, count, step), count - 1])
        while step > 1:
            step //= 2
            worst = np.searchsorted(self._time, [x.time for x in found.worst if x.value > 0])
            near = np.concatenate([worst - step, worst + step])
            found = self.stops(near[(near >= 0) & (near < count)].tolist())
        return found

    def _figures(self, i: int) -> dict[str, Array]:
        plant = self._plants.get()
        try:
            course, longer = self._setting.course(plant, self._q[i], self._v[i])
        except RuntimeError as error:  # of Drake's integrator
            reason = " ".join(str(error).split())
            text = f"the stop at {self._time[i]:.6g} s: the simulation is stuck ({reason})"
            raise InputError(text) from None
        finally:
            self._plants.put(plant)
        before = self._time[:i] - self._time[i], self._g[:i]
        return self._setting.figures(course, longer, before)


# --- motions whose stops are within limits -------------------------------------------------------


def stoppable(setting: Setting, motion: Motion) -> tuple[Motion, float]:
    """Slow a motion down until each of its stops is within the limits.

    All joints keep their path and slow down by the same factor, the first of 2^(1/8), 2^(2/8) to 4
    that is enough.

    Args:
        setting: robot, brakes, what a stop does, and the limits.
        motion: a motion within the limits of the robot.

    Returns:
        The motion and its factor: its duration over that of the first one.

    Raises:
        InputError: naming the limit that a stop exceeds at a quarter of the speed, too.
    """

    def along(factor: float) -> tuple[Motion, Along]:
        slow = motion
        if factor > 1:
            time, v = factor * motion.time, motion.v / factor
            slow = resampled("motion", time, motion.q, v, motion.period)[0]
        return slow, Along(setting, slow.time, slow.q, slow.v)

    def hardest(stops: Along, factor: float) -> Worst:
        rows = np.unique(np.round(factor * at / motion.period).astype(int)).tolist()
        return max(stops.stops(rows).worst, key=lambda x: x.share)

    at = np.zeros(0)  # times of stops beyond a limit, in the time of the first motion [s]
    for factor in _SLOWER:
        slow, stops = along(factor)
        if at.size and hardest(stops, factor).share > 1:
            continue
        found = stops.everywhere()
        if found.share <= 1:
            return slow, factor
        at = np.array([x.time / factor for x in found.worst if not x.is_allowed])
        worst = hardest(along(_SLOWER[-1])[1], _SLOWER[-1])
        if worst.share > 1:
            break
    joint = "" if worst.joint is None else f" of {setting.robot.joint(worst.joint - 1)}"
    name, value, limit = FIGURES[worst.figure].title, *map(worst.text, (worst.value, worst.limit))
    raise InputError(
        f"a stop of category {setting.stopping.category} at {worst.time / _SLOWER[-1]:.3f} s: "
        f"{name}{joint} is {value} at a {_SLOWER[-1]:g}th of the speed, too, allowed is {limit}"
    )
