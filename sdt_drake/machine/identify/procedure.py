"""Identification of a robot: cut-off, friction, base parameters, physically consistent links."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from sdt_drake.io.arguments import one_of, positive
from sdt_drake.io.arrays import Array, Mask
from sdt_drake.io.errors import InputError
from sdt_drake.io.shown import Shown, Summary, of_joints
from sdt_drake.machine.diagnose.finding import Finding
from sdt_drake.machine.diagnose.fit import standing_still, suspicious_torques, weakly_excited
from sdt_drake.machine.diagnose.readings import misread
from sdt_drake.machine.diagnose.recording import check_recording
from sdt_drake.machine.identify import consistency, filtering
from sdt_drake.machine.identify.base_parameters import Unknown, rigid_parameters
from sdt_drake.machine.identify.cutoff import CUTOFFS, chosen
from sdt_drake.machine.identify.equations import Equations, equations
from sdt_drake.machine.identify.estimation import Estimate, Prior, estimate
from sdt_drake.machine.identify.plant import PlantFriction, plant_friction, scenario_torque
from sdt_drake.machine.recordings.columns import Columns
from sdt_drake.machine.recordings.reading import Recordings, recordings_of
from sdt_drake.machine.recordings.recorded import Recorded, check_different
from sdt_drake.robot.device import friction_parameters
from sdt_drake.robot.lacks import MASSES
from sdt_drake.robot.robot import Robot, load_robot

ONLY = ("payload", "friction")
"""Parameters to identify alone."""

MAX_ROWS = 20_000
"""Approximate largest number of rows of the equations. A row takes about 8 kB. Of longer
recordings, parts are compared."""

_MAX_DISTANCE, _REPEATED = 0.15, 0.9  # distance of similar states over their spread; their share
_ROWS_PER_PERIOD = 4.0  # rows in a period of the cut-off
_CLIPPED = 0.05  # distance from the value at which a torque is clipped, over its range
_MIN_RATE = 2.0  # least sample rate [Hz]
_PRIOR_STD = 1.0  # prior standard deviation of a parameter over its typical size

Parts = list[tuple[int, float, filtering.Stretch]]


@dataclass(frozen=True, eq=False, repr=False)
class Identified(Shown):
    """The result of an identification."""

    nominal: Robot
    """The robot of the file."""
    unknown: Unknown
    """The parameters to identify."""
    recordings: tuple[Recorded, ...]
    """The fitted recordings, then those held out."""
    equations: Equations
    """All rows, fitted and held out."""
    estimate: Estimate
    """Base parameters and friction by least squares."""
    consistent: consistency.Consistent
    """Physically consistent links and motors."""
    friction: Array
    """Friction parameters for the consistent links, in the order of `estimate`, shape (f,)."""
    predicted: Array
    """Torque of the consistent robot with the friction laws, joint side [N m], shape (M, n)."""
    cutoff: float
    """Cut-off frequency of the compared torques [Hz]."""
    speeds: bool
    """True if recorded speeds were used."""
    notes: tuple[str, ...]
    """Changes of the recordings, as sentences."""
    findings: tuple[Finding, ...]
    """Findings that speak against the recordings or the robot's file."""

    @cached_property
    def plant_friction(self) -> PlantFriction:
        """Damping of the written robot, and friction of its scenario."""
        return plant_friction(
            self.nominal, self.equations, self.estimate, self.friction, self.consistent
        )

    @cached_property
    def written(self) -> Array:
        """Torque of the written robot with friction of its scenario [N m], shape (M, n)."""
        eq, files = self.equations, self.plant_friction
        own = friction_parameters(files.friction, eq.n)
        rubs = scenario_torque(eq, replace(own, viscous=own.viscous + files.damping))
        return np.asarray(eq.known + eq.rigid @ self.consistent.beta + rubs)

    @property
    def warnings(self) -> tuple[str, ...]:
        """The findings, as sentences."""
        return tuple(map(str, self.findings))

    def summary(self) -> Summary:
        left = {"by the file [%]": self.equations.nominal, "identified [%]": self.written}
        columns = {name: (".2f", 100 * self.left(tau, held_out=True)) for name, tau in left.items()}
        files = ", ".join(recorded.path.name for recorded in self.recordings)
        title = f"{self.nominal.name} from {files}: torque not explained, in held-out data"
        return of_joints(title, columns, self.nominal.joint_names)

    def left(self, predicted: Array, *, held_out: bool) -> Array:
        """Return the torque not explained by a prediction [-], shape (n,).

        It is the RMS residual over the RMS torque while the joint moves.

        Args:
            predicted: Predicted torque, joint side [N m], shape (M, n).
            held_out: True for held-out rows, False for fitted ones.
        """
        return self.equations.not_explained(predicted, self.equations.fit != held_out)


