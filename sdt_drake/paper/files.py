"""The files of `reproduce`: CSV, figures, block diagrams, summary.json and the report."""

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from sdt_drake.analysis.comparison import Compared
from sdt_drake.io.files import replacing_files, write_text
from sdt_drake.io.formats import in_json
from sdt_drake.io.tables import write_table
from sdt_drake.io.versions import versions
from sdt_drake.paper.claims import Claim, judge_claims
from sdt_drake.paper.diagrams import DIAGRAMS, write_block_diagram
from sdt_drake.paper.published import FIGURE4
from sdt_drake.paper.report import FILES as REPORT_FILES
from sdt_drake.paper.report import PLOTS, RECORDING, SUMMARY, write_report
from sdt_drake.paper.reproduction import Reproduction, Stopwatch, table1_rows
from sdt_drake.pilot.thresholds import CHANNELS, FeltDifference, felt_difference
from sdt_drake.robot.dynamics import effective_inertia
from sdt_drake.show.figures import runs as plots
from sdt_drake.show.panels import Plots
from sdt_drake.show.style import Picture, pictures, save_both
from sdt_drake.show.view3d.viewer import record_html

FILES = (
    "reference.csv",
    *(f"{plant}_{name}.csv" for plant in ("axis", "coupled") for name in ("pi", "pi_ctc")),
    *pictures("figure2", "figure4", "figure7", "figure8", "coupled_errors", "controllers"),
    *(f"diagrams/{name}.{suffix}" for name in DIAGRAMS for suffix in ("dot", "svg")),
    SUMMARY,
    PLOTS,
    RECORDING,
    *REPORT_FILES,
)
"""Names of all files of a reproduction."""


def write_reproduction(results: Reproduction, folder: Path, watch: Stopwatch) -> dict[str, Any]:
    """Write all files of `reproduce` into a folder, all or none, and return its summary."""
    claims = judge_claims(results)
    with replacing_files(folder) as new:
        return _write(results, claims, new, watch)


def _write(
    results: Reproduction, claims: Sequence[Claim], folder: Path, watch: Stopwatch
) -> dict[str, Any]:
    with watch.stage("CSV files"):
        write_reference_motion(results, folder / "reference.csv")
        for name in ("pi", "pi_ctc"):
            results.axis(name).recording.save(folder / f"axis_{name}.csv")
            results.coupled(name).recording.save(folder / f"coupled_{name}.csv")
    with watch.stage("figures"):
        plots_of_page = {}
        for name, figure in figures(results).items():
            save_both(figure, folder / name)
            plots_of_page[name] = Plots(figure.columns).data()
        write_text(folder / PLOTS, json.dumps(plots_of_page))
    with watch.stage("block diagrams"):
        for name in DIAGRAMS:
            write_block_diagram(name, results.design, folder / "diagrams")
    with watch.stage("beyond the paper"):  # its runs ran in parallel
        title = "Controllers on the coupled MultibodyPlant, model known exactly (beyond the paper)"
        save_both(plots.comparison(title, results.beyond), folder / "controllers")
    content = summary(results, claims)
    write_text(folder / SUMMARY, json.dumps(content, indent=1) + "\n")
    with watch.stage("3D recording and report"):
        robot, motion = results.design.device.simulated, results.design.reference.tracked
        record_html(robot, motion.time, motion.q, folder / RECORDING, title="Reference motion")
        write_report(folder)
    return content


def write_reference_motion(results: Reproduction, path: Path) -> None:
    """Write the reference motion with torque groups (joint side) and loads (motor side)."""
    design, motion, groups = (
        results.design,
        results.design.reference.tracked,
        results.design.torques,
    )
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
        "i_eff": effective_inertia(design.device.simulated, groups.d_kk),
    }
    write_table(path, motion.time, columns)


def figures(results: Reproduction) -> dict[str, Picture]:
    """Draw the figures of the paper's runs, by file name."""
    motion, names = results.design.reference.tracked, results.design.device.simulated.joint_names
    axis, coupled = (
        {name: of(name).recording for name in ("pi", "pi_ctc")}
        for of in (results.axis, results.coupled)
    )
    coupled["pi_ctc, printed sign"] = results.coupled("pi_ctc", "printed").recording
    reference = "Reference trajectories of the joints (Figure 2)"
    steps = "Step responses, axis 1 at its largest inertia (Figure 4)"
    tracking = "Trajectory tracking, decoupled axes, Algorithm 1 as printed (Figure 7)"
    errors = "Speed errors, decoupled axes, Algorithm 1 as printed (Figure 8)"
    beyond = "Speed errors on the coupled MultibodyPlant (beyond the paper)"
    return {
        "figure2": plots.trajectories(reference, motion, names),
        "figure4": plots.step_responses(steps, results.steps),
        "figure7": plots.speeds(tracking, axis, names),
        "figure8": plots.speed_errors(errors, axis, names, motion),
        "coupled_errors": plots.speed_errors(beyond, coupled, names, motion),
    }


# --- summary.json ----------------------------------------------------------------------------


def summary(results: Reproduction, claims: Sequence[Claim]) -> dict[str, Any]:
    """Return the content of summary.json; NaN and infinity are null."""
    steps = {
        structure: {name: getattr(step.metrics, name) for name in FIGURE4[structure]}
        for structure, step in results.steps.items()
    }
    pi, pi_ctc = (results.coupled(name).head.achieved for name in ("pi", "pi_ctc"))
    apart = felt_difference(pi_ctc, pi, results.design.reference.tracked.period)
    content = {
        "table1": table1_rows(results.design),
        "step_response": {**steps, "published": FIGURE4},
        "tracking": [case._asdict() | asdict(run.tracking) for case, run in results.runs.items()],
        "claims": [asdict(claim) for claim in claims],
        "beyond": [_beyond_entry(compared) for compared in results.beyond],
        "pi_or_pi_ctc": _felt_entry(apart),
        "reported": [asdict(row) for row in results.reported.result()],
        "versions": versions(),
        "wall_time_s": dict(results.wall_time_s),
    }
    return {name: in_json(part) for name, part in content.items()}


def _beyond_entry(compared: Compared) -> dict[str, object]:
    from_angles = compared.head.felt_from_angles.share
    return {
        "controller": compared.label,
        **asdict(compared.tracking),
        **asdict(compared.motors),
        "felt": {**_felt_entry(compared.head.felt), "share_from_angles": from_angles},
        "needs": list(compared.needs),
    }


def _felt_entry(felt: FeltDifference) -> dict[str, object]:
    return {
        "share": felt.share,
        "channels": list(CHANNELS),
        "largest": felt.largest,
        "channel_share": felt.channel_share,
    }
