"""The command `docs`."""

import webbrowser
from importlib.metadata import metadata
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

import sdt_drake
from sdt_drake.cli import COMMANDS, SUBCOMMANDS
from sdt_drake.cli.printing import echo
from sdt_drake.io.errors import InputError


def run(
    topic: str | None = None,
    /,
    *,
    folder: Annotated[Path | None, Parameter(env_var="SDT_DRAKE_DOCS")] = None,
    print_only: Annotated[bool, Parameter("--print")] = False,
) -> None:
    """Open the documentation at the page of a command, a file, a field or a Python name.

    example: sdt-drake docs controller.kp

    Args:
        topic: a command, a kind of file (`sdt-drake reference`), a field, or a name in `sdt_drake`
            (default: the first page)
        folder: folder of the offline documentation (default: the environment's SDT_DRAKE_DOCS, else
            the web)
        print_only: print the addresses without opening a browser
    """
    if folder is not None and not (folder / "index.html").exists():
        raise InputError(f"{folder}: no index.html, expected the folder of the documentation")
    addresses = [_address(page, folder) for page in pages(topic)]
    for address in addresses:
        echo(address)
    if not print_only and not webbrowser.open(addresses[0]):
        echo("No browser was found: open the address above.")


def pages(topic: str | None) -> list[str]:
    """Return the pages of a topic, "reference/commands#sdt-drake-simulate", the likeliest first.

    Raises:
        InputError: for a topic without a page, naming similar ones.
    """
    if topic is None:
        return [""]
    from sdt_drake.io.errors import suggestion
    from sdt_drake.show.reference import TOPICS, anchor

    places: dict[str, list[str]] = {}
    for name in COMMANDS:
        for words in (name, *(f"{name} {sub}" for sub in SUBCOMMANDS.get(name, ()))):
            places[words] = [f"reference/commands#sdt-drake-{words.replace(' ', '-')}"]
    for kind, make in TOPICS.items():
        page = f"reference/files/{kind}"
        places.setdefault(kind, []).append(page)
        for sheet in make().sheets:
            for row in sheet.rows:
                place = f"{page}#{anchor(sheet.title, row[0])}"
                for field in dict.fromkeys((row[0], row[0].split(".")[-1])):
                    places.setdefault(field, []).append(place)
            places.setdefault(sheet.title, [f"{page}#{anchor(sheet.title, sheet.rows[0][0])}"])
    for name in sdt_drake.__all__:
        places.setdefault(name, []).append(f"reference/python#sdt_drake.{name}")
    if topic not in places:
        otherwise = "expected a command, a kind of file, a field or a name in sdt_drake"
        raise InputError(f"TOPIC: '{topic}' has no page, {suggestion(topic, places, otherwise)}")
    return places[topic]


def _address(page: str, folder: Path | None) -> str:
    path, _, place = page.partition("#")
    place = f"#{place}" if place else ""
    if folder is None:
        urls = dict(url.split(", ") for url in metadata("sdt_drake").get_all("Project-URL", []))
        return f"{urls['Documentation']}{path}{'/' * bool(path)}{place}"
    return (folder / f"{path or 'index'}.html").resolve().as_uri() + place
