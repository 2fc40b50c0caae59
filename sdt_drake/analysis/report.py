"""The study as files: summary.json, table1.md, report.md, CSV, figures and block diagrams."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from sdt_drake import paper
from sdt_drake.analysis import plots
from sdt_drake.analysis.block_diagrams import DIAGRAMS, write_block_diagram
from sdt_drake.analysis.claims import NOT_COMPARABLE, NOT_REPRODUCED, REPRODUCED, Claim, judge
from sdt_drake.analysis.comparison import Compared
from sdt_drake.analysis.study import Run, Stopwatch, Study, table1
from sdt_drake.analysis.tracking import HeadTracking
from sdt_drake.dynamics import TorqueGroups, effective_inertia
from sdt_drake.errors import replacing
from sdt_drake.graphviz import NO_GRAPHVIZ, has_graphviz
from sdt_drake.pilot import CHANNELS, felt_difference
from sdt_drake.tables import write_table
from sdt_drake.versions import versions

# Which run is behind which file: plant, process, algorithm, controller, disturbed.
RECORDINGS = {
    "axis_pi": ("axis", "i_eff_max", "printed", "pi", False),
    "axis_pi_ctc": ("axis", "i_eff_max", "printed", "pi_ctc", True),
    "coupled_pi": ("coupled", "multibody", "consistent", "pi", False),
    "coupled_pi_ctc": ("coupled", "multibody", "consistent", "pi_ctc", False),
}
_COUPLED_PRINTED = ("coupled", "multibody", "printed", "pi_ctc", False)

PROVENANCE = (
    "The paper publishes motors, gear, payload and Table 1, but no geometry, no masses, no inertia "
    "tensors and no data behind Figure 2. The device here is therefore ours: a physically valid "
    "rigid chain, calibrated so that the largest effective inertias and the variation of joint 2 "
    "come out of its mass matrix. Its motion is assumed, with what the text says of Figure 2, and "
    "so is the frequency of the disturbance, 1 Hz."
)


def write_study(study: Study, folder: Path, watch: Stopwatch) -> list[Claim]:
    """Write all files of the study into `folder`, each replaced whole; returns the claims."""
    claims = judge(study)
    with watch.stage("CSV files"):
        write_reference(study, folder / "reference.csv")
        for name, key in RECORDINGS.items():
            study.run(*key).recording.to_csv(folder / f"{name}.csv")
    with watch.stage("figures"):
        _save_all(figures(study), folder)
    with watch.stage("block diagrams"):
        for name in DIAGRAMS:
            write_block_diagram(name, study.design, folder / "diagrams")
    with watch.stage("beyond the paper"):  # its runs have gone on meanwhile
        _save_all({"controllers": controllers_figure(study)}, folder)
    title = "Table 1, from the SDF and the reference motion"
    _write(folder / "table1.md", f"# {title}\n\n{table1_markdown(study)} {PROVENANCE}\n")
    _write(folder / "report.md", report_markdown(study, claims))
    _write(folder / "summary.json", json.dumps(summary(study, claims), indent=1) + "\n")
    return claims


def write_reference(study: Study, path: Path) -> None:
    """The motion with its torque groups (joint side) and loads (motor side)."""
    design, motion = study.design, study.design.motion
    groups: TorqueGroups = design.torques
    columns = {
        "q_ref": motion.q,
        "v_ref": motion.v,
        "vd_ref": motion.vd,
        "tau_inertial": groups.inertial,
        "tau_reaction": groups.reaction,
        "tau_velocity": groups.velocity,
        "tau_gravity": groups.gravity,
        "tau_coupled": groups.coupled,
        **design.loads._asdict(),
        "i_eff": effective_inertia(design.robot, groups.d_kk),
    }
    write_table(path, motion.time, columns)


def figures(study: Study) -> dict[str, Figure]:
    """The figures of the paper's runs by file name."""
    motion, names = study.design.motion, study.design.robot.joint_names
    axis = {
        "PI": study.run(*RECORDINGS["axis_pi"]).recording,
        "PI + CTC": study.run(*RECORDINGS["axis_pi_ctc"]).recording,
    }
    coupled = {
        "PI": study.run(*RECORDINGS["coupled_pi"]).recording,
        "PI + CTC": study.run(*RECORDINGS["coupled_pi_ctc"]).recording,
        "PI + CTC, printed sign": study.run(*_COUPLED_PRINTED).recording,
    }
    time = motion.time
    reference = ("reference", plots.REFERENCE, "-", motion.v)
    return {
        "figure2": plots.figure2(motion, names),
        "figure4": plots.step_responses(
            "Step responses, axis 1 at its largest inertia (Figure 4)", study.steps
        ),
        "figure7": plots.speeds(
            "Trajectory tracking, decoupled axes, Algorithm 1 as printed (Figure 7)",
            time,
            [reference, *plots.tracking_lines(axis, "v")],
            names,
        ),
        "figure8": plots.speed_errors(
            "Speed errors, decoupled axes, Algorithm 1 as printed (Figure 8)",
            time,
            plots.tracking_lines(axis, "speed_error"),
            names,
            motion,
        ),
        "coupled_errors": plots.speed_errors(
            "Speed errors on the coupled MultibodyPlant (beyond the paper)",
            time,
            plots.tracking_lines(coupled, "speed_error"),
            names,
            motion,
        ),
    }