def identify(
    robot: Robot | str | Path,
    recordings: Recordings,
    *,
    validate: Recordings = (),
    columns: str | Path | Columns | None = None,
    side: str | None = None,
    only: str | None = None,
    payload: str = "payload",
    cutoff: float | None = None,
    held_out: float = filtering.HELD_OUT,
) -> Identified:
    """Identify a robot from recordings, as `sdt-drake identify`.

    Args:
        robot: the robot before identification, its SDF or URDF file, or the name of a shipped one.
        recordings: one recording or a list. Each is a file with time [s], q_k [rad] and tau_k
            [N m] of every joint k, or an object from `read_recording`.
        validate: held-out recordings; by default the end of each of `recordings` is held out.
        columns: names of the files' columns, or a YAML file with them.
        side: side of the torques, "joint" or "motor". The default is "motor" for a recording of
            `simulate` and "joint" for all others.
        only: "payload" or "friction" to identify it alone and take all else from the file.
        payload: the link that `only="payload"` identifies.
        cutoff: frequency below which torques are compared [Hz]; by default chosen from the
            recordings.
        held_out: share at the end of each recording that is held out without `validate` [-].

    Returns:
        Parameters with their uncertainty, and `findings` that speak against the recordings.
        `sdt_drake.show.reports.identification` writes figures and files of it.

    Raises:
        InputError: naming the wrong argument or recording.

    Examples:
        >>> import numpy as np
        >>> import sdt_drake as sdt
        >>> to_and_fro = np.sin(np.linspace(0, 4 * np.pi, 401)) ** 3
        >>> speeds = np.outer(to_and_fro, [0.1, 0.2, 0.2, 0.3])
        >>> motion = sdt.Motion.from_speeds(0.005, np.zeros(4), speeds)
        >>> design = sdt.design(sdt.load("real_device"), motion=motion)
        >>> sdt.simulate(design).save("run.csv")
        >>> found = sdt.identify("sdt", "run.csv", only="friction")
        >>> print(found)
        Identified sdt from run.csv: torque not explained, in held-out data
        joint        by the file [%]  identified [%]
        1 planetary             3.66            0.29
        2 roll                 88.10            5.20
        3 pitch                 6.14            0.29
        4 yaw                  10.89            0.47
    """
    if only is not None:
        one_of(only, "only", ONLY)
    if cutoff is not None:
        positive(cutoff, "cutoff")
    if positive(held_out, "held_out") >= 1:
        raise InputError(f"{held_out:g}, expected less than 1", place="held_out")
    robot = (robot if isinstance(robot, Robot) else load_robot(robot)).having(MASSES)
    fitted, held_out_recordings = (
        recordings_of(given, name, robot, columns, side=side)
        for name, given in (("recordings", recordings), ("validate", validate))
    )
    if not fitted:
        raise InputError("none given, expected at least one", place="recordings")
    check_different([*fitted, *held_out_recordings])
    parts, notes = parts_of(fitted, held_out_recordings, held_out)
    unknown, free = _unknown(robot, only, payload)
    prior = belief(robot, unknown)
    _check_rate(parts)
    _check_cutoff(cutoff, parts)
    cutoff, speeds = _choice(robot, unknown, prior, parts, cutoff)
    few = few_of(parts, cutoff)
    if not speeds:
        few = [(source, end, replace(stretch, v=None)) for source, end, stretch in few]
    eq = equations(robot, unknown, few, cutoff)
    _check_rows(eq, cutoff, fitted[0].path)
    found = estimate(eq, prior)
    r, S, N = len(found.beta), found.covariance, found.misfit
    findings = [one for x in (*fitted, *held_out_recordings) for one in check_recording(robot, x)]
    hidden = [one for one in findings if one.hides]
    wrong = [] if hidden else misread(robot, replace(eq, fit=_good_rows(eq, findings)))
    findings += [*standing_still(eq), *wrong]
    try:
        consistent = consistency.nearest_consistent(
            robot, unknown, free, found.beta, N[:r, :r], S[:r, :r]
        )
    except InputError as error:
        raise InputError("; ".join([f"{error}", _farthest(robot, eq), *map(str, wrong)])) from None
    change = consistent.beta - found.beta
    # Friction changes with the base parameters by their correlation.
    friction = found.friction + N[r:, :r] @ np.linalg.solve(N[:r, :r], change)
    predicted = eq.known + np.einsum("mkr,r->mk", eq.rigid, consistent.beta)
    predicted = predicted + found.friction_torque(eq, friction)
    before, after = (np.sqrt(np.diagonal(x)) for x in (np.linalg.inv(prior.precision), S[:r, :r]))
    spoilt = [one for one in findings if one.spoils]
    if not spoilt:
        findings += suspicious_torques(robot, eq, found, predicted, cutoff)
    findings += weakly_excited(found.condition, before, after, unknown.base.words)
    return Identified(
        nominal=robot,
        unknown=unknown,
        recordings=(*fitted, *held_out_recordings),
        equations=eq,
        estimate=found,
        consistent=consistent,
        friction=friction,
        predicted=predicted,
        cutoff=cutoff,
        speeds=speeds,
        notes=(*notes, *_compared(parts, few, eq, speeds), *_unchecked(hidden, spoilt)),
        findings=tuple(findings),
    )


