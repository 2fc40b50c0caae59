"""report.html: what it says, that it needs nothing else, and how it looks in a browser."""

from __future__ import annotations

import json
import math
import re
import shutil
import sys
import xml.etree.ElementTree as ElementTree
from html.parser import HTMLParser
from itertools import pairwise
from pathlib import Path

import pytest

from sdt_drake.analysis import block_diagrams, page
from sdt_drake.analysis.page import PAGE, RECORDING, VERDICTS, write_page
from sdt_drake.errors import InputError

sys.path.insert(0, str(Path(__file__).parents[1]))
from browser import open_page

# A recording small enough for every test, with all that could end a script or an attribute.
HELLO = '<!DOCTYPE html><p id="hello">"</script>\'&amp;<!-- <script></p>'


@pytest.fixture(scope="module")
def _made(written, tmp_path_factory):
    """What the page is made of, and the page."""
    folder = tmp_path_factory.mktemp("report")
    (folder / "diagrams").mkdir()
    for path in [*written.folder.glob("*.svg"), *written.folder.glob("diagrams/*")]:
        shutil.copy(path, folder / path.relative_to(written.folder))
    shutil.copy(written.folder / "summary.json", folder)
    write_page(folder)
    return folder


@pytest.fixture
def folder(_made, tmp_path):
    """A copy to change."""
    return Path(shutil.copytree(_made, tmp_path / "out"))


@pytest.fixture(scope="module")
def with_recording(_made, tmp_path_factory):
    """A page with a recording; do not change it."""
    folder = Path(shutil.copytree(_made, tmp_path_factory.mktemp("recorded") / "out"))
    (folder / RECORDING).write_text(HELLO, encoding="utf-8")
    return write_page(folder)


def change(folder, edit):
    """Edit the summary in place."""
    path = folder / "summary.json"
    content = json.loads(path.read_text(encoding="utf-8"))
    edit(content)
    path.write_text(json.dumps(content), encoding="utf-8")
    return content


class Tags(HTMLParser):
    """Tags with their attributes, and the texts between them."""

    def __init__(self, text):
        super().__init__()
        self.tags, self.texts = [], []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))

    def handle_data(self, data):
        self.texts.append(data)


def tags_of(folder):
    return Tags((folder / PAGE).read_text(encoding="utf-8"))


# --- what it says ----------------------------------------------------------------------------


def test_every_claim_has_its_verdict(_made):
    claims = json.loads((_made / "summary.json").read_text(encoding="utf-8"))["claims"]
    articles = [a for tag, a in tags_of(_made).tags if tag == "article"]

    assert {(a["id"], a["data-verdict"]) for a in articles} == {
        (f"claim-{c['id']}", c["verdict"]) for c in claims
    }
    text = (_made / PAGE).read_text(encoding="utf-8")
    for verdict in VERDICTS:
        count = sum(c["verdict"] == verdict for c in claims)
        assert f"<strong>{count}</strong> {verdict}" in text


def test_findings_are_what_the_runs_say(written):
    summary = json.loads((written.folder / "summary.json").read_text(encoding="utf-8"))
    runs = {
        (r["algorithm"], r["controller"]): r
        for r in summary["tracking"]
        if r["plant"] == "coupled" and not r["disturbance_amplitude"]
    }
    pi, ctc = runs["consistent", "pi"], runs["consistent", "pi_ctc"]
    beyond = {e["controller"]: e for e in summary["beyond"]}
    found = " ".join(page.findings(summary))

    before, after = pi["max_abs_speed_error"][1], ctc["max_abs_speed_error"][1]
    assert f"joint 2 from {before:.3f} to {after:.3f} rad/s" in found
    printed = runs["printed", "pi_ctc"]["max_abs_speed_error"][1]
    assert f"{printed / before:.1f} times that of PI alone" in found
    drift = max(beyond["pi"]["max_abs_position_error"])
    assert f"drifts by up to {math.degrees(drift):.1f} deg" in found


def test_findings_leave_out_what_was_not_run(folder):
    content = change(folder, lambda s: s.update(tracking=s["tracking"][:1], beyond=s["beyond"][:1]))
    (only,) = page.findings(content)
    assert "ours" in only
    write_page(folder)


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("K_IS = omega_r² I_eff,max", "K<sub>IS</sub> = ω<sub>r</sub>² I<sub>eff,max</sub>"),
        ("K_IS,4 is 2", "K<sub>IS,4</sub> is 2"),
        ("the printed zeta", "the printed ζ"),
        ("tau_coupled, tau_LD", "τ<sub>coupled</sub>, τ<sub>LD</sub>"),
        ("pi_ctc zetas <b>", "pi_ctc zetas &lt;b&gt;"),
    ],
)  # fmt: skip
def test_symbols_are_printed_as_in_equations(text, shown):
    assert page._pretty(text) == shown


