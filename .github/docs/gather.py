"""Hook of MkDocs: add pages that the repository keeps elsewhere, and pages made of code."""

from __future__ import annotations

import html
import posixpath
import re
from pathlib import Path

from latex2mathml.converter import convert
from mkdocs.structure.files import File
from nbconvert import MarkdownExporter
from pymdownx.slugs import slugify

REPOSITORY = "https://github.com/sdt-drake/sdt_drake/blob/main/"
ROOT = Path(__file__).resolve().parents[2]
PAGES = {
    "README.md": "index.md",
    "diagrams/README.md": "findings/index.md",
    "diagrams/tutorial.ipynb": "tutorial.md",
    "models/README.md": "reference/files/index.md",
    "sdt_drake/README.md": "layout.md",
    "tests/benchmarks/README.md": "speed.md",
    ".github/CHANGELOG.md": "changes.md",
    ".github/CONTRIBUTING.md": "contributing.md",
    ".github/SECURITY.md": "security.md",
}
"""Site page of each file of the repository."""

EXAMPLES = {
    "scenario": "sdt_drake/cli/starter/scenario.yaml",
    "motion": "sdt_drake/cli/starter/motion.yaml",
    "robot": "sdt_drake/cli/starter/robot.sdf",
    "motors": "sdt_drake/cli/starter/motors.yaml",
    "drives": "models/drives.yaml",
    "stops": "models/stops.yaml",
    "acceptance": "models/acceptance.yaml",
    "perception": "models/perception/clark2019.yaml",
    "study": "sdt_drake/cli/starter/study.yaml",
    "sizing": "models/studies/sizing.yaml",
    "flight": "models/flights/jsbsim.yaml",
    "columns": """\
time: t  # column of the time; numbers, dates or times of day
time_factor: 0.001  # it is in ms
q: "Axis{k}.Position"  # one text for all joints, {k} from 1; or a list of columns
tau: [M1, M2, M3, M4]
angle: deg  # of positions and speeds
position_side: joint
side: motor  # of torques
torque_factor: [0.8, 24, 12, 12]  # N m for each unit: the columns are currents
direction: [1, 1, -1, 1]  # joint 3 counts the other way
delimiter: semicolon
decimal: comma
""",
    "controllers": """\
controller:
  kind: p_pi  # a position loop around the speed loop
  omega_r: 66  # rad/s, lowest natural frequency of the structure: the gains follow from it
  zeta: [1, 1, 1, 1]  # damping at the largest inertia
  feedforward: id  # the whole inverse dynamics; or ctc, none
  anti_windup: true
""",
    "tables": """\
time,q_ref_1,q_ref_2,v_ref_1,v_ref_2,vd_ref_1,vd_ref_2
0.000,0,0,0,0,0,0
0.005,0.0000125,0,0.005,0,1,0
""",
    "recording": """\
time,q_ref_1,q_ref_2,v_ref_1,v_ref_2,q_1,q_2,v_1,v_2,tau_cmd_1,tau_cmd_2,tau_1,tau_2
0.000,0,0,0,0,0,0,0,0,0.81,-2.4,0.81,-2.4
0.005,0.0000125,0,0.005,0,0.0000121,0,0.0048,0,0.93,-2.4,0.93,-2.4
""",
}
"""An example of each kind of file: a file with comments, or a text."""

_places: dict[str, str] = {}
"""Site page of each heading of the findings."""
_slug = slugify(case="lower")
_LINK = re.compile(r"\]\((?P<target>[^)\s#]*)(?P<anchor>#[^)\s]*)?(?=\))")
_PICTURE = re.compile(r"\]\((?:\.\./)*pictures/([\w.]+)\)")
_REFERENCE = re.compile(r"<!-- reference:.*?-->.*?<!-- end -->", re.DOTALL)


def on_files(files, config):
    """Add the pages of `PAGES`, their pictures, and the reference of commands and files."""
    from sdt_drake.show.reference import TOPICS, anchor

    chapters = {name: make() for name, make in TOPICS.items()}
    texts = {"reference/commands.md": _commands()}
    for topic, chapter in chapters.items():
        section = re.sub(r"^#(?=#)", "", chapter.markdown(anchor), flags=re.MULTILINE)
        head, _, rest = section.partition("\n\n")
        texts[f"reference/files/{topic}.md"] = "\n\n".join([head, _example(topic), rest])
    pictures: set[str] = set()
    texts["howto/training.md"] = _training(files, config, pictures)
    for page in Path(config.docs_dir).rglob("*.md"):
        shown = _PICTURE.findall(page.read_text(encoding="utf-8"))
        pictures |= {f"diagrams/{name}" for name in shown}
    for source, page in PAGES.items():
        if source.endswith(".ipynb"):
            text, made = MarkdownExporter().from_filename(str(ROOT / source))
            texts[page] = _with_links(text, source, page, pictures)
            for name, content in made["outputs"].items():
                files.append(File.generated(config, name, content=content))
        else:
            text = (ROOT / source).read_text(encoding="utf-8")
            parts = _split(text) if page.startswith("findings") else {page: text}
            parts = {own: _with_links(text, source, own, pictures) for own, text in parts.items()}
            texts |= {x: _REFERENCE.sub(_contents(chapters), text) for x, text in parts.items()}
    for page, text in texts.items():
        files.append(File.generated(config, page, content=text))
    for picture in sorted(pictures):
        place = f"pictures/{Path(picture).name}"
        files.append(File.generated(config, place, abs_src_path=str(ROOT / picture)))
    return files


