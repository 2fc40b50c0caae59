"""The command `scenarios`."""

from __future__ import annotations

import re
import shutil
import textwrap
from typing import Annotated

from sdt_drake.cli.common import one_of
from sdt_drake.cli.printing import say
from sdt_drake.io.files import read_text
from sdt_drake.io.resources import SHIPPED, find_file, models_dir, shipped

_MOST_BYTES = 1_000_000


def run(name: Annotated[str | None, one_of(*SHIPPED)] = None, /) -> None:
    """List what ships with the package, scenarios first, or print one to start your own from.

    example: sdt-drake scenarios coupled_pi_ctc

    Args:
        name: the scenario, motion, study, robot, motors or drives to print; they all have
            different names
    """
    if name is not None:
        text = read_text(find_file(name, *SHIPPED), _MOST_BYTES).removesuffix("\n")
        # The line for editors, as it is true elsewhere.
        say(re.sub(r"(?<=schema=)(?:\.\./)?schemas", f"{models_dir() / 'schemas'}", text, count=1))
        return
    width = shutil.get_terminal_size().columns - 20
    for kind in SHIPPED:
        say(f"{kind}:")
        for name in shipped(kind):
            say(f"  {name:16}  {textwrap.shorten(_about(name, kind), width, placeholder=' ...')}")
        say()
    say("names stand for files: sdt-drake simulate coupled_pi; in YAML, motion: leans")
    say("sdt-drake motions: what is felt; sdt-drake scenarios NAME > own.yaml: a copy")


def _about(name: str, kind: str) -> str:
    """What a file says of itself first: a comment up to where that could end, or its columns."""
    text = find_file(name, kind).read_text(encoding="utf-8")
    comment = re.search(r"<!--(.*?)-->|((?:^# (?!yaml-).*\n)+)", text, re.DOTALL | re.MULTILINE)
    told = comment[1] or comment[2] if comment else f"Columns {text.partition(chr(10))[0]}"
    words = re.sub(r"^#", "", told, flags=re.MULTILINE)
    return re.split(r"[.:;(]\s|\s\(|(?<=\?)\s", " ".join(words.split()), maxsplit=1)[0]