@pytest.mark.parametrize(
    ("value", "shown"),
    [(None, "–"), (True, "yes"), (4.26, "4.26"), (52023.03, "52\u202f023"), (4.5e-13, "4.5e-13"),
     (0.0, "0"), ("<b>", "&lt;b&gt;")],
)  # fmt: skip
def test_numbers_are_readable(value, shown):
    assert page._number(value) == shown


def test_all_text_is_escaped(folder):
    evil = '<script>alert(1)</script>" onload="x'

    def edit(summary):
        summary["claims"][0] |= {"why": evil, "statement": evil, "id": evil, "published": evil}
        summary["versions"]["drake"] = evil
        summary["wall_time_s"] = {evil: 1.0}
        summary["beyond"][0] |= {"controller": evil, "needs": [evil], "blocks": evil}
        summary["beyond"][0]["felt"]["channels"][0] = evil
        summary["table1"][0]["joint"] = evil
        summary["table1"][0]["published"]["kp"] = evil
        summary["step_response"]["published"]["pi"]["rise_time"] = evil
        summary["tracking"][0] |= {"controller": evil, "plant": evil, "algorithm": evil}

    change(folder, edit)
    write_page(folder)
    text = (folder / PAGE).read_text(encoding="utf-8")

    assert "alert(1)</script>" not in text
    assert text.count("alert(1)") >= 14
    assert not [a for _, a in tags_of(folder).tags if "onload" in a]


def test_no_text_of_the_summary_becomes_a_tag(folder):
    """All of them at once, and the names of those mappings that are shown whole."""
    evil = "<script>alert(1)</script>"

    def spoilt(value, key=""):
        if isinstance(value, dict):
            shown_whole = key in ("versions", "wall_time_s", "published", "computed")
            return {
                f"{k}{evil}" if shown_whole and k not in KEYS else k: spoilt(v, k)
                for k, v in value.items()
            }
        if isinstance(value, list):
            return [spoilt(item, key) for item in value]
        return evil if isinstance(value, str) and key != "verdict" else value

    change(folder, lambda s: s.update(spoilt(s)))
    write_page(folder)
    text = (folder / PAGE).read_text(encoding="utf-8")

    assert evil not in text and text.count("&lt;script&gt;") > 100


# Of mappings that are shown whole, what the page looks up by name.
KEYS = {
    "package", "drake", "pi", "p_in_feedback", "i_eff_max", "i_eff_median", "i_eff_min",
    "variation_percent", "kp", "ki", "zeta_max", "zeta_median", "zeta_min",
}  # fmt: skip


@pytest.mark.parametrize("label", ["pi", "pi_ctc", "pi_id"])
def test_findings_without_errors_compare_nothing(folder, label):
    def edit(summary):
        for run in [*summary["tracking"], *summary["beyond"]]:
            if run["controller"] == label:
                for key in ("max_abs_speed_error", "rms_speed_error", "constant_speed_error"):
                    run[key] = [0.0] * 4

    before = page.findings(json.loads((folder / "summary.json").read_text(encoding="utf-8")))
    assert len(page.findings(change(folder, edit))) < len(before) or label == "pi_ctc"
    write_page(folder)


def test_headings_are_in_order(_made):
    levels = [int(tag[1]) for tag, _ in tags_of(_made).tags if re.fullmatch("h[1-6]", tag)]

    assert levels[0] == 1 and levels.count(1) == 1
    assert all(after - before <= 1 for before, after in pairwise(levels))


def test_links_lead_somewhere(_made):
    tags = tags_of(_made).tags
    ids = {a["id"] for _, a in tags if "id" in a}
    links = [a["href"] for tag, a in tags if tag == "a"]

    assert len(links) > 8
    assert {link.removeprefix("#") for link in links} <= ids


# --- pictures --------------------------------------------------------------------------------


def test_the_study_writes_the_figures_and_diagrams_that_have_captions(written):
    assert {path.stem for path in written.folder.glob("*.svg")} >= set(page.FIGURES)
    assert set(page.DIAGRAMS) == set(block_diagrams.DIAGRAMS)


def test_every_figure_is_there_with_words(_made):
    tags = tags_of(_made).tags
    labels = [a["aria-label"] for _, a in tags if a.get("role") == "img"]
    diagrams = len(list((_made / "diagrams").glob("*.svg")))

    assert len(labels) == len(list(_made.glob("*.svg"))) + diagrams
    assert all(labels) and len({*page.FIGURES.values()} & {*labels}) == len(page.FIGURES)
    assert sum(tag == "svg" for tag, _ in tags) == len(labels)


