"""The page of a frequency response: each joint's loop, and the coupled loop."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from sdt_drake.analysis.frequency_response import FrequencyResponse
from sdt_drake.io.files import write_text
from sdt_drake.io.shown import by_joint, formatted
from sdt_drake.run.design import Design
from sdt_drake.show.documents import written
from sdt_drake.show.figures.coupled_loop import coupled_loop
from sdt_drake.show.figures.runs import bode
from sdt_drake.show.sections import Table, bullets


def write_bode_page(
    design: Design, response: FrequencyResponse, path: Path, verdict: str, notes: Sequence[str]
) -> None:
    """Write a page of responses, Nyquist curves, poles, zeros and singular values.

    Args:
        design: the design of the loops.
        response: its frequency response.
        path: a file that ends in .html.
        verdict: the answer, whether the loops are stable.
        notes: sentences on how the loops were linearised.
    """
    names, title = design.device.simulated.joint_names, design.scenario.summary().title
    rows = [
        (kind, formatted(value.real, ".4g"), formatted(abs(value.imag), ".4g"), damping)
        for kind, values in (("pole", response.poles), ("zero", response.zeros))
        for value in values[values.imag >= 0]
        for damping in [formatted(-np.cos(np.angle(value)) if abs(value) > 1e-6 else np.nan, ".3f")]
    ]
    report = written("bode", {
        "title": title, "verdict": verdict, "notes": bullets(notes),
        "table": Table(*by_joint(names, response.columns())),
        "bode.png": bode(title, response, names),
        "coupled.png": coupled_loop(title, response, names),
        "largest": response.singular_values.max(),
        "at": response.omega[response.singular_values[:, 0].argmax()],
        "poles": Table(["", "real part [1/s]", "imaginary part [rad/s]", "damping ratio"], rows),
    })  # fmt: skip
    with tempfile.TemporaryDirectory() as folder:
        report.write_parts(Path(folder))
        page = report.page(Path(folder))
    write_text(path, page)
