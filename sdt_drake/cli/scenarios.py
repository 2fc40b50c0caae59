"""The command `scenarios`."""

import re
import textwrap
from typing import Annotated

from sdt_drake.cli.common import one_of
from sdt_drake.cli.printing import echo, line_width
from sdt_drake.io.files import read_text
from sdt_drake.io.resources import SHIPPED, find_file, models_dir, shipped

_MAX_FILE = 1_000_000  # bytes


def run(name: Annotated[str | None, one_of(*SHIPPED)] = None, /) -> None:
    """List all shipped files, scenarios first, or print one of them to start your own from.

    example: sdt-drake scenarios coupled_pi_ctc

    Args:
        name: scenario, motion, study, robot, motors, drives or stops to print (default: list all)
    """
    if name is not None:
        text = read_text(find_file(name, *SHIPPED), _MAX_FILE).removesuffix("\n")
        # Editors need the whole path of the schema if the text is saved elsewhere.
        echo(re.sub(r"(?<=schema=)(?:\.\./)?schemas", f"{models_dir() / 'schemas'}", text, count=1))
        return
    count = sum(len(shipped(kind)) for kind in SHIPPED)
    echo(f"{count} files are shipped. Use their names in place of files:")
    echo("sdt-drake simulate coupled_pi; in YAML, motion: leans")
    echo("For a copy: sdt-drake scenarios NAME > own.yaml")
    echo()
    width = max(line_width() - 20, 20)
    for kind in SHIPPED:
        echo(f"{kind}:")
        for name in shipped(kind):
            echo(f"  {name:16}  {textwrap.shorten(_about(name, kind), width, placeholder=' ...')}")
        echo()


def _about(name: str, kind: str) -> str:
    """Return the beginning of a file's first comment, or its columns."""
    text = find_file(name, kind).read_text(encoding="utf-8")
    comment = re.search(r"<!--(.*?)-->|((?:^# (?!yaml-).*\n)+)", text, re.DOTALL | re.MULTILINE)
    text = comment[1] or comment[2] if comment else f"Columns {text.partition(chr(10))[0]}"
    words = re.sub(r"^#", "", text, flags=re.MULTILINE)
    return re.split(r"[.:;(]\s|\s\(|(?<=\?)\s", " ".join(words.split()), maxsplit=1)[0]