def test_ids_are_unique_and_references_hold(with_recording):
    text = with_recording.read_text(encoding="utf-8")
    tags = Tags(text).tags
    ids = [a["id"] for _, a in tags if "id" in a]
    named = [v for _, a in tags for k, v in a.items() if k.endswith("href") and v[:1] == "#"]
    painted = [
        m for _, a in tags for v in a.values() for m in re.findall(r"url\((#[^)]+)\)", v or "")
    ]

    assert len(ids) == len(set(ids)) > 300
    assert {*named, *painted} <= {f"#{id_}" for id_ in ids}
    assert len(painted) > 30


def test_a_picture_brings_no_rules_for_the_page():
    root = ElementTree.fromstring(
        '<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink" '
        'width="20pt" height="10pt" viewBox="0 0 20 10"><metadata>by</metadata><defs><style>*{x:y}'
        '</style><clipPath id="c"/></defs><g id="g" class="claim" style="clip-path: url(#c)"/>'
        '<use xlink:href="#g"/></svg>'
    )
    text = page.inline_svg(root, "a")

    assert (
        "class" not in text
        and "<style" not in text
        and "metadata" not in text
        and "height" not in text
    )
    assert 'id="a-c"' in text and "url(#a-c)" in text and '"#a-g"' in text
    assert "width: 20pt" in text and text.startswith("<svg")


ACTIVE = """<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink"
  xmlns:svg="http://www.w3.org/2000/svg" xmlns:h="http://www.w3.org/1999/xhtml" viewBox="0 0 9 9"
  width="1px; position: fixed; top: 0" onload="alert(1)" svg:onclick="alert(2)">
  <script>alert(3)</script><h:script>alert(4)</h:script><h:img src="x" onerror="alert(5)"/>
  <foreignObject><h:body onload="alert(6)"/></foreignObject>
  <a xlink:href="javascript:alert(7)"><set attributeName="href" to="javascript:alert(8)"/>
    <rect id="r" width="4" height="4" OnMouseOver="alert(9)" fill="url('#p')"/></a>
  <a href="http://elsewhere.org/"><circle r="2" style="fill: URL( http://elsewhere.org/p )"/></a>
  <image href="data:image/svg+xml,alert" /><image href="data:image/png;base64,AAAA"/>
  <image src="//elsewhere.org/a.png"/><use xlink:href="#r"/><use href="other.svg#r"/>
  <path d="M0 0" style="fill: u\\72l(//elsewhere.org/q)"/><path mask="url(//elsewhere.org/m)"/>
</svg>"""


def test_a_picture_brings_nothing_that_acts_or_asks_for_something(folder):
    (folder / "evil.svg").write_text(ACTIVE.replace("\\\\", "\\"), encoding="utf-8")
    write_page(folder)
    text = page.inline_svg(ElementTree.fromstring(ACTIVE.replace("\\\\", "\\")), "a")

    for word in ("alert", "javascript", "elsewhere", "script", "foreign", "img", "other.svg"):
        assert word not in text, word
    assert not re.search(r"\bon\w+=|position|svg\+xml|\\\\", text, re.IGNORECASE)
    # What is harmless stays.
    assert 'href="data:image/png;base64,AAAA"' in text and "url('#a-p')" in text
    assert 'id="a-r"' in text and 'href="#a-r"' in text and "width: 100%" in text
    with open_page(folder / PAGE) as (_, errors, requests):
        assert errors == [] and requests == []


@pytest.mark.parametrize(
    ("content", "reason"),
    [("<svg", "is not an SVG picture"), ("<a/>", "is not an SVG picture"),
     (b"\xff", "cannot be read"), (None, "is a folder"),
     (f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 1 1">{"<g>" * 20000}'
      f'{"</g>" * 20000}</svg>', "is not an SVG picture")],
    ids=["cut", "other", "binary", "folder", "deep"],
)  # fmt: skip
def test_another_picture_that_cannot_be_used_is_left_out(folder, content, reason):
    before = (folder / PAGE).read_bytes()
    other = folder / "my; own.svg"
    if content is None:
        other.mkdir()
    else:
        other.write_bytes(content if isinstance(content, bytes) else content.encode())
    told = []
    write_page(folder, told.append)

    (line,) = told
    assert line.startswith(f"{other}: {reason}") and line.endswith(", left out")
    assert "\n" not in line and (folder / PAGE).read_bytes() == before


