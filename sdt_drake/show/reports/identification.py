"""Tables, files and report of an identified robot."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from sdt_drake.analysis.metrics import PARAMETERS_IN_WORDS
from sdt_drake.io.arrays import Array, Index, Mask
from sdt_drake.io.files import replacing_files, write_csv
from sdt_drake.io.shown import formatted, numbered, rounded
from sdt_drake.machine.identify import files as identified_files
from sdt_drake.machine.identify.base_parameters import rigid_parameters
from sdt_drake.machine.identify.consistency import Link
from sdt_drake.machine.identify.judge import Judged
from sdt_drake.machine.identify.plant import PlantFriction, scenario_torque
from sdt_drake.machine.identify.procedure import Identified
from sdt_drake.robot.device import friction_parameters
from sdt_drake.robot.dynamics import decouple, torque_groups
from sdt_drake.robot.robot import Robot
from sdt_drake.run.scenario import Scenario
from sdt_drake.show import sections as doc
from sdt_drake.show.documents import MARKDOWN, REPORT, written
from sdt_drake.show.figures.identification import residuals_figure, torques_figure
from sdt_drake.show.style import pictures

_UNDECIDED = 0.5  # share of a variance that is due to the choice of the friction law
_ROUND_OFF = 1e-12  # kg, kg m or kg m²
_MAX_SAMPLES = 300  # samples for which the load torque is computed


def unmeasured_share(found: Identified, robot: Robot) -> Array:
    """Return the amplitude A of the fed-forward load's relative error, shape (n,) (paper)."""
    eq = found.equations
    rows = np.flatnonzero(~eq.fit)
    few = rows[np.linspace(0, len(rows) - 1, min(len(rows), _MAX_SAMPLES)).astype(int)]
    groups = torque_groups(robot, eq.q[few], eq.v[few], eq.vd[few])
    load = decouple(groups.inertial, groups.coupled, robot.gear_ratio).load_torque
    left = (eq.tau - found.written)[rows]
    # The load has the damping.
    friction = scenario_torque(eq, friction_parameters(found.plant_friction.friction, eq.n))[few]
    whole = robot.gear_torque(load * robot.gear_ratio) + friction
    size = np.sqrt(np.mean(whole**2, axis=0))
    return np.asarray(np.sqrt(2 * np.mean(left**2, axis=0)) / np.maximum(size, 1e-9))


# --- tables ----------------------------------------------------------------------------------


def errors_table(found: Identified, robot: Robot) -> doc.Table:
    """Make the table of the torque not explained, by joint."""
    nominal, least = found.equations.nominal, found.estimate.torque(found.equations)
    left = {
        "file as it is, held out": found.left(nominal, held_out=True),
        "least squares, fitted": found.left(least, held_out=False),
        "least squares, held out": found.left(least, held_out=True),
        "consistent, fitted": found.left(found.predicted, held_out=False),
        "consistent, held out": found.left(found.predicted, held_out=True),
        "as written, held out": found.left(found.written, held_out=True),
        "error of the fed-forward load [% of its amplitude]": unmeasured_share(found, robot),
    }
    return _left_table(left, robot)


def _left_table(left: dict[str, Array], robot: Robot) -> doc.Table:
    rows = [(name, *(formatted(100 * x, ".2f") for x in values)) for name, values in left.items()]
    return doc.Table(("torque not explained [%]", *numbered(robot.joint_names)), rows)


def friction_table(found: Identified, files: PlantFriction) -> doc.Table:
    """Make the table of the friction laws and of their parameters in a scenario."""
    friction, names = files.friction, found.nominal.joint_names
    coulomb, viscous, offset = friction.coulomb or [], friction.viscous or [], friction.offset or []
    rows = []
    for k, name in enumerate(names):
        if not found.equations.moves[:, k].any():  # unknown, not 0
            rows.append((f"{k + 1} {name}", *"––––––"))
            continue
        std = files.std[:, k].tolist()
        rows.append(
            (
                f"{k + 1} {name}",
                found.estimate.laws[k].name,
                f"{rounded(coulomb[k], std[0])} ± {rounded(std[0], std[0])}",
                f"{rounded(viscous[k], std[1])} ± {rounded(std[1], std[1])}",
                rounded(friction.breakaway[k], std[0]) if friction.breakaway else "–",
                rounded(offset[k], std[0]),
                f"{100 * files.left[k]:.1f}",
            )
        )
    return doc.Table(
        ("joint", "law", "Coulomb [N m]", "viscous [N m s/rad]", "breakaway [N m]",
         "offset [N m]", "not in a scenario [%]"),
        rows,
    )  # fmt: skip


