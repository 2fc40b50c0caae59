"""The command `docs`."""

from __future__ import annotations

import webbrowser
from importlib.metadata import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

import sdt_drake
from sdt_drake.cli import COMMANDS, SUBCOMMANDS
from sdt_drake.cli.common import Out, check_file, check_folder
from sdt_drake.cli.printing import echo, echo_wrapped
from sdt_drake.io.arguments import one_of
from sdt_drake.io.errors import InputError
from sdt_drake.io.files import write_text

if TYPE_CHECKING:
    from sdt_drake.show.reference import Chapter

_WIDTH = 80  # columns


def run(
    topic: str | None = None,
    /,
    *,
    folder: Annotated[Path | None, Parameter(env_var="SDT_DRAKE_DOCS")] = None,
    print_only: Annotated[bool, Parameter("--print")] = False,
) -> None:
    """Open the documentation at the page of a command, a file, a field or a Python name.

    `docs files` prints the fields of each kind of file.

    example: sdt-drake docs controller.kp

    Args:
        topic: a command, a kind of file (`sdt-drake docs files`), a field, or a name in `sdt_drake`
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


# --- fields of files -------------------------------------------------------------------------


def files(kind: str | None = None, /, *, out: Out = None) -> None:
    """Print the fields of each kind of file: units, sides, defaults, choices, meanings.

    example: sdt-drake docs files scenario

    Args:
        kind: scenario, motion, study and so on (default: list all kinds)
        out: file for the fields (.md) or for the JSON Schema (.json) of the kind; without a kind,
            folder for both of all kinds
    """
    from sdt_drake.show.reference import FILES, TOPICS, schema_text, write_reference

    if kind is None:
        if out is not None:
            check_folder(out)
            for path in write_reference(out):
                echo(f"{path} written")
            return
        for name, make in TOPICS.items():
            schema = ", with a JSON Schema" * (name in FILES)
            echo(f"{name:12s}  {make().title}{schema}")
        return
    one_of(kind, "KIND", tuple(TOPICS))
    chapter = TOPICS[kind]()
    if out is None:
        _print(chapter)
        return
    check_file(out, (".md", ".json"))
    if out.suffix == ".json" and kind not in FILES:
        raise InputError(
            f"{out}: {kind} has no JSON Schema, expected one of {', '.join(FILES)}, or .md"
        )
    write_text(out, schema_text(kind) if out.suffix == ".json" else f"{chapter.markdown()}\n")
    echo(f"{out} written")


def _print(chapter: Chapter) -> None:
    for k, sheet in enumerate(chapter.sheets):
        echo("\n" * (k > 0) + (sheet.title or chapter.title))
        for paragraph in sheet.text.split("\n\n"):
            echo_wrapped(paragraph, "", "", _WIDTH)
        for row in sheet.rows:
            echo_wrapped(f"{row[0]}: {sheet.details(row)}", "  ", "  ", _WIDTH)
            echo_wrapped(row[-1], "      ", "      ", _WIDTH)