def test_other_figures_of_the_folder_come_last(folder):
    shutil.copy(folder / "figure4.svg", folder / "felt_<motion>.svg")
    write_page(folder)
    labels = [a["aria-label"] for _, a in tags_of(folder).tags if a.get("role") == "img"]

    assert labels[-1] == "Felt <motion>."


def test_without_graphviz_the_page_says_so(folder):
    for path in folder.glob("diagrams/*.svg"):
        path.unlink()
    write_page(folder)

    assert "Graphviz was not installed" in (folder / PAGE).read_text(encoding="utf-8")


# --- alone -----------------------------------------------------------------------------------


def test_nothing_is_loaded_from_elsewhere(with_recording):
    text = with_recording.read_text(encoding="utf-8")
    for tag, attributes in Tags(text).tags:
        for key in ("src", "href", "xlink:href", "srcset", "data"):
            assert attributes.get(key, "#")[:1] == "#" or attributes[key].startswith("data:"), tag
    assert "@import" not in text and "url(http" not in text


def test_the_recording_survives_its_embedding(with_recording):
    text = with_recording.read_text(encoding="utf-8")
    (held,) = re.findall(r'<script type="application/json"[^>]*>(.*?)</script>', text, re.DOTALL)

    assert json.loads(held) == HELLO


def test_without_a_recording_there_is_no_section_for_it(_made):
    text = (_made / PAGE).read_text(encoding="utf-8")

    assert 'id="device"' not in text and "application/json" not in text


# --- folders that cannot be used -------------------------------------------------------------


def _cut(name):
    return lambda folder: (folder / name).write_bytes((folder / name).read_bytes()[:1000])


def _remove(*names):
    return lambda folder: [(folder / name).unlink() for name in names]


BROKEN = {
    "no summary": (_remove("summary.json"), "summary.json: is missing"),
    "cut summary": (_cut("summary.json"), "summary.json: is not JSON"),
    "a list": (lambda f: (f / "summary.json").write_text("[1]"), "not the summary"),
    "not a number": (
        lambda f: change(f, lambda s: s["wall_time_s"].update(x=math.nan)), "holds NaN, expected"),
    "infinity": (
        lambda f: change(f, lambda s: s["wall_time_s"].update(x=-math.inf)), "holds -Infinity"),
    "too large": (
        lambda f: (f / "summary.json").write_text('{"x": 1e999}'), "holds 1e999, expected"),
    "huge": (lambda f: change(f, lambda s: s["wall_time_s"].update(x=10**400)), "another form"),
    "no claims": (lambda f: change(f, lambda s: s.pop("claims")), "has no 'claims'"),
    "odd verdict": (
        lambda f: change(f, lambda s: s["claims"][0].update(verdict="so so")), "'so so'"),
    "claims a number": (lambda f: change(f, lambda s: s.update(claims=7)), "another form"),
    "no runs": (lambda f: change(f, lambda s: s.update(tracking=[])), "another form"),
    "no figure": (_remove("figure8.svg"), "figure8.svg: is missing"),
    "cut figure": (_cut("figure2.svg"), "figure2.svg: is not an SVG"),
    "other xml": (lambda f: (f / "figure2.svg").write_text("<a/>"), "figure2.svg: is not an SVG"),
    "binary": (lambda f: (f / "figure4.svg").write_bytes(b"\xff\xfe\x00"), "figure4.svg"),
    "a folder": (lambda f: (_remove("figure4.svg")(f), (f / "figure4.svg").mkdir()), "figure4.svg"),
    "no diagram": (_remove("diagrams/figure5.dot", "diagrams/figure5.svg"), "figure5.svg"),
    "recording": (lambda f: (f / RECORDING).write_bytes(b"\xff"), f"{RECORDING}: cannot be read"),
}  # fmt: skip


@pytest.mark.parametrize("case", BROKEN)
def test_what_is_missing_is_named_and_the_old_page_stays(folder, case):
    if case == "no diagram" and not (folder / "diagrams" / "figure5.svg").exists():
        (folder / "diagrams" / "figure5.svg").touch()  # no Graphviz
    spoil, expected = BROKEN[case]
    spoil(folder)
    old = (folder / PAGE).read_bytes()
    with pytest.raises(InputError) as caught:
        write_page(folder)

    message = str(caught.value)
    assert expected in message and f"sdt-drake reproduce --out {folder}" in message
    assert "\n" not in message and str(folder) in message.split(":")[0]
    assert (folder / PAGE).read_bytes() == old
    assert not list(folder.glob(".*"))


# --- in a browser ----------------------------------------------------------------------------

