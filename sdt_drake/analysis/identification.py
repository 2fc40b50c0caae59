"""An identified robot in tables, figures and a report."""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from sdt_drake.analysis import document as doc
from sdt_drake.analysis.metrics import PARAMETERS_IN_WORDS
from sdt_drake.analysis.panels import Line, Panel, over_time, picture
from sdt_drake.analysis.report import REPORT
from sdt_drake.analysis.style import PALETTE, Look, joint_title, save_both
from sdt_drake.arrays import Array
from sdt_drake.dynamics import decouple, torque_groups
from sdt_drake.errors import replacing
from sdt_drake.identification.base_parameters import rigid_parameters
from sdt_drake.identification.model import PlantFriction
from sdt_drake.identification.procedure import Identified
from sdt_drake.robot import Robot
from sdt_drake.shown import told

MEASURED, PREDICTED, NOMINAL = Look(PALETTE[0]), Look(PALETTE[1], "--"), Look(PALETTE[7], ":")
_MOST_SAMPLES = 300  # of which the load torque is computed

_READING = """All numbers are joint side. What is left is the RMS of measured less predicted torque
over the RMS of the measured one, below the cut-off frequency, where the joint moves. "Held out" is
what no parameter has seen. "Least squares" has the base parameters as they were measured;
"consistent" those of links that can be, which `robot.sdf` has, with the identified laws of
friction. A is that of the paper: a model of the load torque tau_LD that is wrong by A sin(...)
leaves A / √2 of its RMS; so A here is √2 times the RMS of what is left over that of tau_LD with the
friction, held out. Standard deviations are those of noise that is coloured as what is left; they
know nothing of a model that is wrong in kind. Links are the nearest to the file that have the
measured base parameters: only combinations are measured, how they are shared among links is that of
the file."""


def title(found: Identified) -> str:
    """The title of a report: what was identified."""
    return f"{found.nominal.name} identified"


def unmeasured_share(found: Identified, robot: Robot) -> Array:
    """A of the paper: the error of the load torque, as an amplitude, that is left, shape (n,)."""
    eq = found.equations
    rows = np.flatnonzero(~eq.fit)
    few = rows[np.linspace(0, len(rows) - 1, min(len(rows), _MOST_SAMPLES)).astype(int)]
    groups = torque_groups(robot, eq.q[few], eq.v[few], eq.vd[few])
    load = decouple(groups.inertial, groups.coupled, robot.gear_ratio).load_torque
    left = (eq.tau - found.predicted)[rows]
    friction = found.estimate.friction_torque(eq, found.friction)[few]
    size = np.sqrt(np.mean((load * robot.gear_ratio + friction) ** 2, axis=0))
    return np.asarray(np.sqrt(2 * np.mean(left**2, axis=0)) / np.maximum(size, 1e-9))


# --- tables ----------------------------------------------------------------------------------


def errors_table(found: Identified, robot: Robot) -> doc.Table:
    """What is left of the torques of each joint."""

    def row(name: str, values: Array) -> tuple[str, list[str]]:
        return name, [f"{100 * x:.2f}".replace("nan", "–") for x in values]

    least = found.estimate.torque(found.equations)
    return doc.Table(
        ("prediction", "left of the torque [%]"),
        [
            row("file as it is, held out", found.left(found.equations.nominal, held_out=True)),
            row("least squares, fitted", found.left(least, held_out=False)),
            row("least squares, held out", found.left(least, held_out=True)),
            row("consistent, fitted", found.left(found.predicted, held_out=False)),
            row("consistent, held out", found.left(found.predicted, held_out=True)),
            row("A of the load torque, held out", unmeasured_share(found, robot)),
        ],
    )


def friction_table(found: Identified, files: PlantFriction) -> doc.Table:
    """Laws, and what a scenario has of them."""
    friction, names = files.friction, found.nominal.joint_names
    coulomb, viscous, offset = friction.coulomb or [], friction.viscous or [], friction.offset or []
    rows = []
    for k, name in enumerate(names):
        rows.append(
            (
                f"{k + 1} {name}",
                found.estimate.laws[k].name,
                f"{coulomb[k]:.4g} ± {files.std[0, k]:.2g}",
                f"{viscous[k]:.4g} ± {files.std[1, k]:.2g}",
                f"{friction.breakaway[k]:.4g}" if friction.breakaway else "–",
                f"{offset[k]:.3g}",
                f"{100 * files.left[k]:.1f}",
            )
        )
    return doc.Table(
        ("joint", "law", "Coulomb [N m]", "viscous [N m s/rad]", "breakaway [N m]",
         "offset [N m]", "left of the law [%]"),
        rows,
    )  # fmt: skip


