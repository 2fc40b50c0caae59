"""Judge recordings of an acceptance test: characteristics, intervals, and limits."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from sdt_drake.io.arguments import a_path
from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError
from sdt_drake.io.yaml_files import load_yaml
from sdt_drake.machine.accept.measured import Measured
from sdt_drake.machine.accept.plan import MANIFEST, MOTION, SPEC, PlannedMotion
from sdt_drake.machine.accept.results import Accepted, Characteristic
from sdt_drake.machine.accept.spec import Acceptance, Manifest, load_acceptance
from sdt_drake.machine.diagnose import constants as c
from sdt_drake.machine.learn.matching import found_reference
from sdt_drake.machine.recordings.columns import Columns
from sdt_drake.machine.recordings.reading import Recordings, recordings_of
from sdt_drake.machine.recordings.recorded import Recorded, check_different
from sdt_drake.motion import Motion
from sdt_drake.robot.robot import Robot
from sdt_drake.run.design import load_device
from sdt_drake.run.scenario import load_scenario

_MOVED = 1e-4  # rad


def accept_judge(
    folder: str | Path,
    recordings: Recordings,
    *,
    spec: Acceptance | str | Path | None = None,
    columns: Columns | str | Path | None = None,
    side: str | None = None,
) -> Accepted:
    """Judge recordings of the motions of a planned folder, as `sdt-drake accept judge`.

    Args:
        folder: folder of `sdt-drake accept plan`.
        recordings: recordings with q and q_ref, in any order: files or from `read_recording`.
        spec: limits; those of the folder by default.
        columns, side: as in `identify`.

    Raises:
        InputError: naming the wrong file. Also for a recording of another motion, or one that is
            too short, too slow, or in which a motor is at its torque limit.
    """
    folder = Path(a_path(folder, "folder"))
    manifest, _ = load_yaml(Manifest, folder / MANIFEST)
    robot = load_device(load_scenario(manifest.scenario))
    given = folder / SPEC if spec is None else spec
    if not isinstance(given, Acceptance):
        given = load_acceptance(a_path(given, "spec"), robot.n)
    planned = [
        PlannedMotion(one, Motion.from_csv(folder / one.name / MOTION)) for one in manifest.motions
    ]
    recorded = recordings_of(
        recordings, "recordings", robot, columns, needs=("q", "q_ref"), side=side
    )
    if not recorded:
        raise InputError("none given, expected at least one", place="recordings")
    check_different(recorded)
    return judged(robot, given, planned, recorded, manifest.left_out)


def judged(
    robot: Robot,
    spec: Acceptance,
    planned: Sequence[PlannedMotion],
    recorded: Sequence[Recorded],
    left_out: Sequence[str] = (),
) -> Accepted:
    """Judge recordings of planned motions; arguments are checked, recordings are not.

    Raises:
        InputError: as `accept_judge`.
    """
    found: dict[str, list[Characteristic]] = {}
    source: dict[str, Path] = {}
    for one in recorded:
        motion, shift = _matched(planned, one)
        name = motion.tests.name
        if name in source:
            text = f"is a recording of {name}, as {source[name]}; expected one of each motion"
            raise InputError(f"{one.path}: {text}")
        source[name] = one.path
        found[name] = [*Measured(robot, spec, motion, one, shift).characteristics()]
    missing = [x.tests.name for x in planned if x.tests.name not in found]
    notes = (*left_out, *(f"{name}: not recorded" for name in missing))
    ordered = [x for motion in planned for x in found.get(motion.tests.name, ())]
    return Accepted(robot, spec, tuple(ordered), notes)


def _matched(planned: Sequence[PlannedMotion], recorded: Recorded) -> tuple[PlannedMotion, float]:
    """Return the planned motion of a recording, and its start in the recording's time [s]."""
    q_ref = recorded.signals["q_ref"]
    begins = _moves(recorded.time, q_ref)  # the best start of a recording that lacks the end
    tried = [
        min(found_reference(recorded, q_ref, one.motion, near) for near in (None, begins - start))
        for one in planned
        for start in [_moves(one.motion.time, one.motion.q)]
    ]
    i = int(np.argmin([off for off, _ in tried]))
    off, shift = tried[i]
    if off > c.MAX_REFERENCE_ERROR:
        names = ", ".join(x.tests.name for x in planned)
        raise InputError(
            f"{recorded.path}: q_ref is {np.degrees(off):.3g} deg from the nearest planned motion, "
            f"{planned[i].tests.name}, expected a recording of one of {names}; check the motion, "
            "the order of the joints and the units"
        )
    return planned[i], shift


def _moves(time: Array, q: Array) -> float:
    """Return the time at which positions begin to move [s]."""
    return float(time[np.argmax(np.abs(q - q[0]).max(axis=1) > _MOVED)])