def parts_of(
    fitted: Sequence[Recorded], held_out: Sequence[Recorded], share: float
) -> tuple[Parts, list[str]]:
    """Return the stretches of recordings, and notes on their changes.

    Each stretch is a tuple of the index of its recording, the time from which it is held out [s],
    and the stretch.
    """
    parts: Parts = []
    notes = []
    for number, recorded in enumerate((*fitted, *held_out)):
        _check_alive(recorded)
        found, changes = filtering.stretches(recorded)
        notes += [f"{recorded.path.name}: {line}" for line in (*recorded.notes, *changes)]
        held_from = -np.inf if number >= len(fitted) else np.inf
        if not held_out:
            start, end = found[0].start, found[-1].end
            held_from = end - share * (end - start)
        parts += [(number, held_from, stretch) for stretch in found]
    return parts, notes


def _choice(
    robot: Robot, unknown: Unknown, prior: Prior, parts: Parts, cutoff: float | None
) -> tuple[float, bool]:
    """Choose the cut-off, unless it is given, and the source of speeds, by the fitted data."""
    fitted = [(source, end, stretch.before(end)) for source, end, stretch in parts]
    fitted = [part for part in fitted if len(part[2].q) > filtering.MIN_SAMPLES]
    if not fitted:
        return cutoff or CUTOFFS[0], False
    return chosen(robot, unknown, prior, [one for *_, one in few_of(fitted, CUTOFFS[-1])], cutoff)


def few_of(parts: Parts, cutoff: float) -> Parts:
    """Select parts of long recordings for about MAX_ROWS rows, the same for each recording."""
    sources = sorted({source for source, *_ in parts})
    seconds = MAX_ROWS / (_ROWS_PER_PERIOD * cutoff) / len(sources)
    few: Parts = []
    for source in sources:
        own = [(held_from, stretch) for other, held_from, stretch in parts if other == source]
        windows = filtering.spread([stretch for _, stretch in own], seconds, cutoff)
        few += [(source, own[0][0], window) for window in windows]
    return few


def _compared(parts: Parts, few: Parts, eq: Equations, speeds: bool) -> Iterator[str]:
    """Yield sentences on what is compared.

    They tell the parts that `few_of` leaves out, the source of speeds if some were recorded, and
    held-out data that repeat the fitted motion.
    """
    lasts, whole = (sum(x.end - x.start for *_, x in every) for every in (few, parts))
    if lasts < whole:
        yield f"{lasts:.3g} s of {whole:.3g} s are compared, in {len(few)} evenly spread parts"

    if all(stretch.v is not None for *_, stretch in parts):
        one, other = ("recorded", "differentiated")[:: 1 if speeds else -1]
        yield f"{one} speeds are used: they predict torques better than {other} ones"

    sizes = [np.maximum(x.std(axis=0), 1e-9) for x in (eq.q, eq.v, eq.vd)]  # 0 of a joint at rest
    states = np.hstack([x / size for x, size in zip((eq.q, eq.v, eq.vd), sizes, strict=True)])
    away, _ = cKDTree(states[eq.fit]).query(states[~eq.fit])
    if np.mean(away < _MAX_DISTANCE * np.sqrt(states.shape[1])) > _REPEATED:
        yield (
            "the held-out data repeat the fitted motion, so they show only the noise; give a "
            "recording of another motion to validate"
        )