# Contrast of WCAG 2 between the text of elements and what is behind them.
CONTRAST = """
() => {
  const canvas = new OffscreenCanvas(1, 1).getContext("2d", {willReadFrequently: true});
  const rgb = (colour) => {
    canvas.clearRect(0, 0, 1, 1); canvas.fillStyle = colour; canvas.fillRect(0, 0, 1, 1);
    return [...canvas.getImageData(0, 0, 1, 1).data];
  };
  const luminance = (c) => c.slice(0, 3).map((v) => v / 255)
    .map((v) => v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4)
    .reduce((sum, v, i) => sum + v * [0.2126, 0.7152, 0.0722][i], 0);
  const ground = (e) => {
    for (; e; e = e.parentElement) {
      const c = rgb(getComputedStyle(e).backgroundColor);
      if (c[3] === 255) return c;
    }
    return [255, 255, 255];
  };
  let least = [99, ""];
  for (const e of document.querySelectorAll("h1,h2,h3,p,a,td,th,li,button,figcaption,code")) {
    if (!e.innerText || !e.checkVisibility()) continue;
    const [a, b] = [luminance(rgb(getComputedStyle(e).color)), luminance(ground(e))];
    const ratio = (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05);
    if (ratio < least[0]) least = [ratio, e.outerHTML.slice(0, 200)];
  }
  return least;
}
"""
WIDTH = "document.documentElement.scrollWidth"


def test_filter_theme_and_recording_work_without_complaint(with_recording):
    with open_page(with_recording) as (tab, errors, requests):
        shown = tab.locator("article:visible")
        everything = shown.count()
        by_verdict = {}
        for verdict in VERDICTS:
            button = tab.locator(f'.filter button[data-verdict="{verdict}"]')
            button.click()
            by_verdict[verdict] = shown.count()
            assert button.get_attribute("aria-pressed") == "true"
            assert button.inner_text() == f"{verdict} {shown.count()}"
            assert set(shown.evaluate_all("all => all.map(a => a.dataset.verdict)")) == {verdict}
            assert f"{shown.count()} of {everything}" in tab.locator(".shown").inner_text()
        assert sum(by_verdict.values()) == everything and 0 not in by_verdict.values()
        tab.locator(".filter button").first.click()
        assert shown.count() == everything

        ground = "getComputedStyle(document.body).backgroundColor"
        light = tab.evaluate(ground)
        tab.locator("#theme").click()
        assert tab.evaluate(ground) != light
        tab.locator("#theme").click()
        assert tab.evaluate(ground) == light

        assert tab.locator("iframe").count() == 0
        tab.locator(".recording button").click()
        assert tab.frame_locator("iframe").locator("#hello").inner_text().startswith('"')
        assert errors == [] and requests == []


@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
def test_text_stands_out(with_recording, dark):
    with open_page(with_recording, dark=dark) as (tab, _, _):
        ratio, element = tab.evaluate(CONTRAST)
        assert ratio >= 4.5, element  # WCAG 2 AA
        assert tab.locator(".canvas").first.evaluate(
            "e => getComputedStyle(e).backgroundColor"
        ) == "rgb(255, 255, 255)"  # fmt: skip
        sun = tab.evaluate("getComputedStyle(document.body).backgroundColor")
        assert (min(map(int, re.findall(r"\d+", sun))) < 128) == dark


@pytest.mark.parametrize("width", [320, 375, 768, 1280])
def test_the_page_never_scrolls_sideways(with_recording, width):
    with open_page(with_recording, width=width) as (tab, errors, _):
        assert tab.evaluate(WIDTH) == width
        assert errors == []


def test_on_paper_there_is_all_of_it(with_recording):
    with open_page(with_recording, width=703) as (tab, errors, _):  # A4 less margins, at 96 dpi
        claims = tab.locator("article").count()
        tab.locator(".filter button").nth(1).click()
        tab.locator("#theme").click()
        tab.emulate_media(media="print")

        assert tab.locator("article:visible").count() == claims
        assert tab.locator("button:visible, nav:visible, #device:visible").count() == 0
        assert tab.evaluate(WIDTH) == 703  # no table or figure is cut
        cut = "all => all.filter(e => e.scrollWidth > e.clientWidth + 1).length"
        assert tab.locator(".scroll").evaluate_all(cut) == 0
        assert tab.evaluate("getComputedStyle(document.body).color") == "rgb(27, 34, 41)"
        assert errors == []


def test_without_scripts_all_is_there_but_buttons(with_recording):
    with open_page(with_recording, javascript=False) as (tab, errors, _):
        assert tab.locator("article:visible").count() > 20
        assert tab.locator("button:visible").count() == 0
        assert errors == []