def controllers_figure(study: Study) -> Figure:
    """The paper's controllers and more; waits for their runs."""
    title = "Controllers on the coupled MultibodyPlant, model known exactly (beyond the paper)"
    return plots.comparison(title, study.beyond)


def _save_all(by_name: Mapping[str, Figure], folder: Path) -> None:
    for name, figure in by_name.items():
        for suffix in ("png", "svg"):
            plots.save(figure, folder / f"{name}.{suffix}")


def summary(study: Study, claims: Sequence[Claim]) -> dict[str, object]:
    """The content of summary.json; a number that does not exist is null."""
    steps = {
        structure: {
            name: getattr(step.metrics, name)
            for name in ("rise_time", "settling_time", "overshoot_percent")
        }
        for structure, step in study.steps.items()
    }
    content = {
        "table1": table1(study.design),
        "step_response": {**steps, "published": paper.FIGURE4},
        "tracking": [_tracking_entry(run) for run in study.runs],
        "claims": [asdict(claim) for claim in claims],
        "beyond": [_beyond_entry(compared) for compared in study.beyond],
        "versions": versions(),
        "wall_time_s": dict(study.wall_time_s),
    }
    return _plain(content)


def table1_markdown(study: Study) -> str:
    """Table 1, computed and published, side by side."""
    header = (
        "joint",
        "I_eff,max [kg m²]",
        "median",
        "min",
        "variation [%]",
        "K_PS [N m s/rad]",
        "K_IS [N m/rad]",
        "ζ at max",
        "median",
        "min",
    )
    formats = ("d", ".2f", ".2f", ".2f", ".2f", ".4g", ".4g", ".3f", ".3f", ".3f")
    rows = []
    for row in table1(study.design):
        published = row.pop("published")
        rows.append([format(v, f) for v, f in zip(row.values(), formats, strict=True)])
        k = row["joint"] - 1
        rows.append(
            ["*published*"]
            + [
                paper.TABLE1[name][k] if name in paper.TABLE1 else ""
                for name in list(published)[1:]
            ]
        )
    return f"{_table(header, rows)}\nInertias and gains are motor side."


def report_markdown(study: Study, claims: Sequence[Claim]) -> str:
    """The whole study in reading order."""
    counts = ", ".join(
        f"{sum(c.verdict == verdict for c in claims)} {verdict}"
        for verdict in (REPRODUCED, NOT_REPRODUCED, NOT_COMPARABLE)
    )
    diagrams = "\n\n".join(
        f"![{name}](diagrams/{name}.svg)" if has_graphviz() else f"`diagrams/{name}.dot`"
        for name in DIAGRAMS
    )
    missing = "" if has_graphviz() else f"\nNo .svg of the block diagrams: {NO_GRAPHVIZ}.\n"
    parts = [
        "# Computed torque control for a spatial disorientation trainer, recomputed in Drake",
        f"{len(claims)} claims: {counts}.",
        PROVENANCE,
        "## The motion\n\n![Figure 2](figure2.png)",
        f"## Table 1, from the SDF and the motion\n\n{table1_markdown(study)}",
        "## Step response\n\n![Figure 4](figure4.png)",
        "## The models\n\nDrawn by the builders of the loops that are simulated, with the load "
        "torque on line and the elements of the PI controller."
        f"{missing}\n\n{diagrams}",
        "## Tracking, decoupled axes (the paper's models)\n\n"
        "![Figure 7](figure7.png)\n\n![Figure 8](figure8.png)",
        "## Tracking, coupled MultibodyPlant\n\n"
        "Here the joints move each other by their dynamics; the controllers are the same.\n\n"
        "![errors on the coupled plant](coupled_errors.png)",
        "## All runs\n\nLargest, RMS and constant-speed (from 1 s after the speed became constant) "
        "error of the joint speeds, largest position error, share of time in saturation; joint "
        f"side; joints 1 to {study.design.robot.n}. Process i_eff_min is the published I_eff,max "
        "less the published variation, for joint 4 too. A is the amplitude of the disturbance."
        f"\n\n{_runs_table(study.runs)}",
        f"## Claims\n\n{_claims_table(claims)}",
        _beyond_markdown(study),
        "## Versions and wall time\n\n"
        + _table(("", "version"), [[k, v] for k, v in versions().items()])
        + "\n"
        + _table(("stage", "s"), [[k, f"{v:.2f}"] for k, v in study.wall_time_s.items()]),
    ]
    return "\n\n".join(parts) + "\n"


