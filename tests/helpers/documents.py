"""What documents say, read from them."""

from pathlib import Path

FINDINGS = (Path(__file__).parents[2] / "diagrams" / "README.md").read_text(encoding="utf-8")


def rows_of_table(header: str) -> list[list[str]]:
    """Cells of the table whose header starts so, without the header."""
    lines = FINDINGS[FINDINGS.index(f"\n| {header}") :].split("\n\n")[0].strip().splitlines()
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines[2:]]