def on_page_markdown(markdown, page, config, files):
    """Lead links to the findings to their chapters, and typeset equations as MathML."""
    here = posixpath.dirname(page.file.src_uri)

    def chapter(match):
        place = _places.get(match[1][1:] if match[1] else "", "findings/index.md")
        return f"]({posixpath.relpath(place, here or '.')}{match[1] or ''}"

    markdown = re.sub(r"\]\((?:\.\./)*findings\.md(#[\w-]+)?(?=\))", chapter, markdown)
    blocks = r"^```math\n(.*?)^```$"
    markdown = re.sub(blocks, lambda x: _math(x[1], "block"), markdown, flags=re.M | re.S)
    return re.sub(r"\$`([^`\n]+)`\$", lambda x: _math(x[1], "inline"), markdown)


def _math(tex: str, display: str) -> str:
    made = convert(" ".join(tex.split()), display=display)
    return f'<div class="equation">{made}</div>' if display == "block" else f"<span>{made}</span>"


def on_nav(nav, config, files):
    """Check that the reference describes every public name of the package."""
    import sdt_drake

    text = (Path(config.docs_dir) / "reference" / "python.md").read_text(encoding="utf-8")
    described = set(re.findall(r"^::: sdt_drake\.(\w+)$", text, re.MULTILINE))
    if missing := set(sdt_drake.__all__) - described:
        raise SystemExit(f"reference/python.md lacks {', '.join(sorted(missing))}")
    return nav


def _example(topic: str) -> str:
    """Return a commented example of a kind of file."""
    source = EXAMPLES[topic]
    is_file = "\n" not in source
    text = (ROOT / source).read_text(encoding="utf-8") if is_file else source
    text = re.sub(r"^# yaml-language-server.*\n", "", text).rstrip()
    lines = text.split("\n")
    language = "xml" if source.endswith(".sdf") else "text" if text.startswith("time,") else "yaml"
    shown = "\n".join(lines[:60])
    more = f"\n\nThe [whole file]({REPOSITORY}{source})." if len(lines) > 60 else ""
    return f"An example:\n\n```{language}\n{shown}\n```{more}"


def _split(text: str) -> dict[str, str]:
    """Return the chapters of the findings by their pages, and the page of each heading."""
    head, *chapters = re.split(r"^## ", text, flags=re.MULTILINE)
    pages, contents = {}, []
    for chapter in chapters:
        titles = [chapter.partition("\n")[0], *re.findall(r"^### (.*)", chapter, re.MULTILINE)]
        page = f"findings/{_slug(titles[0], '-')}.md"
        pages[page] = "# " + re.sub(r"^#(?=##)", "", chapter, flags=re.MULTILINE)
        _places.update({_slug(title.replace("`", ""), "-"): page for title in titles})
        contents.append(f"- [{titles[0]}](#{_slug(titles[0], '-')})")
    return {"findings/index.md": head + "\n".join(contents) + "\n"} | pages


def _training(files, config, pictures) -> str:
    """Return the page on the training motions: picture, 3D and prediction of each."""
    import sdt_drake as sdt
    from sdt_drake.motion import load_plan, load_profile, shipped_motions, story_of
    from sdt_drake.pilot.illusions import intended_illusion
    from sdt_drake.pilot.orientation import CAUTION
    from sdt_drake.show.view3d.viewer import recorded_page

    robot, parts = sdt.load_robot(), [(ROOT / _TRAINING).read_text(encoding="utf-8"), CAUTION]
    for name in shipped_motions():
        profile, found = load_profile(name), intended_illusion(name, robot)
        if found is None:
            continue
        motion = load_plan(name, robot, period=0.02).motion
        story = story_of(name, robot, motion)
        page = recorded_page(robot, motion.time, motion.q, title=profile.title, story=story)
        files.append(File.generated(config, f"howto/training/{name}.html", content=page))
        picture = f"diagrams/training_{name}_plot.png"
        pictures.add(picture)
        parts += [
            f"## {profile.title}",
            f"`{name}`, {profile.duration:g} s. {profile.feels}",
            "[![{0}: felt against true]({1}){{.illusion}}]({1})".format(
                profile.title, f"../pictures/{Path(picture).name}"
            ),
            f"[The motion in 3D](training/{name}.html) (a page of 5 MB)",
            "\n".join(f"- {html.escape(found.sentence(model))}" for model in found.predicted),
            f"```console\nsdt-drake pilot {name} --out {name}.png\n"
            f"sdt-drake view {name} --out {name}.html\n```",
        ]
    return "\n\n".join(parts)


_TRAINING = ".github/docs/pages/howto/training.md"


def _commands() -> str:
    from sdt_drake.cli.app import commands

    text = commands().generate_docs(output_format="markdown")
    text = re.sub(
        r"## Table of Contents\n.*?(?=\n\*\*)", "", text, flags=re.DOTALL
    )  # groups follow
    return re.sub(r"^example: (.*)$", r"```console\n\1\n```", text, flags=re.MULTILINE)


def _contents(chapters) -> str:
    """Return links to the pages of the reference of files."""
    return "\n".join(f"- [{chapter.title}]({topic}.md)" for topic, chapter in chapters.items())


def _with_links(text: str, source: str, page: str, pictures: set[str]) -> str:
    """Return a page with its links turned into links of the site, or of the repository."""
    here, folder = posixpath.dirname(page), posixpath.dirname(source)

    def link(match: re.Match) -> str:
        target, anchor = match["target"], match["anchor"] or ""
        if re.match(r"[a-z]+:|output_", target) or (not target and not page.startswith("findings")):
            return match[0]
        target = target or posixpath.basename(source)
        path = posixpath.normpath(posixpath.join(folder, target))
        if path in PAGES:
            place = PAGES[path]
            if place.startswith("findings"):
                place = _places.get(anchor[1:], place)
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
