"""The page of several controllers on one motion."""

from collections.abc import Sequence
from pathlib import Path

from sdt_drake.analysis.comparison import Compared, comparison_rows, felt_rows
from sdt_drake.analysis.tracking import stops_passed
from sdt_drake.io.files import checked_output, checked_suffix, write_text
from sdt_drake.io.yaml_files import yaml_text
from sdt_drake.run.options import in_print
from sdt_drake.show.documents import written
from sdt_drake.show.figures.compared import compared_panels
from sdt_drake.show.panels import Plots
from sdt_drake.show.sections import Table, bullets, details, fenced


def verdict(compared: Sequence[Compared]) -> str:
    """Return the number of controllers, and those with the smallest and largest speed error."""
    errors = {c.label: float(c.tracking.max_abs_speed_error.max()) for c in compared}
    best, worst = min(errors, key=errors.__getitem__), max(errors, key=errors.__getitem__)
    count = f"{len(compared)} controller{'s' if len(compared) > 1 else ''}"
    plant = compared[0].design.scenario.plant.kind
    text = f"{count} on the {plant} plant; {best} follows best, with speed errors up to "
    others = f" ({worst}: {errors[worst]:.4g} rad/s)" if best != worst else ""
    return f"{text}{errors[best]:.4g} rad/s{others}"


def notes(compared: Sequence[Compared]) -> list[str]:
    """Return a sentence for each stop that a controller passes."""
    return [
        f"{c.label}: {line}"
        for c in compared
        for line in stops_passed(c.recording, c.design.device.simulated.joint_names)
    ]


def write_comparison_page(compared: Sequence[Compared], path: Path) -> None:
    """Write the page of a comparison: errors and torques over time, tables and scenario.

    Raises:
        InputError: if the file cannot be written or is no .html.
    """
    checked_suffix(checked_output(path), (".html",))
    scenario = compared[0].design.scenario
    felt = felt_rows(compared)
    report = written("compare", {
        "title": scenario.name, "verdict": verdict(compared),
        "notes": bullets(notes(compared)),
        **{f"{name}.png": Plots([own]) for name, own in compared_panels(compared).items()},
        "errors": Table(*comparison_rows(compared)),
        "felt": [
            "Share of time in which the pilot could feel the error, and the largest errors as "
            "multiples of the threshold of feeling, about and along the axes of the head:",
            Table(*felt),
        ] if felt[1] else [],
        "needs": Table(["controller", "needs to know"],
                       [[in_print(c.label), ", ".join(c.needs)] for c in compared]),
        "scenario": details(
            "The scenario with the first controller, every field of it, as YAML",
            fenced(yaml_text(scenario).rstrip()),
        ),
    })  # fmt: skip
    write_text(path, report.page(path.parent))