def _beyond_markdown(study: Study) -> str:
    """The last chapter: what other controllers buy on the same motion."""
    by_label = {compared.label: compared for compared in study.beyond}
    pi, pi_id = by_label["pi"].tracking, by_label["pi_id"].tracking
    gain = pi.rms_speed_error / pi_id.rms_speed_error
    drift, kept = (
        np.degrees(by_label[label].tracking.max_abs_position_error) for label in ("pi", "p_pi+id")
    )
    header = (
        "controller", "largest [rad/s]", "RMS [rad/s]", "constant speed [rad/s]",
        "position [deg]", "torque RMS [%]", "torque peak [%]", "felt [% of time]",
        "largest rotation", "largest force", "blocks", "needs to know",
    )  # fmt: skip
    rows = [
        [
            f"`{c.label}`",
            _joined(c.tracking.max_abs_speed_error, ".4f"),
            _joined(c.tracking.rms_speed_error, ".5f"),
            _joined(c.tracking.constant_speed_error, ".4f"),
            _joined(np.degrees(c.tracking.max_abs_position_error), ".3f"),
            _joined(100 * c.motors.rms_share, ".1f"),
            _joined(100 * c.motors.peak_share, ".1f"),
            f"{100 * c.head.felt.share:.1f}",
            _worst(c.head.felt.worst_rotation),
            _worst(c.head.felt.worst_force),
            str(c.blocks),
            ", ".join(c.needs),
        ]
        for c in study.beyond
    ]
    return (
        "## Beyond the paper: the same motion with other controllers\n\n"
        "The coupled plant, an ideal drive, no friction, and a model that is exact. On this plant "
        "most of the error of `pi` and `pi_ctc` is the lag of the loop behind its reference. "
        "Feeding the whole inverse dynamics of the reference forward, and K_PS v_ref with it, "
        f"takes that away: `pi_id` has {gain.min():.0f} to {gain.max():.0f} times less RMS speed "
        "error than `pi`, with the same gains and no more torque. A speed loop alone loses the "
        f"position, here up to {drift.max():.1f} deg; with a position loop around it and the same "
        f"feedforward (`p_pi+id`) it is kept within {kept.max():.3f} deg. Scheduling the gains "
        "with the inertia does not pay: where the inertia is small it makes the loop softer "
        "against the load. `sdt-drake compare` runs this table on any scenario, with friction, "
        "drives and a wrong model.\n\n"
        f"{_noticed(by_label)}\n\n"
        "![controllers on the coupled plant](controllers.png)\n\n"
        f"{_table(header, rows)}\n"
        "Joint side, joints 1 to n; torques as shares of the motor's largest; felt: share of "
        "time in which the pilot could feel the error, and the largest rotation and force in "
        "multiples of what is just felt, in the axes of the head; blocks: Drake systems in the "
        "loop. The thresholds are those of attentive people in silence and dark, and are assumed "
        "to hold for differences: what is said not to be felt is not, what could be felt need "
        "not be."
    )


