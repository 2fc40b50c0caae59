"""README and the pages of the documentation, and the command that opens them."""

import re
import shlex
import shutil
from dataclasses import replace
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

from sdt_drake.cli import COMMANDS
from sdt_drake.cli.app import commands, main
from sdt_drake.cli.docs import pages
from sdt_drake.motion import Motion

design = import_module("sdt_drake.run.design")  # the name in the package is the function
ROOT = Path(__file__).resolve().parents[1]
TEXTS = {
    str(path.relative_to(ROOT)): path.read_text(encoding="utf-8")
    for path in [
        *(ROOT / name for name in ("README.md", "diagrams/README.md", "models/README.md")),
        *(ROOT / name for name in ("sdt_drake/README.md", "tests/benchmarks/README.md")),
        *(ROOT / "tests" / name / "README.md" for name in ("helpers", "oracles")),
        *sorted((ROOT / ".github").rglob("*.md")),
    ]
}
LINES = {
    line.partition(" > ")[0].partition(" #")[0].strip()
    for text in TEXTS.values()
    for line in re.findall(r"^ *(?:- )?sdt-drake ([a-z].*)$", text, re.MULTILINE)
} | set(re.findall(r"^\| `([^`]*)` \| [^|]* s \|", TEXTS["README.md"], re.MULTILINE))


@pytest.mark.parametrize("line", sorted(LINES))
def test_commands_in_documents_are_accepted_by_the_parser(line):
    words = shlex.split(line)
    commands(words[0]).parse_args(words)


@pytest.fixture
def one_second(monkeypatch):
    """Plan motions of 1 s that end at rest: the numbers of documented runs are not looked at."""

    def first(scenario, robot, whole=design.plan_of):
        plan = whole(scenario, robot)
        v = plan.motion.v[:201] * np.linspace(1, 0, len(plan.motion.v[:201]))[:, None]
        return replace(plan, motion=Motion.from_speeds(plan.motion.period, plan.motion.q[0], v))

    monkeypatch.setattr(design, "plan_of", first)


@pytest.mark.documents
@pytest.mark.parametrize("page", [page for page, text in TEXTS.items() if "```python" in text])
def test_python_in_documents_runs_and_prints(page, tmp_path, monkeypatch, capsys, one_second):
    monkeypatch.chdir(tmp_path)
    for block in re.findall(r"^```python\n(.*?)^```", TEXTS[page], re.MULTILINE | re.DOTALL):
        exec(compile(block, page, "exec"), {})
    assert capsys.readouterr().out
    assert list(tmp_path.glob("*.png"))


GIVEN = {
    "recording": [
        "init my_robot --robot my.urdf", "simulate my_robot/scenario.yaml --out log.csv",
    ],
    "learn": [
        "list real_device > my_machine.yaml",
        "simulate my_machine.yaml --out run_1.csv",
        "simulate my_machine.yaml --set plant.deviation.payload_mass=1 --out run_2.csv",
    ],
}  # fmt: skip
"""Commands that make what a page calls the user's own files."""
SHRUNK = {"draws: 250": "draws: 4", "timeout: 120": "timeout: 600"}
"""Fewer runs of a documented study."""


def commands_of(text):
    """Return the lines of `console` blocks and of tables with times, in their order."""
    found = re.findall(r"^ *sdt-drake (.*)$|^\| `([^`]*)` \| [^|]* s \|", text, re.MULTILINE)
    return [(line or row).removeprefix("sdt-drake ") for line, row in found]


OWN_TESTS = ("fly ", "reproduce ", "accept predict ")
"""Commands that take long, and have tests of their own."""
PAGES = {
    page: text
    for page, text in TEXTS.items()
    if commands_of(text) and page != "diagrams/README.md" and "HOST" not in text
}
"""Pages with commands; those of the findings take hours, and a cluster needs its host."""