PARAMETERS = ("kind", "name", "unit", "value", "std", "nominal", "identifiable", "words")
_UNITS = {"m": "kg", "h": "kg m", "I": "kg m²"}


def parameter_rows(found: Identified, robot: Robot) -> list[tuple[str, ...]]:
    """Everything that was found, a row each; see PARAMETERS."""
    base, estimate = found.unknown.base, found.estimate
    std = np.sqrt(np.diagonal(estimate.covariance))
    nominal = base.combination @ _parameters(found, found.nominal)
    rows = []
    for i, own in enumerate(base.independent):
        name = base.names[own]
        told = (float(estimate.beta[i]), float(std[i]), float(nominal[i]))
        rows.append(("base", name, _unit(name), *map(repr, told), "alone", base.words[i]))
    identified = _parameters(found, robot)
    for i, name in enumerate(base.names):
        was = float(_parameters(found, found.nominal)[i])
        said = base.identifiable[i]
        row = ("link", name, _unit(name), repr(float(identified[i])), "", repr(was), said)
        rows.append((*row, _IN_WORDS[said]))
    for k, joint in enumerate(found.nominal.joint_names):
        part = estimate.friction_of(k)
        values = zip(
            estimate.laws[k].terms,
            found.friction[part],
            std[len(estimate.beta) :][part],
            strict=True,
        )
        for term, value, spread in values:
            unit = "N m s/rad" if term.kind.startswith("viscous") else "N m"
            shape = f"width {term.width:.4g}, zero at {term.middle:.4g} rad/s" if term.width else ""
            name = f"{term.kind} of {joint}"
            rows.append(("friction", name, unit, repr(float(value)), repr(float(spread)), "",
                         "alone", shape))  # fmt: skip
    return rows


_IN_WORDS = {
    "alone": "torques tell it",
    "in combination": "torques tell sums with others only: this is the nearest to the file",
    "not at all": "no torque depends on it: as in the file, or where the others need it",
}


def _unit(name: str) -> str:
    return _UNITS.get(name[0], "kg m²") if not name.startswith("motor") else "kg m²"


def _parameters(found: Identified, robot: Robot) -> Array:

    return rigid_parameters(robot)[found.unknown.columns]


def links_table(found: Identified) -> doc.Table:
    """Mass and centre of mass of each link that was free, before and after."""
    rows = []
    for link, pseudo in zip(found.consistent.links, found.consistent.pseudo, strict=True):
        before, after = link.inertial(link.pseudo), link.inertial(pseudo)
        rows.append(
            (
                link.name,
                *(f"{mass:.4g}" for mass, *_ in (before, after)),
                *(" ".join(told(1e3 * x, ".1f") for x in com) for _, com, _ in (before, after)),
            )
        )
    header = (
        "link",
        "mass in the file [kg]",
        "mass [kg]",
        "centre in the file [mm]",
        "centre [mm]",
    )
    return doc.Table(header, rows)


def in_short(found: Identified) -> list[str]:
    """The result in sentences, for the console and the page."""
    eq = found.equations
    names = ", ".join(recorded.path.name for recorded in found.recordings)
    r = len(found.estimate.beta)
    said = [
        f"{names}: torques compared below {found.cutoff:.3g} Hz, {int(eq.fit.sum())} samples "
        f"fitted and {int((~eq.fit).sum())} held out",
    ]
    if r:
        said.append(
            f"{r} base parameters of links and motors, condition number "
            f"{found.estimate.condition:.3g}"
        )
        said.append(PARAMETERS_IN_WORDS)
    return said + list(found.notes)


# --- figures ---------------------------------------------------------------------------------


def torques_figure(found: Identified) -> Figure:
    """Measured torque, what the identified and the nominal robot predict, and what is left."""
    eq, time = found.equations, _running_time(found)
    lines = [
        ("measured", MEASURED, eq.tau),
        ("identified", PREDICTED, found.predicted),
        ("file as it is", NOMINAL, eq.nominal),
    ]
    left = [("measured - identified", MEASURED, eq.tau - found.predicted)]
    columns = [
        over_time("torque [N m]", time, lines, found.nominal.joint_names),
        over_time("left [N m]", time, left),
    ]
    shaded = [
        [replace(panel, marked=~eq.fit, marked_label="held out") for panel in column]
        for column in columns
    ]
    return picture(f"{title(found)}: torques, joint side", shaded)


