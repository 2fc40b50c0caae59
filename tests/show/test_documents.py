"""Reports as Markdown and as pages; the pages in a browser."""

import base64
import io
import re
from functools import cache
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from PIL import Image

from sdt_drake.io.files import write_text
from sdt_drake.paper.claims import VERDICTS
from sdt_drake.paper.report import write_report
from sdt_drake.show import sections as doc
from sdt_drake.show.documents import Report
from sdt_drake.show.panels import Panel, Plots

DIAGRAMS = Path(__file__).parents[2] / "diagrams"
SVG = '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 1 1"/>'
# A page with all that could end a script or an attribute.
HELLO = '<!DOCTYPE html><p id="hello">"</script>\'&amp;<!-- <script></p>'


class Tags(HTMLParser):
    """Tags with their attributes, and the texts between them."""

    def __init__(self, text):
        super().__init__()
        self.tags, self.text = [], ""
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))

    def handle_data(self, data):
        self.text += data


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Two pictures, one a block diagram that has no PNG, and a page; do not change it."""
    folder = tmp_path_factory.mktemp("document")
    for name in ("a", "b"):
        write_text(folder / f"{name}.svg", SVG)
    write_text(folder / "device.html", HELLO)
    return folder


WORDS = doc.Table(["", "a|b"], [["row", "1 | 2"]], "Of words")
NUMBERS = doc.spread(["name", "A", "speed"], [["x", "–", ["1.5", "2.5"]]])
ROW = doc.Row(["I_eff < 1", "Table 1", "✓ yes"], ["why"], "yes", "good")
BLOCKS = [
    doc.said("One **bold**, *slanted*, {:code} of K_IS", "c_o*d*e"),
    doc.tiles([(3, "good ones", "good")]),
    WORDS,
    NUMBERS,
    doc.Picture("a.svg", "A picture"),
    doc.Picture("b.png", "Another"),
    doc.details("More & more", "inside"),
    doc.Page("device.html", "Load it"),
    doc.Rows(["claim", "place", "verdict"], [ROW]),
]
REPORT = Report("Title", ["lead"], [doc.Section("Main", BLOCKS)])


def test_blocks_become_markdown():
    assert REPORT.markdown().removesuffix("\n").split("\n\n") == [
        "# Title",
        "lead",
        "## Main",
        "One **bold**, *slanted*, `c_o*d*e` of K_IS",
        '<div class="tiles">',
        '<div class="good">',
        "**3** good ones",
        "</div>",
        "</div>",
        "### Of words",
        "|  | a\\|b |\n| --- | --- |\n| row | 1 \\| 2 |",
        "| name | A | speed, joint 1 | 2 |\n| --- | ---: | ---: | ---: |\n| x | – | 1.5 | 2.5 |",
        "![A picture](a.svg)",
        "![Another](b.png)",
        "<details><summary>More &amp; more</summary>",
        "inside",
        "</details>",
        "[Load it](device.html)",
        "<details><summary>✓ yes · I_eff &lt; 1 · Table 1</summary>",
        "why",
        "</details>",
    ]


def test_blocks_become_a_page(folder):
    page = REPORT.page(folder)
    for part in (
        "<title>Title</title>",
        "<header><h1>Title</h1>\n<p>lead</p>\n<button",
        "<p>One <strong>bold</strong>, <em>slanted</em>, <code>c_o*d*e</code> of K_IS</p>",
        '<a href="#section-1">Main</a>\n</nav>',
        '<section id="section-1"><h2>Main</h2>',
        '<div class="tiles">\n<div class="good">\n<p><strong>3</strong> good ones</p>\n</div>',
        '<h3>Of words</h3>\n<div class="scroll" tabindex="0"><table>',
        '<th scope="row">row</th>\n<td>1 | 2</td>',
        '<th scope="row">x</th>\n<td style="text-align:right">–</td>',
        '<div class="canvas scroll" tabindex="0"><img alt="Another" src="data:image/svg+xml;',
        base64.b64encode(SVG.encode()).decode(),
        "<details><summary>More &amp; more</summary>\n<p>inside</p>\n</details>",
        '<button type="button" hidden>Load it (0.0 MB',
        '<details data-verdict="yes"><summary class="row"><span data-name="claim"><span>I_eff &lt;',
        '<span data-name="verdict"><span class="good">✓ yes</span></span></summary>\n<p>why</p>\n',
    ):
        assert part in page, part
    assert "<p></p>" not in page and "uPlot" not in page
    two = Report("t", [], [doc.Section("One", []), doc.Section("Two", [])]).page(folder)
    assert '<a href="#section-1">One</a>' in two and '<section id="section-2"><h2>Two</h2>' in two


# --- what is not ours -------------------------------------------------------------------------


def places(x):
    """A report with a text wherever reports have names: of robots, joints, files, inputs."""
    blocks = [
        x,
        doc.said("last {}", x),
        doc.said("**{}:** *{}* {}, {}.", x, x, x, x),
        doc.bullets([x, doc.code(x), doc.said("{:code}", x)]),
        doc.said("> {}", x),
        doc.Table([x, "n"], [[x, x]], x),
        doc.tiles([(1, x, "good")]),
        doc.Picture("a.svg", x),
        doc.Page("device.html", x),
        doc.details(x, doc.fenced(x)),
        doc.joined([x, x]),
        doc.Rows([x, x], [doc.Row([x, x], [x], x, "good")]),
    ]
    return Report(x, [x, doc.said("{} first", x)], [doc.Section(x, blocks)])


EVIL = [
    "a|b", "<script>alert(1)</script>", "[x](javascript:alert(1))", "![x](http://y.z/p.png)", "`",
    "```", "\n\n# x", "\r\n", "{{ 7 * 7 }}", "{% raw %}", "<https://x.y>", "[x]: http://y", "]",
    "[[x]](y)", "&lt;", "</details>", '<div class="bad">', "*x*", "__x__", "\\", "- x", "1. x", "(",
    "> x", "=", "---", "~~~", "#", "$x$", "x [rad/s]", "<!-- x", " ", "\t", "    x", "\u2028", "\0",
    "&", ":",
]  # fmt: skip


@cache
def placed(text, folder):
    """Tags of a page, and its texts between them without spaces, with a text in all PLACES."""
    read = Tags(places(text).page(folder))
    return [tag for tag, _ in read.tags], "".join(read.text.split())


FREE = ("code", "wbr")
"""Tags that depend on the text: code with a ` is none, and long names may break at _ and dots."""


@given(st.lists(st.sampled_from(EVIL) | st.text(max_size=5), min_size=1).map("".join))
@example("<script>alert(1)</script>|[x](javascript:alert(1))`![x](http://y.z/p.png)\n{{ 7 }}")
@example("x\n```\n# [y]: z\n1. - | `a` \\| __b__ &amp; </details>")
@settings(deadline=None, database=None, max_examples=50)
def test_foreign_text_is_escaped_in_documents(folder, text):
    """No tag, link, picture or block more than a word in its place makes, and no letter less."""
    shown = "".join(text.replace("\0", "\ufffd").split())
    if not shown:
        return
    tags, words = placed("Qyx", folder)
    code = [tag for tag in tags if tag not in FREE]
    found, said = placed(text, folder)
    assert [tag for tag in found if tag not in FREE] == code
    assert said == words.replace("Qyx", shown)


def test_html_in_data_is_off_on_pages(folder):
    """The second barrier: a report that marked a text as ours by mistake."""
    text = '<b onload="x">a</b> <script>y</script>\n\n<iframe src="z">\n\n<div style="x">'
    page = Report("t", [], [doc.Section("s", [doc.Marked(text)])]).page(folder)
    tags = Tags(page).tags
    assert {"b", "iframe", "div"}.isdisjoint(tag for tag, _ in tags)
    assert page.count("</script>") == 1


def test_plot_data_cannot_end_a_script(folder):
    plots = Plots([[Panel("</script><b>", "x", "y", np.zeros(1), [])]])
    page = Report("t", [], [doc.Section("s", [doc.Picture("p.png", "c", plots)])]).page(folder)
    assert page.count("</script>") == 2 and "<b>" not in page and "uPlot" in page


# --- in a browser ----------------------------------------------------------------------------

CONTRAST = (Path(__file__).parents[1] / "helpers" / "contrast.js").read_text(encoding="utf-8")
WIDTH = "document.documentElement.scrollWidth"
GROUND = "getComputedStyle(document.body).backgroundColor"


@pytest.fixture(scope="module")
def page(reproduced, tmp_path_factory):
    """The report with a small recording; do not change it."""
    folder = tmp_path_factory.mktemp("report")
    for path in [*reproduced.glob("*.svg"), *reproduced.glob("*.json")]:
        (folder / path.name).symlink_to(path)
    (folder / "diagrams").symlink_to(DIAGRAMS)  # those reproduced are not drawn
    (folder / "device.html").write_text(HELLO, encoding="utf-8")
    return write_report(folder)


def test_page_loads_nothing_from_elsewhere(page):
    text = page.read_text(encoding="utf-8")
    tags = Tags(text).tags
    for tag, attributes in tags:
        for key in ("src", "href", "srcset", "data"):
            assert attributes.get(key, "#")[:1] == "#" or attributes[key].startswith("data:"), tag
    assert "@import" not in text and "url(http" not in text
    ids = [a["id"] for _, a in tags if "id" in a]
    assert len(ids) == len(set(ids))
    links = [a["href"].removeprefix("#") for tag, a in tags if tag == "a"]
    assert len(links) > 8 and set(links) <= set(ids)


def test_page_filter_theme_and_recording_work_without_errors(open_page, page):
    with open_page(page) as (tab, errors, requests):
        shown = tab.locator(".rows details:visible")
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
        # Figures are drawn, by themselves; those of the paper's runs have zoom.
        sizes = tab.locator("figure img").evaluate_all("all => all.map(i => i.naturalWidth)")
        assert len(sizes) >= 6 and min(sizes) > 100
        ends = [plot.split()[-1] for plot in tab.locator(".plots h4").all_inner_texts() if plot]
        assert ends.count("yaw") == 3 + 1 + 1 + 1  # Figure 2 has three for each joint

        assert tab.locator("iframe").count() == 0
        tab.locator(".recording button").click()
        assert tab.frame_locator("iframe").locator("#hello").inner_text().startswith('"')
        assert errors == [] and requests == []


def test_page_has_contrast_in_both_themes_any_width_and_print(open_page, page):
    with open_page(page, width=1280) as (tab, errors, _):
        light = tab.evaluate(GROUND)
        for dark in (False, True):
            ratio, element = tab.evaluate(CONTRAST)
            assert ratio >= 4.5, element  # WCAG 2 AA
            assert (min(map(int, re.findall(r"\d+", tab.evaluate(GROUND)))) < 128) == dark
            shown = tab.locator(".canvas").first.screenshot()
            ground = np.asarray(Image.open(io.BytesIO(shown)).convert("L"), dtype=float)
            assert (np.median(ground) < 128) == dark and np.ptp(ground) > 150
            tab.locator("#theme").click()
        assert tab.evaluate(GROUND) == light
        for width in (320, 375, 768):
            tab.set_viewport_size({"width": width, "height": 800})
            assert tab.evaluate(WIDTH) == width
        claims = tab.locator(".rows details").count()
        tab.locator(".filter button").nth(1).click()
        tab.locator("#theme").click()
        tab.set_viewport_size({"width": 703, "height": 800})  # A4 less margins, at 96 dpi
        tab.emulate_media(media="print")
        assert tab.locator(".rows details:visible").count() == claims
        assert tab.locator(".rows details > table, .rows details p:visible").count() == 0
        tab.evaluate("dispatchEvent(new Event('beforeprint'))")  # every reason is printed
        assert tab.locator(".rows details > p:visible").count() >= claims
        assert tab.locator("button:visible, nav:visible, .recording:visible").count() == 0
        assert tab.evaluate(WIDTH) == 703  # no table or figure is cut
        cut = "all => all.filter(e => e.scrollWidth > e.clientWidth + 1).length"
        assert tab.locator(".scroll").evaluate_all(cut) == 0
        assert tab.evaluate("getComputedStyle(document.body).color") == "rgb(27, 34, 41)"
        assert errors == []


def test_page_without_scripts_lacks_only_buttons(open_page, page):
    with open_page(page, javascript=False, dark=True) as (tab, errors, _):
        assert tab.locator(".rows details:visible").count() > 20
        assert tab.locator("button:visible").count() == 0
        assert max(map(int, re.findall(r"\d+", tab.evaluate(GROUND)))) < 128
        assert errors == []
