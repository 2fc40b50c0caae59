"""Short motions, base scenarios, and studies on them; what came out."""

from __future__ import annotations

from pathlib import Path

import pyarrow.parquet

# 0.5 s of the four joints: joint 2 up to a speed and on, the others at rest.
REST = "  - !Knots {{knots: [[0, 0], [0.5, 0]]}}\n"
MOTION = (
    "duration: 0.5\njoints:\n"
    + REST
    + "  - !Knots {{knots: [[0, 0], [0.25, {speed}], [0.5, {speed}]]}}\n"
    + REST
    + REST
)
BASE = """\
motion: short.yaml
plant: {{kind: {kind}}}
controller: {{kind: pi, omega_r: 65.991, zeta: [0.95, 0.98, 0.99, 0.95]}}
"""
STUDY = """\
scenario: {base}.yaml
draws: {draws}
variables:
- fields: [disturbance.amplitude]
  distribution: !Uniform {{low: 0, high: 0.3}}
- fields: [controller]
  distribution: !Choice {{values: [pi, p_pi+id]}}
"""


RUNS = 16  # of many.yaml


def write_files(folder: Path) -> None:
    (folder / "short.yaml").write_text(MOTION.format(speed=0.5))
    (folder / "fast.yaml").write_text(MOTION.format(speed=50))  # no motor can do that
    for kind in ("axis", "coupled"):
        (folder / f"{kind}.yaml").write_text(BASE.format(kind=kind))
    (folder / "few.yaml").write_text(STUDY.format(base="axis", draws=3))
    (folder / "many.yaml").write_text(STUDY.format(base="coupled", draws=8))


def rows(folder: Path) -> pyarrow.Table:
    """All that does not depend on when and where it was run."""
    return pyarrow.parquet.read_table(folder / "results.parquet").drop_columns(["duration"])