def residuals_figure(found: Identified) -> Figure:
    """What is left over the speed of each joint, and the friction that was found."""
    eq, estimate = found.equations, found.estimate
    laws, errors = [], []
    for k, name in enumerate(found.nominal.joint_names):
        order = np.argsort(eq.v[:, k])
        v = eq.v[order, k]
        left = (eq.tau - found.predicted)[order, k]
        errors.append(
            Panel(joint_title(k, name), "speed [rad/s]", "left [N m]", v,
                  [Line("measured - identified", MEASURED, left, dots=True)])
        )  # fmt: skip
        grid = np.linspace(v[0], v[-1], 400)
        terms = estimate.laws[k].terms
        torque = (
            np.column_stack([term.at(grid, 1e-3) for term in terms])
            @ (found.friction[estimate.friction_of(k)])
        )
        law = [Line("friction", PREDICTED, torque)]
        laws.append(Panel("", "speed [rad/s]", "friction [N m]", grid, law))
    return picture(f"{title(found)}: what is left, and friction, over speed", [errors, laws])


def _running_time(found: Identified) -> Array:
    """Of all recordings one after the other [s], shape (M,)."""
    eq, begin = found.equations, 0.0
    time = np.array(eq.time)
    for source, recorded in enumerate(found.recordings):
        time[eq.source == source] += begin
        begin += recorded.time[-1]
    return time


# --- files -----------------------------------------------------------------------------------


def make_report(
    found: Identified, robot: Robot, files: PlantFriction, folder: Path
) -> doc.Document:
    """The report of an identification; its figures have to be in the folder."""

    def figure(name: str, caption: str) -> doc.Figure:
        return doc.Figure(caption, folder / f"{name}.svg", folder, "wide")

    rows = parameter_rows(found, robot)
    base = [[row[-1], *map(_short, row[3:6]), row[2]] for row in rows if row[0] == "base"]
    link = [
        [row[1], *map(_short, (row[3], row[5])), row[2], row[6]] for row in rows if row[0] == "link"
    ]
    parameters: list[doc.Block] = [
        doc.Details(
            "Base parameters: what was measured",
            [doc.Table(("sum", "value", "std", "in the file", "unit"), base)],
        ),
        doc.Details(
            "Parameters of the links and motors, about the joints' frames",
            [doc.Table(("parameter", "value", "in the file", "unit", "identifiable"), link)],
        ),
    ]
    warnings = doc.Bullets(found.warnings) if found.warnings else doc.Text("None.")
    return doc.Document(
        f"{found.nominal.name}, identified",
        f"From {', '.join(recorded.path.name for recorded in found.recordings)}.",
        [
            doc.Section("In short", [doc.Bullets(in_short(found)), errors_table(found, robot)]),
            doc.Section("Warnings", [warnings]),
            doc.Section("Torques", [figure("torques", "Measured and predicted, joint side.")]),
            doc.Section(
                "Friction",
                [friction_table(found, files),
                 figure("residuals", "What is left, and friction, over speed.")],
            ),
            doc.Section("Links", [links_table(found), *parameters]),
            doc.Section("How to read it", [doc.Text(_READING.replace("\n", " "))]),
        ],
    )  # fmt: skip


def _short(number: str) -> str:
    return f"{float(number):.5g}" if number else "–"


def write_parameters(found: Identified, robot: Robot, path: Path) -> None:
    """The table of all parameters, as CSV."""
    with replacing(path) as partial, partial.open("w", encoding="utf-8", newline="") as file:
        csv.writer(file).writerows([PARAMETERS, *parameter_rows(found, robot)])


def write_report(found: Identified, robot: Robot, files: PlantFriction, folder: Path) -> Path:
    """Write figures and report into a folder, each replaced whole; the path of the page."""
    save_both(torques_figure(found), folder / "torques")
    save_both(residuals_figure(found), folder / "residuals")
    report = make_report(found, robot, files, folder)
    doc.write_text(folder / "report.md", report.markdown())
    return doc.write_text(folder / REPORT, report.html())