def _farthest(robot: Robot, eq: Equations) -> str:
    """Return a sentence on the joint that the robot's file explains worst."""
    left = eq.not_explained(eq.nominal, eq.fit)
    k = int(np.nanargmax(left))
    return (
        f"{robot.joint(k)} is farthest from the file, with {100 * left[k]:.0f} % of its torque not "
        "explained: check its columns, units and limits, or identify friction alone "
        '(only="friction")'
    )


def _good_rows(eq: Equations, findings: Sequence[Finding]) -> Mask:
    """Return the mask of fitted rows in which no signal is frozen or clipped, shape (M,)."""
    good = eq.fit.copy()
    for one in findings:
        seen = one.evidence
        if one.kind == "frozen":
            good &= (eq.time < seen["first_s"]) | (eq.time > seen["first_s"] + seen["duration_s"])
        elif one.kind == "clipped":
            tau = eq.tau[:, one.joints[0] - 1]
            good &= np.abs(tau - seen["torque_N_m"]) > _CLIPPED * np.ptp(tau)
    return good if good.any() else eq.fit


def _unchecked(hidden: Sequence[Finding], spoilt: Sequence[Finding]) -> Iterator[str]:
    """Yield sentences on the checks that are left out."""
    kinds = ", ".join(dict.fromkeys(one.kind for one in hidden or spoilt))
    what = "delays of torques, springs, hysteresis and other forces are"
    if hidden:
        what = f"units, order and signs of torques, {what}"
    if spoilt:
        yield f"{what} not looked for before the warning is heeded ({kinds})"


def _check_alive(recorded: Recorded) -> None:
    """Refuse a recording with a constant torque or without motion."""
    q, tau = recorded.signals["q"], recorded.signals["tau"]
    dead = np.flatnonzero(np.ptp(tau, axis=0) == 0)
    if len(dead):
        value = f"{tau[0, dead[0]] + 0.0:g} N m"
        raise InputError(
            f"{recorded.path}: tau_{dead[0] + 1}: {value} in all samples, expected measured torques"
        )
    if np.all(np.ptp(q, axis=0) < 1e-6):
        raise InputError(f"{recorded.path}: no joint moves")


def _check_rate(parts: Parts) -> None:
    """Refuse recordings that are too slow for any motion."""
    rate = 1 / max(stretch.period for *_, stretch in parts)
    if rate < _MIN_RATE:
        raise InputError(
            f"recorded at {rate:.4g} Hz, expected at least {_MIN_RATE:g} Hz; is the time in "
            "milliseconds (time_factor: 0.001 in the mapping file)?"
        )


def _check_cutoff(cutoff: float | None, parts: Parts) -> None:
    """Refuse a cut-off that is too high for the sample rate."""
    most = filtering.MAX_CUTOFF_SHARE / max(stretch.period for *_, stretch in parts)
    if cutoff is not None and cutoff >= most:
        raise InputError(
            f"{cutoff:g} Hz, expected less than {most:.4g} Hz, {filtering.MAX_CUTOFF_SHARE:g} of "
            "the sample rate",
            place="cutoff",
        )


def _check_rows(eq: Equations, cutoff: float, path: Path) -> None:
    """Refuse recordings without rows to fit or to hold out."""
    for rows, what in ((eq.fit, "fit"), (~eq.fit, "hold out")):
        if not rows.any():
            raise InputError(
                f"{path}: too short to {what} anything below {cutoff:.3g} Hz, expected a longer "
                "recording, another held_out=... or a higher cutoff=..."
            )
    if not eq.moves.any():
        raise InputError(f"{path}: no joint moves more than the noise")


def _unknown(robot: Robot, only: str | None, payload: str) -> tuple[Unknown, list[str]]:
    """Return the parameters to identify, and the names of the links that may change."""
    if only == "friction":
        return Unknown.nothing(), []
    if only == "payload":
        return Unknown.body(robot, payload), [payload]
    return Unknown.everything(robot), [link.name for link in consistency.links_of(robot)]


def belief(robot: Robot, unknown: Unknown) -> Prior:
    """Return the prior of the base parameters.

    The mean is that of the file. The standard deviation follows from the typical size of the
    parameters.
    """
    whole = _PRIOR_STD * consistency.rigid_scale(robot)
    K = unknown.base.combination
    covariance = (K * whole[unknown.columns] ** 2) @ K.T
    mean = K @ rigid_parameters(robot)[unknown.columns]
    return Prior(mean, np.asarray(np.linalg.inv(covariance), dtype=np.float64))
