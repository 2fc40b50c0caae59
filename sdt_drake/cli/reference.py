"""The command `reference`."""

from typing import TYPE_CHECKING

from sdt_drake.cli.common import Out, check_file, check_folder
from sdt_drake.cli.printing import echo, echo_wrapped
from sdt_drake.io.arguments import one_of
from sdt_drake.io.errors import InputError
from sdt_drake.io.files import write_text

if TYPE_CHECKING:
    from sdt_drake.show.reference import Chapter

_WIDTH = 80  # columns


def run(topic: str | None = None, /, *, out: Out = None) -> None:
    """Print the reference of each kind of file: fields, units, sides, defaults, choices, meanings.

    example: sdt-drake reference scenario

    Args:
        topic: kind of file (default: list all kinds)
        out: file for the reference of the topic (.md) or for the JSON Schema of its files
            (.json); without a topic, folder for both of all topics
    """
    from sdt_drake.show.reference import FILES, TOPICS, schema_text, write_reference

    if topic is None:
        if out is not None:
            check_folder(out)
            for path in write_reference(out):
                echo(f"{path} written")
            return
        for name, make in TOPICS.items():
            schema = ", with a JSON Schema" * (name in FILES)
            echo(f"{name:12s}  {make().title}{schema}")
        return
    one_of(topic, "TOPIC", tuple(TOPICS))
    chapter = TOPICS[topic]()
    if out is None:
        _print(chapter)
        return
    check_file(out, (".md", ".json"))
    if out.suffix == ".json" and topic not in FILES:
        raise InputError(
            f"{out}: {topic} has no JSON Schema, expected one of {', '.join(FILES)}, or .md"
        )
    write_text(out, schema_text(topic) if out.suffix == ".json" else f"{chapter.markdown()}\n")
    echo(f"{out} written")


def _print(chapter: "Chapter") -> None:
    for k, sheet in enumerate(chapter.sheets):
        echo("\n" * (k > 0) + (sheet.title or chapter.title))
        for paragraph in sheet.text.split("\n\n"):
            echo_wrapped(paragraph, "", "", _WIDTH)
        for row in sheet.rows:
            echo_wrapped(f"{row[0]}: {sheet.details(row)}", "  ", "  ", _WIDTH)
            echo_wrapped(row[-1], "      ", "      ", _WIDTH)