def _noticed(by_label: Mapping[str, Compared]) -> str:
    """Does the pilot notice that CTC is missing?"""
    without, with_ctc = by_label["pi"].head, by_label["pi_ctc"].head
    between = felt_difference(
        with_ctc.achieved, without.achieved, by_label["pi"].design.motion.period
    )
    question = "**Does the pilot notice that CTC is missing?**"
    apart = (
        f"at most {_worst(between.worst_rotation)} and {_worst(between.worst_force)} times what "
        "is just felt"
    )
    if between.share == 0:
        return f"{question} No: the rides with and without it differ by {apart}."

    def felt(label: str) -> str:
        return f"{100 * by_label[label].head.felt.share:.1f} %"

    gained = without.felt.share - with_ctc.felt.share
    angles = [head.felt_from_angles.share for head in (without, with_ctc)]
    because = (
        ": both lose the position, and gravity and the centrifugal force then pull from another "
        "side"
        if min(angles) > 0.5 * with_ctc.felt.share
        else ""
    )
    return (
        f"{question} Who rode both could tell `pi` and `pi_ctc` apart {100 * between.share:.0f} % "
        f"of the time ({apart}). As an error, against the motion that was asked for, "
        f"{'much' if gained >= 0.1 else 'little'} is gained: it could be felt {felt('pi')} of the "
        f"time without CTC and {felt('pi_ctc')} with it, by the wrong joint angles alone "
        f"{100 * angles[0]:.1f} and {100 * angles[1]:.1f} %{because}. With a position loop around "
        f"the speed loop it is {felt('p_pi')} without feedforward, {felt('p_pi+ctc')} with CTC and "
        f"{felt('p_pi+id')} with the whole inverse dynamics."
    )


def _worst(channel: tuple[str, float]) -> str:
    name, multiple = channel
    return f"{multiple:.2f} ({name})"


def _runs_table(runs: Iterable[Run]) -> str:
    header = (
        "plant", "process", "algorithm", "controller", "A", "largest [rad/s]", "RMS [rad/s]",
        "constant speed [rad/s]", "position [deg]", "saturated [%]",
    )  # fmt: skip
    rows = []
    for run in runs:
        s, t = run.scenario, run.tracking
        rows.append([
            s.plant.kind, run.process, s.algorithm, s.controller.kind,
            f"{s.disturbance.amplitude:g}",
            _joined(t.max_abs_speed_error, ".4f"), _joined(t.rms_speed_error, ".4f"),
            _joined(t.constant_speed_error, ".4f"),
            _joined(np.degrees(t.max_abs_position_error), ".2f"),
            _joined(100 * t.saturated_fraction, ".1f"),
        ])  # fmt: skip
    return _table(header, rows)


def _claims_table(claims: Iterable[Claim]) -> str:
    rows = [
        [c.id, c.statement, _text(c.published, 6), _text(c.computed), f"**{c.verdict}**", c.why]
        for c in claims
    ]
    return _table(("id", "the paper", "published", "computed", "verdict", "why"), rows)


def _beyond_entry(compared: Compared) -> dict[str, object]:
    return {
        "controller": compared.label,
        **asdict(compared.tracking),
        **asdict(compared.motors),
        "felt": None if compared.head is None else _felt_entry(compared.head),
        "blocks": compared.blocks,
        "needs": list(compared.needs),
    }


def _felt_entry(head: HeadTracking) -> dict[str, object]:
    return {
        "share": head.felt.share,
        "share_from_angles": head.felt_from_angles.share,
        "channels": list(CHANNELS),
        "largest": head.felt.largest,
        "channel_share": head.felt.channel_share,
    }


def _tracking_entry(run: Run) -> dict[str, object]:
    scenario = run.scenario
    return {
        "plant": scenario.plant.kind,
        "process": run.process,
        "algorithm": scenario.algorithm,
        "controller": scenario.controller.kind,
        "disturbance_amplitude": scenario.disturbance.amplitude,
        **asdict(run.tracking),
    }


def _plain(value: object) -> object:
    """Only what JSON knows."""
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, np.ndarray | np.generic):
        return _plain(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def _text(value: object, digits: int = 4) -> str:
    if isinstance(value, dict):
        items = ((key.replace("_", " "), _text(item, digits)) for key, item in value.items())
        return "; ".join(f"{key} {text}" for key, text in items)
    if isinstance(value, list):
        return ", ".join(_text(item, digits) for item in value)
    if isinstance(value, bool) or not isinstance(value, float):
        return str(value)
    return f"{value:.{digits}g}"


def _joined(values: Iterable[float], spec: str) -> str:
    return " ".join("–" if math.isnan(v) else format(v, spec) for v in values)


def _table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = [header, ["---"] * len(header), *rows]
    return "".join(f"| {' | '.join(cells)} |\n" for cells in lines)


def _write(path: Path, text: str) -> None:
    with replacing(path) as partial:
        partial.write_text(text, encoding="utf-8")