@pytest.mark.documents
@pytest.mark.parametrize("page", PAGES)
def test_commands_run_in_their_order_in_an_empty_folder(
    page, tmp_path, monkeypatch, capsys, request
):
    monkeypatch.chdir(tmp_path)
    given = GIVEN.get(Path(page).stem, [])
    whole = page == "README.md" or Path(page).stem == "acceptance_test"
    if not (given or whole):  # they identify and judge whole motions
        request.getfixturevalue("one_second")
    shutil.copy(ROOT / "tests/helpers/robot_files/arm.urdf", "my.urdf")
    for yaml in re.findall(r"^```yaml\n(.*?)^```", PAGES[page], re.MULTILINE | re.DOTALL):
        named = re.match(r"# (\w+\.yaml)\n", yaml)
        Path(named[1] if named else "motion.yaml").write_text(yaml, encoding="utf-8")
    for line in given + commands_of(PAGES[page]):
        if line.startswith(OWN_TESTS):
            continue
        words, _, target = line.partition(" #")[0].partition(" > ")
        assert main(shlex.split(words)) == 0, (line, capsys.readouterr().err)
        printed = capsys.readouterr().out
        for old, new in SHRUNK.items():
            printed = printed.replace(old, new)
        if target:
            Path(target.strip()).write_text(printed, encoding="utf-8")


def test_readme_counts_the_commands():
    assert f"lists all {len(COMMANDS)} commands" in TEXTS["README.md"]


@pytest.mark.parametrize("page", TEXTS)
def test_links_and_headings_of_documents_exist(page):
    text = re.sub(r"```.*?```", "", TEXTS[page], flags=re.DOTALL)
    for target, heading in re.findall(r"\]\((?!http)([^)#\s]*)(#[^)\s]*)?\)", text):
        file = (ROOT / page).parent / target if target else ROOT / page
        if "docs/pages" in page and not file.exists():
            continue  # made by the builder of the site, which checks its links itself
        assert file.exists(), target
        if heading:
            titles = re.findall(r"^#+ (.*)", file.read_text(encoding="utf-8"), re.MULTILINE)
            slugs = {re.sub(r"[^\w -]", "", t).lower().replace(" ", "-") for t in titles}
            assert heading[1:] in slugs, heading


@pytest.mark.parametrize(
    "topic, page",
    [
        (None, ""),
        ("simulate", "reference/commands#sdt-drake-simulate"),
        ("scenario", "reference/files/scenario"),
        ("kp", "reference/files/scenario#controller.kp"),
        ("!Ramp", "reference/files/motion#Ramp.at"),
        ("perceive", "reference/python#sdt_drake.perceive"),
    ],
)
def test_docs_opens_the_page_of_a_topic(topic, page):
    assert pages(topic)[0] == page


def test_docs_prints_addresses(capsys, tmp_path):
    assert main(["docs", "kp", "--print"]) == 0
    assert re.fullmatch(r"https://.*/scenario/#controller\.kp\n", capsys.readouterr().out)
    assert main(["docs", "simulat"]) == main(["docs", "--folder", str(tmp_path)]) == 2
    assert re.search(r"did you mean 'simulate'.*\n.*index\.html", capsys.readouterr().err)
    (tmp_path / "index.html").touch()
    assert main(["docs", "--print", "--folder", str(tmp_path)]) == 0
    assert capsys.readouterr().out == f"{(tmp_path / 'index.html').as_uri()}\n"


def test_tests_and_oracles_of_published_numbers_exist():
    own = "\n".join(
        path.read_text(encoding="utf-8") for path in (ROOT / "tests").rglob("test_*.py")
    )
    text = TEXTS["tests/oracles/README.md"]
    named = set(re.findall(r"`(test_\w+)`", text))
    assert len(named) > 50 and named <= set(re.findall(r"^def (test_\w+)\(", own, re.MULTILINE))
    for path in (ROOT / "tests/oracles").glob("[a-z]*.py"):
        assert f"`{path.stem}`" in text and "ndependent: " in path.read_text(encoding="utf-8")