def friction_notes(found: Identified, files: PlantFriction) -> list[str]:
    """Return sentences on the accuracy of friction, and on joints whose law is undecided."""
    days = len(found.estimate.days)
    notes = [
        "friction comes from one recording; on another day, colder or warmer, it may differ by "
        "more than its ±. With two or more recordings, ± includes their spread"
        if days < 2
        else f"between the {days} recordings Coulomb friction differs by "
        f"{_range(100 * files.between[0])} %, viscous friction by {_range(100 * files.between[1])} "
        "% (standard deviation), which ± includes"
    ]
    moves: Mask = np.any(found.equations.moves, axis=0)
    given = found.nominal.damping
    less = np.flatnonzero(files.damping < given)
    if len(less):
        values = ", ".join(f"{x:.4g}" for x in given[less])
        notes.append(
            f"joint {_numbers(less)}: the damping of the file ({values} N m s/rad) is more than "
            "the viscous friction that was found; robot.sdf has less, and the scenario all the rest"
        )
    falling = np.flatnonzero(moves & (np.array(files.friction.viscous) + files.damping == 0))
    if len(falling):
        notes.append(
            f"joint {_numbers(falling)}: the friction of the fit decreases with speed, within "
            "noise. Viscous friction in the table and the scenario is 0, as it must never drive"
        )
    for k in np.flatnonzero(files.undecided > _UNDECIDED).tolist():
        names = dict.fromkeys(law.name for law, _ in found.estimate.rivals[k])
        notes.append(
            f"joint {k + 1}: the data do not decide its friction law; others explain as much "
            f"({', '.join(names)}). Its ± comes mostly from the difference of these laws"
        )
    return notes


def _numbers(joints: Index) -> str:
    return ", ".join(str(k + 1) for k in joints)


class Parameter(NamedTuple):
    """An identified parameter: a row of parameters.csv."""

    kind: str
    """One of "base" (a sum that torques determine), "link" (link or motor), "friction" (of the
    scenario) and "friction law" (a term of the fit)."""
    name: str
    unit: str
    value: float
    std: float | None
    """The standard deviation."""
    nominal: float | None
    """The value in the robot's file."""
    identifiable: str
    """One of "alone", "in combination" and "not at all"."""
    words: str
    """The meaning of the parameter or of `identifiable`."""


_UNITS = {"mass": "kg", "hx": "kg m", "hy": "kg m", "hz": "kg m"}  # others are inertias


def parameters(found: Identified, robot: Robot) -> list[Parameter]:
    """Return all identified parameters."""
    base, estimate = found.unknown.base, found.estimate
    nominal, identified = (
        rigid_parameters(one)[found.unknown.columns] for one in (found.nominal, robot)
    )
    units = [_UNITS.get(name.split()[0], "kg m²") for name in base.names]
    std = np.sqrt(np.diagonal(estimate.covariance)).tolist()
    beta, was = estimate.beta.tolist(), (base.combination @ nominal).tolist()
    rows = [
        Parameter("base", base.names[own], units[own], beta[i], std[i], was[i], "alone", words)
        for i, (own, words) in enumerate(zip(base.independent, base.words, strict=True))
    ]
    of_links = base.names, units, identified.tolist(), nominal.tolist(), base.identifiable
    rows += [
        Parameter("link", name, unit, value, None, before, determined, _IN_WORDS[determined])
        for name, unit, value, before, determined in zip(*of_links, strict=True)
    ]
    return [*rows, *_friction_parameters(found), *_law_parameters(found, std[len(beta) :])]


