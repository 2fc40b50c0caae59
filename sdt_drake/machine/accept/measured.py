"""A recording of a planned motion: its checks, its cycles, and their characteristics."""

from collections.abc import Iterator, Mapping

import numpy as np
from scipy.interpolate import CubicSpline

from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError, Problem
from sdt_drake.io.shown import numbered
from sdt_drake.machine.accept import characteristics as ch
from sdt_drake.machine.accept.plan import PlannedMotion
from sdt_drake.machine.accept.results import Characteristic
from sdt_drake.machine.accept.spec import CHANNELS, Acceptance, Test
from sdt_drake.machine.diagnose import constants as c
from sdt_drake.machine.recordings.recorded import Recorded
from sdt_drake.pilot.head import has_head, head_motion
from sdt_drake.robot.robot import Robot

_LEAST_COLUMNS = 16  # samples of a cycle
_RATE = 4.0  # least rate of a recording over the band of accelerations


class Measured:
    """A recording at equal periods in the time of its motion, and its cycles."""

    def __init__(
        self, robot: Robot, spec: Acceptance, planned: PlannedMotion, recorded: Recorded,
        shift: float,
    ) -> None:  # fmt: skip
        self.robot, self.spec, self.tests = robot, spec, planned.tests.tests
        self.period, self.names = recorded.period, numbered(robot.joint_names)
        self._check(planned, recorded, shift)
        motion = planned.motion
        self.time = np.arange(0, motion.duration + self.period / 2, self.period)
        at = np.clip(self.time + shift, recorded.time[0], recorded.time[-1])
        signals = {
            name: CubicSpline(recorded.time, x)(at)
            for name, x in recorded.signals.items()
            if name in ("q", "v", "q_ref")
        }
        self.u, self.q, own = signals["q_ref"], signals["q"], signals.get("v")

        def derived(x: Array, order: int) -> Array:
            return ch.band_limited(x, self.period, spec.band, order)

        self.v = derived(self.q, 1) if own is None else derived(own, 0)
        self.du = derived(self.u, 2)
        self.vd = derived(self.q, 2) if own is None else derived(own, 1)
        self.v_ref = derived(self.u, 1)

    def _check(self, planned: PlannedMotion, recorded: Recorded, shift: float) -> None:
        """Refuse a recording that is too slow, has gaps, or lacks tests or torque."""
        path, rate = recorded.path, 1 / recorded.period
        if rate < _RATE * self.spec.band:
            raise InputError(
                f"{path}: recorded at {rate:.4g} Hz, accelerations up to {self.spec.band:g} Hz "
                f"(band) need at least {_RATE * self.spec.band:g} Hz"
            )
        if recorded.gaps_in_words:
            raise InputError(f"{path}: {recorded.gaps_in_words}, expected none")
        first, last = recorded.time[[0, -1]] - shift
        lacking = [
            test for test in self.tests
            if test.start < first - recorded.period or test.end > last + recorded.period
        ]  # fmt: skip
        if lacking:
            more = f", and {len(lacking) - 1} more tests" if len(lacking) > 1 else ""
            raise InputError(
                f"{path}: contains {first:.3f} to {last:.3f} s of {planned.tests.name}, expected "
                f"all cycles of {lacking[0].text(self.names)}, {lacking[0].start:.3f} to "
                f"{lacking[0].end:.3f} s{more}"
            )
        if "tau" not in recorded.signals:
            return
        share = np.abs(self.robot.gear_torque(recorded.signals["tau"])) / self.robot.effort_limit
        problems = []
        for test in self.tests:
            inside = (recorded.time - shift >= test.start) & (recorded.time - shift <= test.end)
            i, k = np.unravel_index(share[inside].argmax(), share[inside].shape)
            if share[inside][i, k] >= c.AT_LIMIT:
                problems.append(
                    Problem(
                        f"{self.robot.joint(int(k))} is at its torque limit at "
                        f"{recorded.time[inside][i] - shift:.3f} s of {planned.tests.name}, in "
                        f"{test.text(self.names)}",
                        "tests without saturation (share, torque_share)",
                        where=str(path),
                    )
                )
        if problems:
            raise InputError(*problems)

    def cycles(self, x: Array, test: Test) -> Array:
        """Return the cycles of a test from samples, shape (N, ...): (cycles, M, ...)."""
        m = max(_LEAST_COLUMNS, round(test.cycle / self.period))
        t = test.start + test.cycle / m * np.arange(test.cycles * m)
        around = slice(*np.searchsorted(self.time, [t[0] - 0.1, t[-1] + 0.1]))
        values = CubicSpline(self.time[around], x[around])(t)
        return np.asarray(values.reshape(test.cycles, m, *x.shape[1:]))

    def characteristics(self) -> Iterator[Characteristic]:
        """Yield the characteristics of all tests."""
        fast: dict[int, Array] = {}
        for test in self.tests:
            k = test.joint - 1
            match test.kind:
                case "excursion" | "speed":
                    three = (self.cycles(x[:, k], test) for x in (self.q, self.v, self.vd))
                    found = ch.extremes(*three)
                    wanted = (
                        ("lowest", "highest")
                        if test.kind == "excursion"
                        else ("speed", "acceleration")
                    )
                    yield from self.rows(test, {name: found[name] for name in wanted})
                case "sine":
                    u, y, du, dy = (
                        self.cycles(x[:, k], test) for x in (self.u, self.q, self.du, self.vd)
                    )
                    yield from self.rows(test, ch.describing(u, y) | ch.noises(du, dy))
                    yield from self.at_head(test)
                case "chain":
                    u, y = self.head_cycles(test)
                    j = CHANNELS.index(test.channel)
                    yield from self.rows(test, ch.describing(u[..., j], y[..., j]), test.channel)
                case "hysteresis":
                    off = self.cycles((self.q - self.u)[:, k], test)
                    if k in fast:
                        yield from self.rows(test, ch.hysteresis(fast[k], off))
                    fast[k] = off
                case "step":
                    du, dy = (self.cycles(x[:, k], test) for x in (self.du, self.vd))
                    found = ch.threshold(du, dy, test.size, test.cycle / du.shape[1])
                    yield from self.rows(test, found)
                case "poses":
                    yield from self.of_poses(test)

    def head_cycles(self, test: Test) -> tuple[Array, Array]:
        """Return commanded and achieved CHANNELS of the head in the cycles of a test."""
        found = []
        for three in ((self.u, self.v_ref, self.du), (self.q, self.v, self.vd)):
            head = head_motion(
                self.robot, *(self.cycles(x, test).reshape(-1, self.robot.n) for x in three)
            )
            both = np.hstack([head.specific_force, head.angular_velocity])
            found.append(both.reshape(test.cycles, -1, len(CHANNELS)))
        return found[0], found[1]

    def at_head(self, test: Test) -> Iterator[Characteristic]:
        """Yield gain, phase and noise of the force and the rate that a joint's sine moves most."""
        if not has_head(self.robot):
            return
        u, y = self.head_cycles(test)
        size = np.abs(np.fft.rfft(u.mean(axis=0), axis=0)[1])
        for part in (slice(0, 3), slice(3, 6)):
            j = part.start + int(size[part].argmax())
            if size[j] > 1e-9 * u.shape[1]:
                numbers = ch.describing(u[..., j], y[..., j]) | ch.noises(u[..., j], y[..., j])
                yield from self.rows(
                    test, numbers, f"head {CHANNELS[j]}, {self.names[test.joint - 1]}"
                )

    def of_poses(self, test: Test) -> Iterator[Characteristic]:
        """Yield pose and path accuracy and repeatability at the head, or at the last link."""
        u, y = (_places(self.robot, self.cycles(x, test)) for x in (self.u, self.q))
        m = u.shape[1]
        half = max(1, round(self.spec.dwell / 2 / test.cycle * m))
        ends = [round(end / test.cycle * m) for end in test.dwells]
        at_poses = np.stack([(y - u)[:, end - half : end].mean(axis=1) for end in ends], axis=1)
        along = np.gradient(u.mean(axis=0), axis=0)
        yield from self.rows(test, ch.poses(at_poses) | ch.path(y - u, along))

    def rows(
        self, test: Test, numbers: Mapping[str, ch.Estimate], place: str = ""
    ) -> Iterator[Characteristic]:
        """Yield numbers with their limits."""
        where = place or (
            self.names[test.joint - 1]
            if test.joint
            else "head"
            if has_head(self.robot)
            else "last link"
        )
        at = test.frequency or (test.size if test.kind == "step" else np.nan)
        for quantity, x in numbers.items():
            allowed = self.spec.limits.allowed(test.kind, quantity, test.joint, test.frequency)
            yield Characteristic(test.kind, where, test.joint, quantity, at, *x, *allowed)


def _places(robot: Robot, q: Array) -> Array:
    """Return positions of the head, or of the last link's centre of mass, in the world [m]."""
    flat = q.reshape(-1, robot.n)
    if has_head(robot):
        zero = np.zeros_like(flat)
        found = head_motion(robot, flat, zero, zero).position
    else:
        plant, context = robot.plant, robot.plant.CreateDefaultContext()
        body = plant.GetJointByName(robot.joint_names[-1]).child_body()
        found = np.empty((len(flat), 3))
        for i, row in enumerate(flat):
            plant.SetPositions(context, row)
            found[i] = body.EvalPoseInWorld(context) @ body.default_com()
    return found.reshape(*q.shape[:-1], 3)
