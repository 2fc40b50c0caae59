"""Hook of MkDocs: add pages that the repository keeps elsewhere, and pages made of code."""

from __future__ import annotations

import posixpath
import re
from pathlib import Path

from mkdocs.structure.files import File
from nbconvert import MarkdownExporter

REPOSITORY = "https://github.com/sdt-drake/sdt_drake/blob/main/"
ROOT = Path(__file__).resolve().parents[2]
PAGES = {
    "README.md": "index.md",
    "diagrams/README.md": "findings.md",
    "diagrams/tutorial.ipynb": "tutorial.md",
    "models/README.md": "reference/files/index.md",
    "sdt_drake/README.md": "layout.md",
    "tests/benchmarks/README.md": "speed.md",
    ".github/CHANGELOG.md": "changes.md",
    ".github/CONTRIBUTING.md": "contributing.md",
    ".github/SECURITY.md": "security.md",
}
"""Site page of each file of the repository."""

_LINK = re.compile(r"\]\((?P<target>[^)\s#]*)(?P<anchor>#[^)\s]*)?(?=\))")
_PICTURE = re.compile(r"\]\((?:\.\./)*pictures/([\w.]+)\)")
_REFERENCE = re.compile(r"<!-- reference:.*?-->.*?<!-- end -->", re.DOTALL)


def on_files(files, config):
    """Add the pages of `PAGES`, their pictures, and the reference of commands and files."""
    from sdt_drake.show.reference import TOPICS, anchor

    chapters = {name: make() for name, make in TOPICS.items()}
    texts = {"reference/commands.md": _commands()}
    for topic, chapter in chapters.items():
        section = chapter.markdown(anchor)
        texts[f"reference/files/{topic}.md"] = re.sub(r"^#(?=#)", "", section, flags=re.MULTILINE)
    pictures = set()
    for page in Path(config.docs_dir).rglob("*.md"):
        shown = _PICTURE.findall(page.read_text(encoding="utf-8"))
        pictures |= {f"diagrams/{name}" for name in shown}
    for source, page in PAGES.items():
        if source.endswith(".ipynb"):
            texts[page], made = MarkdownExporter().from_filename(str(ROOT / source))
            for name, content in made["outputs"].items():
                files.append(File.generated(config, name, content=content))
        else:
            text = (ROOT / source).read_text(encoding="utf-8")
            text = _with_links(text, source, page, pictures)
            texts[page] = _REFERENCE.sub(_contents(chapters), text)
    for page, text in texts.items():
        files.append(File.generated(config, page, content=text))
    for picture in sorted(pictures):
        place = f"pictures/{Path(picture).name}"
        files.append(File.generated(config, place, abs_src_path=str(ROOT / picture)))
    return files


def on_nav(nav, config, files):
    """Check that the reference describes every public name of the package."""
    import sdt_drake

    text = (Path(config.docs_dir) / "reference" / "python.md").read_text(encoding="utf-8")
    described = set(re.findall(r"^::: sdt_drake\.(\w+)$", text, re.MULTILINE))
    if missing := set(sdt_drake.__all__) - described:
        raise SystemExit(f"reference/python.md lacks {', '.join(sorted(missing))}")
    return nav


def _commands() -> str:
    from sdt_drake.cli.app import commands

    return re.sub(
        r"^example: (.*)$",
        r"```console\n\1\n```",
        commands().generate_docs(output_format="markdown"),
        flags=re.MULTILINE,
    )


def _contents(chapters) -> str:
    """Return links to the pages of the reference of files."""
    return "\n".join(f"- [{chapter.title}]({topic}.md)" for topic, chapter in chapters.items())


def _with_links(text: str, source: str, page: str, pictures: set[str]) -> str:
    """Return a page with its links turned into links of the site, or of the repository."""
    here, folder = posixpath.dirname(page), posixpath.dirname(source)

    def link(match: re.Match) -> str:
        target, anchor = match["target"], match["anchor"] or ""
        if not target or re.match(r"[a-z]+:", target):
            return match[0]
        path = posixpath.normpath(posixpath.join(folder, target))
        if path in PAGES:
            place = PAGES[path]
        elif path.startswith(".github/docs/pages/"):
            place = path.removeprefix(".github/docs/pages/")
        elif Path(path).suffix in (".png", ".svg"):
            pictures.add(path)
            place = f"pictures/{posixpath.basename(path)}"
        elif (ROOT / path).exists():
            return f"]({REPOSITORY}{path}{anchor}"
        else:
            raise SystemExit(f"{source}: no file {path}")
        return f"]({posixpath.relpath(place, here or '.')}{anchor}"

    return _LINK.sub(link, text)
