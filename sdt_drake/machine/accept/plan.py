"""Plan the motions of an acceptance test within all limits of a device, and write their files."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import numpy as np

from sdt_drake.io.arguments import a_path, instance_of, takes
from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError, within
from sdt_drake.io.fields import check_joints
from sdt_drake.io.files import replacing_files, write_text
from sdt_drake.io.names import leaves
from sdt_drake.io.progress import with_progress
from sdt_drake.io.shown import Shown, Summary, numbered
from sdt_drake.io.yaml_files import write_yaml, yaml_text
from sdt_drake.machine.accept.shapes import Shape, joined, sine, steps, triangle, turns
from sdt_drake.machine.accept.spec import (
    CHANNELS,
    Acceptance,
    Manifest,
    Test,
    TestMotion,
    load_acceptance,
)
from sdt_drake.machine.drive_files.drives import load_drives
from sdt_drake.machine.drive_files.export import write_files
from sdt_drake.machine.identify.limits import Limits
from sdt_drake.motion import Motion, checked_torque, margins
from sdt_drake.pilot.head import has_head, head_motion
from sdt_drake.robot.motors import as_driven
from sdt_drake.robot.robot import Robot
from sdt_drake.run.design import load_device, make_design
from sdt_drake.run.scenario import Scenario, load_scenario

MANIFEST, SPEC, SCENARIO, MOTION = "manifest.yaml", "spec.yaml", "scenario.yaml", "motion.csv"
FILES = (MANIFEST, SPEC, SCENARIO)
"""Files of a planned folder, beside a folder for each motion with MOTION and those of `export`."""

_REST = 0.5  # s, between tests
_SAMPLES = 10  # least samples in a cycle of a sine
_ROWS = 500  # of a test that are checked while its size is sought
_HALVINGS = 10
_EDGE = 0.1  # share of the range between a pose and a stop
_MAX_WAY = np.pi / 4  # rad, of a joint between poses
_DRIVEN = 0.5  # least share of a channel that the joints must give
_OMEGA_R = 62.8  # rad/s, of the loops that a robot without a scenario is given: assumed
_CAM_POINTS = 1000
_FILES = "robot", "learned", "device.catalogue", "controller.file", "pilot.model"


@dataclass(frozen=True, eq=False)
class PlannedMotion:
    """A motion from rest to rest with its tests."""

    tests: TestMotion
    """Name and tests."""
    motion: Motion
    """The motion."""


@dataclass(frozen=True, eq=False, repr=False)
class AcceptancePlan(Shown):
    """The motions of an acceptance test, within all limits of a device."""

    scenario: Scenario
    """Scenario of the device and its loop."""
    device: Robot
    """The chosen robot."""
    spec: Acceptance
    """Tests and limits."""
    motions: tuple[PlannedMotion, ...]
    """The motions to record."""
    left_out: tuple[str, ...]
    """Tests that the device cannot do, or not in full, as sentences."""

    @property
    def duration(self) -> float:
        """Duration of all motions [s]."""
        return sum(x.motion.duration for x in self.motions)

    def summary(self) -> Summary:
        rows = [
            (x.tests.name, f"{x.motion.duration:.0f}", f"{len(x.tests.tests)}")
            for x in self.motions
        ]
        title = f"of {self.scenario.name}: {self.duration:.0f} s in {len(rows)} motions"
        return Summary(title, ("motion", "duration [s]", "tests"), rows)


def scenario_of(robot: str | Path) -> Scenario:
    """Return a scenario for a robot without one: position loops on the coupled plant."""
    controller = {"kind": "p_pi", "feedforward": "id", "omega_r": _OMEGA_R}
    own = {"name": Path(robot).stem, "robot": str(robot), "controller": controller}
    return load_scenario("training", own)


@takes(scenario=instance_of(Scenario, "sdt_drake.load"))
def accept_plan(scenario: Scenario, spec: Acceptance | str | Path = "acceptance") -> AcceptancePlan:
    """Plan the motions of an acceptance test within all limits of a device.

    Args:
        scenario: the device with its loop; its motion is not used.
        spec: tests and limits: an object, a YAML file, or a shipped one by name.

    Raises:
        InputError: naming a bad field, or a device that can do none of the tests.

    Examples:
        >>> import sdt_drake as sdt
        >>> from sdt_drake.machine.accept.spec import Acceptance
        >>> spec = Acceptance(frequencies=[1], steps=[1], cycles=3, repeats=3, chain=[1])
        >>> plan = sdt.accept_plan(sdt.load("training"), spec)
        >>> [x.tests.name for x in plan.motions][3:]
        ['joint_4', 'poses', 'chain_surge', 'chain_roll', 'chain_pitch', 'chain_yaw']
    """
    device = load_device(scenario)
    if not isinstance(spec, Acceptance):
        spec = load_acceptance(a_path(spec, "spec"), device.n)
    check_joints(spec, "spec", device.n)
    bench = _Bench(as_driven(device, scenario.drive), spec, scenario.period)
    motions = [bench.of_joint(k) for k in range(device.n)]
    motions += [bench.of_poses(), *bench.of_chain()]
    planned = tuple(x for x in motions if x is not None)
    if not planned:
        raise InputError(f"{device.path}: none of the tests is possible: {bench.left_out[0]}")
    return AcceptancePlan(scenario, device, spec, planned, tuple(bench.left_out))


class _Bench:
    """A device on which tests are planned."""

    def __init__(self, robot: Robot, spec: Acceptance, period: float) -> None:
        self.robot, self.spec, self.period = robot, spec, period
        self.limits = limits = Limits.of(robot, 1.0)
        inner = (1 - 2 * _EDGE) * limits.range
        pose = np.clip(0.0, limits.middle - inner, limits.middle + inner)
        self.pose = pose if spec.pose_deg is None else np.radians(spec.pose_deg)
        self.room = spec.share * (limits.range - np.abs(self.pose - limits.middle))
        self.names = numbered(robot.joint_names)
        self.left_out: list[str] = []

    # --- sizes -----------------------------------------------------------------------------------

    def largest(self, p: Array) -> float:
        """Return the largest factor on a motion within all limits; 0 if gravity is too strong.

        Args:
            p: positions from the pose at equal periods [rad], shape (N, n).
        """
        spec, limits, h = self.spec, self.limits, self.period
        padded = np.pad(p, ((1, 1), (0, 0)), mode="edge")
        v, vd = (padded[2:] - padded[:-2]) / (2 * h), np.diff(padded, 2, axis=0) / h**2
        rows = slice(None, None, max(1, len(p) // _ROWS))
        share = [
            spec.share * limits.speed / np.abs(v).max(axis=0).clip(1e-12),
            spec.share * limits.acceleration / np.abs(vd).max(axis=0).clip(1e-12),
        ]
        largest = float(np.min(share))
        allowed = {"position": spec.reach, "speed": 1.001 * spec.share}
        allowed |= {"acceleration": 1.001 * spec.share}

        def fits(size: float) -> bool:
            q = self.pose + size * p[rows]
            motion = Motion(h, q, size * v[rows], size * vd[rows])
            use = margins(self.robot, motion).share
            return all(x.max() <= allowed.get(k, spec.torque_share) for k, x in use.items())

        if fits(largest):
            return largest
        low, high = 0.0, largest
        for _ in range(_HALVINGS):
            size = (low + high) / 2
            low, high = (size, high) if fits(size) else (low, size)
        return low

    def along(self, k: int, p: Array) -> Array:
        """Return a motion of joint k alone, shape (N, n)."""
        return np.outer(p, np.eye(self.robot.n)[k])

    # --- motions ---------------------------------------------------------------------------------

    def of_joint(self, k: int) -> PlannedMotion | None:
        """Plan the tests of joint k, from 0."""
        return self.joined(f"joint_{k + 1}", [*self._of_joint(k)])

    def _of_joint(self, k: int) -> Iterator[tuple[Test, Array]]:
        spec, h, room = self.spec, self.period, self.room[k]
        speed = spec.share * self.limits.speed[k]
        step = steps(spec.step_time, spec.cycles, h)
        most = min(self.largest(self.along(k, step.p)), room / step.p.max())
        if most == 0:
            self.leave(k, "all tests: gravity takes more than their share of the torque")
            return
        yield from self.excursion(k)
        turn = max(4 * room / speed, np.sqrt(4 * np.pi * room / most))
        way = min(room, speed**2 * np.pi / most / 4)
        turn = max(np.pi * speed / most, h * _SAMPLES) if way < room else turn
        yield from self.made(
            "speed", k, turns(np.array([way, -way]), turn, 0.0, spec.cycles, h), 1.0
        )
        for f in spec.frequencies:
            yield from self.sine(k, f)
        for cycle in (spec.hysteresis_period, 2 * spec.hysteresis_period):
            way = spec.hysteresis_speed * self.limits.speed[k] * spec.hysteresis_period / 4
            yield from self.made("hysteresis", k, triangle(cycle, spec.cycles, h), min(way, room))
        for share in spec.steps:
            yield from self.made("step", k, step, share * most)

    def excursion(self, k: int) -> Iterator[tuple[Test, Array]]:
        """Plan slow turns of joint k between its stops."""
        low, high = self.robot.position_lower[k], self.robot.position_upper[k]
        if not np.isfinite([low, high]).all():
            self.leave(k, "excursion: the joint has no stops")
            return
        ends = self.limits.middle[k] + self.spec.reach * self.limits.range[k] * np.array([1, -1])
        turn = 2 * np.ptp(ends) / (self.spec.excursion_speed * self.limits.speed[k])
        points = ends - self.pose[k]
        yield from self.made(
            "excursion", k, turns(points, turn, 0.5, self.spec.cycles, self.period), 1
        )

    def sine(self, k: int, f: float) -> Iterator[tuple[Test, Array]]:
        """Plan a sine of joint k at a frequency [Hz], as large as the limits allow."""
        name = f"sine at {f:g} Hz"
        if 1 / f < _SAMPLES * self.period:
            fastest = 1 / (_SAMPLES * self.period)
            self.leave(k, f"{name}: the period of the set points allows {fastest:g} Hz")
            return
        shape = sine(1 / f, self.spec.cycles, self.period)
        size = min(self.largest(self.along(k, shape.p)), self.room[k])
        if np.degrees(size) < self.spec.least_amplitude_deg:
            self.leave(k, f"{name}: the limits allow {np.degrees(size):.2g} deg")
            return
        yield from self.made("sine", k, shape, size)

    def of_poses(self) -> PlannedMotion | None:
        """Plan repeated visits of five poses along the same path."""
        spec, n = self.spec, self.robot.n
        way = np.minimum(self.room, _MAX_WAY)
        signs = 1 - 2 * (np.arange(4)[:, None] >> (np.arange(n) % 2) & 1)
        points = np.vstack([np.zeros(n), way * signs])
        turn = float((4 * way / (spec.share * self.limits.speed)).max())
        while True:
            shape = turns(points, turn, spec.dwell, spec.repeats, self.period, lead=False)
            size = self.largest(shape.p)
            if size >= 1 or turn > 60:
                break
            turn *= 1.3
        if size == 0:
            self.left_out.append("poses: gravity takes more than their share of the torque")
            return None
        size = min(size, 1.0)
        test = _test("poses", shape, size * float(way.max()), 0)
        return self.joined("poses", [(test, size * shape.p)])

    def of_chain(self) -> Iterator[PlannedMotion | None]:
        """Plan sines of each channel of the head that the joints can drive."""
        if not self.spec.chain or not has_head(self.robot):
            return
        for channel, direction in zip(CHANNELS, self.directions(), strict=True):
            if direction is None:
                self.left_out.append(f"chain, {channel}: the joints do not drive it")
                continue
            found: list[tuple[Test, Array]] = []
            most = float((self.room / np.abs(direction).clip(1e-9)).min())
            for omega in self.spec.chain:
                shape = sine(2 * np.pi / omega, self.spec.chain_cycles, self.period)
                p = np.outer(shape.p, direction)
                size = min(self.largest(p), most)
                if 2 * np.pi / omega < _SAMPLES * self.period or size == 0:
                    self.left_out.append(f"chain, {channel} at {omega:g} rad/s: not within limits")
                    continue
                test = _test("chain", shape, size * float(np.abs(direction).max()), 0)
                found.append((test.changed({"channel": channel}), size * p))
            yield self.joined(f"chain_{channel}", found)

    def directions(self) -> Iterator[Array | None]:
        """Yield the joints' way that drives each channel and the others least, length 1.

        None for a channel of which the joints give less than half. Forces per 1 m/s² and rates per
        1 rad/s² weigh the same.
        """
        n = self.robot.n
        q, zero, unit = np.tile(self.pose, (n, 1)), np.zeros((n, n)), np.eye(n)
        rest = head_motion(self.robot, q, zero, zero).specific_force
        force = head_motion(self.robot, q, zero, unit).specific_force - rest
        rate = head_motion(self.robot, q, unit, zero).angular_velocity
        jacobian = np.hstack([force, rate]).T
        inverse = np.linalg.pinv(jacobian, rcond=1e-6)
        given = np.diag(jacobian @ inverse)
        for way, share in zip(inverse.T, given, strict=True):
            yield way / np.linalg.norm(way) if share >= _DRIVEN else None

    # --- results ---------------------------------------------------------------------------------

    def made(self, kind: str, k: int, shape: Shape, size: float) -> Iterator[tuple[Test, Array]]:
        """Yield a test of joint k of a size, or of a smaller one within all limits."""
        p = self.along(k, shape.p)
        within = min(1.0, self.largest(size * p)) * size
        if within < 0.1 * size:
            self.leave(k, f"{kind}: the limits allow {within / size:.0%} of it")
            return
        if within < 0.99 * size:
            self.leave(k, f"{kind}: at {within / size:.0%} of its size, as the limits allow")
        largest = 1.0 if kind == "step" else float(np.abs(shape.p).max())
        yield _test(kind, shape, within * largest, k + 1), within * p

    def leave(self, k: int, why: str) -> None:
        """Keep a sentence on a test that joint k cannot do."""
        self.left_out.append(f"{self.names[k]}, {why}")

    def joined(self, name: str, tests: Sequence[tuple[Test, Array]]) -> PlannedMotion | None:
        """Join tests to a motion, and check it against all limits."""
        if not tests:
            return None
        h = self.period
        p, first = joined([p for _, p in tests], max(2, round(_REST / h)))
        motion = Motion.from_positions(h, self.pose + np.pad(p, ((1, 1), (0, 0)), mode="edge"))
        with within(name):
            checked_torque(self.robot, motion)
        placed = [
            test.changed({"start": test.start + i * h})
            for (test, _), i in zip(tests, first, strict=True)
        ]
        return PlannedMotion(TestMotion(name=name, tests=placed), motion)


def _test(kind: str, shape: Shape, size: float, joint: int) -> Test:
    return Test(
        kind=cast(Any, kind), joint=joint, size=size, start=shape.start, cycle=shape.cycle,
        cycles=shape.cycles, dwells=shape.dwells,
    )  # fmt: skip


# --- files ---------------------------------------------------------------------------------------


def write_plan(plan: AcceptancePlan, folder: Path, drives: str | Path | None = None) -> None:
    """Write manifest, specification, scenario and the files of each motion, all or none.

    Args:
        plan: the plan.
        folder: the folder.
        drives: file of the drives, for the files that they read; none by default.

    Raises:
        InputError: if a file cannot be written, or the drives do not fit.
    """
    scenario = plan.scenario
    own = {name: value for name, _, value in leaves(scenario) if name in _FILES and value}
    places = {k: str(Path(v).resolve()) for k, v in own.items() if not v.startswith("package:")}
    motions = [x.tests for x in plan.motions]
    manifest = Manifest(scenario=SCENARIO, motions=motions, left_out=plan.left_out)
    first = f"{motions[0].name}/{MOTION}"
    with replacing_files(folder) as new:
        write_text(new / SCENARIO, yaml_text(scenario, {**places, "motion": first}))
        write_yaml(new / SPEC, plan.spec)
        write_yaml(new / MANIFEST, manifest)
        for one in with_progress(plan.motions):
            one.motion.to_csv(new / one.tests.name / MOTION)
            if drives is not None:
                design = make_design(scenario, robot=plan.device, motion=one.motion)
                loaded = load_drives(drives, plan.device.n)
                write_files(
                    design, loaded, new / one.tests.name, cam_points=_CAM_POINTS,
                    title=one.tests.name, source=str(drives),
                )  # fmt: skip
