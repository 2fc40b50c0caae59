"""Short motions, base scenarios, and studies on them; what came out."""

from pathlib import Path

import pyarrow.parquet

from helpers.command_line import SCENARIO, SHORT

STUDY = """\
scenario: {base}.yaml
draws: {draws}
variables:
- fields: [disturbance.amplitude]
  distribution: !Uniform {{low: 0, high: 0.3}}
- fields: [controller]
  distribution: !Choice {{values: [pi, p_pi+id]}}
"""


def write_files(folder: Path) -> None:
    axis = SCENARIO.replace("motion.yaml", "short.yaml")
    texts = {
        "short": SHORT,
        "fast": SHORT.replace(", 0.5]", ", 50]"),  # no motor can do that
        "axis": axis,
        "coupled": axis.replace("kind: axis", "kind: coupled"),
        "few": STUDY.format(base="axis", draws=3),
        "many": STUDY.format(base="coupled", draws=8),
    }
    for name, text in texts.items():
        (folder / f"{name}.yaml").write_text(text)


def rows(folder: Path) -> pyarrow.Table:
    """All that does not depend on when and where it was run."""
    return pyarrow.parquet.read_table(folder / "results.parquet").drop_columns(["duration"])