def _friction_parameters(found: Identified) -> Iterator[Parameter]:
    """Yield the friction of the scenario, with the intervals of `friction_table`."""
    files = found.plant_friction
    moves: Mask = np.any(found.equations.moves, axis=0)
    units = {"coulomb": "N m", "viscous": "N m s/rad", "breakaway": "N m", "offset": "N m"}
    spreads = dict(zip(units, files.std.tolist(), strict=False))
    for k, joint in enumerate(found.nominal.joint_names):
        known = "alone" if moves[k] else "not at all"
        for name, unit in units.items():
            if values := getattr(files.friction, name):
                std = spreads[name][k] if name in spreads and moves[k] else None
                yield Parameter("friction", f"{name} of {joint}", unit, values[k], std, None, known,
                                _FRICTION_IN_WORDS)  # fmt: skip


def _law_parameters(found: Identified, std: Sequence[float]) -> Iterator[Parameter]:
    """Yield the terms of the friction laws of the fit."""
    for k, joint in enumerate(found.nominal.joint_names):
        part = found.estimate.friction_of(k)
        values = found.friction[part].tolist(), std[part]
        for term, value, spread in zip(found.estimate.laws[k].terms, *values, strict=True):
            unit = "N m s/rad" if term.kind.startswith("viscous") else "N m"
            shape = f"width {term.width:.4g}, zero at {term.middle:.4g} rad/s" if term.width else ""
            name = f"{term.kind} of {joint}"
            yield Parameter("friction law", name, unit, value, spread, None, "alone", shape)


_FRICTION_IN_WORDS = "of the scenario, in addition to the damping of robot.sdf"
_IN_WORDS = {
    "alone": "torques determine it",
    "in combination": "torques determine only sums with others; this value is closest to the file",
    "not at all": "no torque depends on it; it is as in the file, or as the others require",
}


def links_table(found: Identified) -> doc.Table:
    """Make the table of mass and centre of mass of each free link, before and after."""
    rows = []
    for link, pseudo in zip(found.consistent.links, found.consistent.pseudo, strict=True):
        (mass, centre, _), (new_mass, new_centre, _) = map(link.inertial, (link.pseudo, pseudo))
        places = (" ".join(formatted(1e3 * x, ".1f") for x in xyz) for xyz in (centre, new_centre))
        known = _mass_known(found, link)
        rows.append((link.name, f"{mass:.4g}", f"{new_mass:.4g}", known, *places))
    header = (
        "link", "mass in the file [kg]", "mass [kg]", "the mass is", "centre in the file [mm]",
        "centre [mm]",
    )  # fmt: skip
    return doc.Table(header, rows)


def _mass_known(found: Identified, link: Link) -> str:
    """Return if the mass of a link is measured, in words."""
    at = np.flatnonzero(found.unknown.columns == 10 * link.body)[0]
    shared = sum(other.body == link.body for other in found.consistent.links) > 1
    identifiable = found.unknown.base.identifiable[at]
    if identifiable == "alone" and not shared:
        return "measured"
    if identifiable == "not at all":
        return "not measurable, as in the file"
    return "measured in sums only"


def result(found: Identified) -> list[str]:
    """Return the answer and the next step as sentences, for the console and the page."""
    nominal, now = (
        100 * found.left(tau, held_out=True) for tau in (found.equations.nominal, found.written)
    )
    answer = (
        f"{found.nominal.name}: {_range(now)} % of the joints' torques are not explained now (RMS, "
        f"held-out data); with the file as it is, {_range(nominal)} %"
    )
    if found.warnings:
        count = len(found.warnings)
        warnings = "the warning" if count == 1 else f"the {count} warnings"
        return [answer, f"next: read {warnings} below"]
    return [
        answer,
        "next: simulate the written scenario.yaml, and judge the written robot.sdf and "
        "friction.yaml by a recording of another motion",
    ]


def judged_in_words(judged: Judged) -> list[str]:
    """Return how well a robot explains recordings it was not fitted to, and the next step."""
    worst = np.nanargmax(judged.left)
    return [
        f"{judged.robot.name}: {_range(100 * judged.left)} % of the joints' torques are not "
        f"explained (RMS, below {judged.cutoff:.3g} Hz); without its friction, "
        f"{_range(100 * judged.left_without)} %",
        f"next: joint {worst + 1} is explained worst; run sdt-drake identify with all recordings, "
        "this one included, to see if one robot explains them all",
    ]


def judged_table(judged: Judged) -> doc.Table:
    """Make the table of the torque not explained by joint, with and without friction."""
    left = {"robot and friction": judged.left, "robot without friction": judged.left_without}
    return _left_table(left, judged.robot)


def _range(values: Array) -> str:
    """Return the range of percentages, without NaN."""
    least, most = (_percent(f(values)) for f in (np.nanmin, np.nanmax))
    return least if least == most else f"{least} to {most}"


def _percent(value: float) -> str:
    return formatted(value, ".0f" if value >= 10 else ".1f" if value >= 1 else ".2g")


def in_short(found: Identified) -> list[str]:
    """Return sentences on the compared data and parameters, for the console and the page."""
    eq = found.equations
    names = ", ".join(recorded.path.name for recorded in found.recordings)
    r = len(found.estimate.beta)
    notes = [
        f"{names}: torques compared below {found.cutoff:.3g} Hz, {int(eq.fit.sum())} samples "
        f"fitted and {int((~eq.fit).sum())} held out"
    ]
    if r:
        notes.append(
            f"{r} base parameters of links and motors, condition number "
            f"{found.estimate.condition:.3g}"
        )
        notes.append(PARAMETERS_IN_WORDS)
    return notes + list(found.notes)


# --- files -----------------------------------------------------------------------------------


_OWN_FILES = ("parameters.csv", *pictures("torques", "residuals"), MARKDOWN, REPORT)
FILES = (*identified_files.FILES, *_OWN_FILES)
"""Names of all files of an identification."""


def write_identified(
    found: Identified, robot: Robot, friction: PlantFriction, folder: Path, scenario: Scenario
) -> tuple[Path, list[str]]:
    """Write the files and the report of an identification into a folder, all or none.

    Args:
        found: the result of the identification.
        robot: the identified robot.
        friction: its friction.
        folder: the folder.
        scenario: the scenario of `identified_files.base_scenario`.

    Returns:
        The path of the page, and sentences on changes to the recorded motion.

    Raises:
        InputError: if a file cannot be written.
    """
    with replacing_files(folder) as new:
        notes = identified_files.write_files(found, robot, friction, scenario, new)
        write_csv(new / "parameters.csv", Parameter._fields, parameters(found, robot))
        write_identification_report(found, robot, friction, new, notes)
    return folder / REPORT, notes


def write_identification_report(
    found: Identified,
    robot: Robot,
    files: PlantFriction,
    folder: Path,
    notes: Sequence[str] = (),
) -> Path:
    """Write figures and report into a folder, and return the path of the page.

    Args:
        found: the result of the identification.
        robot: the identified robot.
        files: its friction.
        folder: the folder.
        notes: further sentences, on other files of the folder.
    """
    base, links = _details(parameters(found, robot))
    return written("identification", {
        "robot": found.nominal.name,
        "answer": doc.bullets(doc.said("{}.", text) for text in result(found)),
        "errors": errors_table(found, robot),
        "warnings": doc.bullets(map(str, found.warnings)) if found.warnings else "None.",
        "data": doc.bullets([*in_short(found), *notes]),
        "torques.png": torques_figure(found),
        "friction": friction_table(found, files),
        "on_friction": doc.bullets(friction_notes(found, files)),
        "residuals.png": residuals_figure(found, files),
        "links": links_table(found),
        "base": doc.details("Base parameters: the measured sums", base),
        "all": doc.details("Parameters of the links and motors, about the joints' frames", links),
    }).write(folder)  # fmt: skip


def _details(found: Sequence[Parameter]) -> tuple[doc.Table, doc.Table]:
    """Make the tables of base parameters, and of links and motors."""

    def numbers(*values: float | None) -> list[str]:
        return ["–" if x is None else f"{x:.5g}" if abs(x) > _ROUND_OFF else "0" for x in values]

    base = [
        [p.words, rounded(p.value, p.std or 0), rounded(p.std or 0, p.std or 0),
         *numbers(p.nominal), p.unit]
        for p in found if p.kind == "base"
    ]  # fmt: skip
    link = [
        [p.name, *numbers(p.value, p.nominal), p.unit, p.identifiable]
        for p in found
        if p.kind == "link"
    ]
    return (
        doc.Table(("sum", "value", "std", "in the file", "unit"), base),
        doc.Table(("parameter", "value", "in the file", "unit", "identifiable"), link),
    )
