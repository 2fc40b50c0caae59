"""Documents as Markdown and as pages; the pages in a browser."""

from __future__ import annotations

import base64
import re
from html.parser import HTMLParser
from pathlib import Path

import pytest

from sdt_drake.analysis.claims import VERDICTS
from sdt_drake.io.errors import InputError
from sdt_drake.io.files import write_text
from sdt_drake.show import documents as doc
from sdt_drake.show.reports.paper import write_report
from sdt_drake.show.template import from_template

SVG = '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 1 1"/>'
EVIL = '</script><b onload="x">&'
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


@pytest.fixture
def document(tmp_path):
    (tmp_path / "a.svg").write_text(SVG, encoding="utf-8")
    (tmp_path / "b.svg").write_text(SVG, encoding="utf-8")
    (tmp_path / "b.png").touch()
    (tmp_path / "device.html").write_text(HELLO, encoding="utf-8")
    blocks = [
        doc.Text("One **bold**, *slanted*, `c_o*d*e` of K_IS"),
        doc.Heading("Within"),
        doc.Bullets(["first", "second"]),
        doc.Tiles([(3, "good ones", "good")]),
        doc.Table(["", "a|b"], [["row", "1"]], "Of words"),
        doc.Table(["name", "A", "speed"], [["x", "0", ["1.5", "2.5"]]]),
        doc.Figure("A picture", tmp_path / "a.svg", tmp_path),
        doc.Figure("Another", tmp_path / "b.svg", tmp_path, "wide"),
        doc.Details("More", [doc.Text("inside")]),
        doc.EmbeddedPage("Load it", tmp_path / "device.html"),
    ]
    return doc.Document("Title", "lead", [doc.Section("Main", blocks), doc.Section("Empty")])


def test_markdown(document):
    assert document.markdown().split("\n\n") == [
        "# Title",
        "lead",
        "## Main",
        "One **bold**, *slanted*, `c_o*d*e` of K_IS",
        "### Within",
        "- first\n- second",
        "**3** good ones.",
        "**Of words**",
        "|  | a\\|b |\n| --- | --- |\n| row | 1 |",
        "| name | A | speed |\n| --- | --- | --- |\n| x | 0 | 1.5 2.5 |",
        "![A picture](a.svg)",
        "![Another](b.png)",
        "<details><summary>More</summary>",
        "inside",
        "</details>",
        "[Load it](device.html)\n",
    ]


def test_html(document):
    page = document.html()
    for part in (
        "<title>Title</title>",
        "<p>One <b>bold</b>, <i>slanted</i>, <code>c_o*d*e</code> of K_IS</p>",
        '<a href="#section-1">Main</a></nav>',
        '<section id="section-1"><h2>Main</h2>',
        "<li>first</li><li>second</li>",
        '<li class="good"><strong>3</strong> good ones</li>',
        '<h3>Of words</h3><div class="scroll" tabindex="0"><table><thead><tr><td></td>',
        '<th class="first" colspan="2">speed, joint</th></tr><tr><th class="first">1</th>',
        '<td class="word">0</td><td class="first">1.5</td><td>2.5</td>',
        '<div class="canvas scroll wide" tabindex="0"><img alt="Another" src="data:image/svg+xml;',
        base64.b64encode(SVG.encode()).decode(),
        "<details><summary>More</summary><p>inside</p></details>",
    ):
        assert part in page, part
    assert "Empty" not in page
    document.symbols = True
    assert "<code>c_o*d*e</code> of K<sub>IS</sub>" in document.html()


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
    document = doc.Document("", sections=[doc.Section("s", [doc.Text(text)])], symbols=True)
    assert f"<p>{shown}</p>" in document.html()


def test_all_text_is_escaped(tmp_path):
    write_text(tmp_path / "a.svg", SVG)
    blocks = [
        doc.Text(EVIL), doc.Heading(EVIL), doc.Bullets([EVIL]), doc.Tiles([(1, EVIL, "")]),
        doc.Table([EVIL, EVIL], [[EVIL, [EVIL]]], EVIL), doc.Details(EVIL, []),
        doc.Text(f"`{EVIL}`"), doc.Figure(EVIL, tmp_path / "a.svg", tmp_path),
    ]  # fmt: skip
    page = doc.Document(EVIL, EVIL, [doc.Section(EVIL, blocks)]).html()
    assert EVIL not in page and "<b onload" not in page and page.count("</script>") == 1
    assert not [a for _, a in Tags(page).tags if "onload" in a]


def test_names_of_users_are_no_tags_and_links_in_markdown(tmp_path):
    name, shown = "<b>x</b> [a](http://b)", r"\<b>x\</b> \[a](http://b)"
    blocks = [
        doc.Text(name),
        doc.Heading(name),
        doc.Bullets([name]),
        doc.Table([name], [[name]], title=name),
        doc.Figure(name, tmp_path / "x.svg", tmp_path),
    ]
    page = doc.Document(name, name, [doc.Section(name, blocks)]).markdown()
    assert page.count(shown) == 10 and page.replace(shown, "").count("b>") == 0
    kept = "`<b>[a](b)` 1 < 2, tau [N m]"
    assert doc.Text(kept).markdown() == kept


def test_a_template_takes_blocks_and_numbers():
    parts = ["# T", "lead {x:.1f}", "## S", "a\nb {x:.2f}", "{table}", "### H", "![C](p.svg)"]
    parts += ["## E", "{no}"]
    text = "\n\n".join(parts) + "\n"
    blocks, folder = {"table": [doc.Text("t")], "no": []}, Path("there")
    document = from_template(text, blocks, {"x": 1.234}, folder)
    assert (document.title, document.lead) == ("T", "lead 1.2")
    first, second = document.sections
    figure = doc.Figure("C", folder / "p.svg", folder)
    said = [doc.Text("a b 1.23"), doc.Text("t"), doc.Heading("H"), figure]
    assert first == doc.Section("S", said)
    assert second == doc.Section("E", [])


def test_pictures_that_are_none_are_refused(tmp_path):
    for text, reason in ((None, "is missing"), ("<svg", "not an SVG"), ("<a/>", "not an SVG")):
        if text:
            write_text(tmp_path / "a.svg", text)
        figure = doc.Figure("A", tmp_path / "a.svg", tmp_path)
        with pytest.raises(InputError, match=rf"a\.svg: is .*{reason.removeprefix('is ')}"):
            figure.html(str)


# --- in a browser ----------------------------------------------------------------------------

CONTRAST = (Path(__file__).parents[1] / "contrast.js").read_text(encoding="utf-8")
WIDTH = "document.documentElement.scrollWidth"
GROUND = "getComputedStyle(document.body).backgroundColor"


@pytest.fixture(scope="module")
def page(reproduced, tmp_path_factory):
    """The report with a small recording; do not change it."""
    folder = tmp_path_factory.mktemp("report")
    (folder / "diagrams").mkdir()
    for path in [*reproduced.glob("*.svg"), *reproduced.glob("diagrams/*")]:
        (folder / path.relative_to(reproduced)).symlink_to(path)
    (folder / "summary.json").symlink_to(reproduced / "summary.json")
    (folder / "device.html").write_text(HELLO, encoding="utf-8")
    return write_report(folder)


def test_nothing_is_loaded_from_elsewhere(page):
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


def test_filter_theme_and_recording_work_without_complaint(open_page, page):
    with open_page(page) as (tab, errors, requests):
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
        # Figures are drawn, by themselves.
        sizes = tab.locator("figure img").evaluate_all("all => all.map(i => i.naturalWidth)")
        assert len(sizes) >= 6 and min(sizes) > 100

        assert tab.locator("iframe").count() == 0
        tab.locator(".recording button").click()
        assert tab.frame_locator("iframe").locator("#hello").inner_text().startswith('"')
        assert errors == [] and requests == []


def test_light_and_dark_on_any_width_and_on_paper(open_page, page):
    with open_page(page, width=1280) as (tab, errors, _):
        light = tab.evaluate(GROUND)
        for dark in (False, True):
            ratio, element = tab.evaluate(CONTRAST)
            assert ratio >= 4.5, element  # WCAG 2 AA
            assert (min(map(int, re.findall(r"\d+", tab.evaluate(GROUND)))) < 128) == dark
            canvas = tab.locator(".canvas").first
            colour = canvas.evaluate("e => getComputedStyle(e).backgroundColor")
            assert colour == "rgb(255, 255, 255)"
            tab.locator("#theme").click()
        assert tab.evaluate(GROUND) == light
        for width in (320, 375, 768):
            tab.set_viewport_size({"width": width, "height": 800})
            assert tab.evaluate(WIDTH) == width
        claims = tab.locator("article").count()
        tab.locator(".filter button").nth(1).click()
        tab.locator("#theme").click()
        tab.set_viewport_size({"width": 703, "height": 800})  # A4 less margins, at 96 dpi
        tab.emulate_media(media="print")
        assert tab.locator("article:visible").count() == claims
        assert tab.locator("button:visible, nav:visible, .recording:visible").count() == 0
        assert tab.evaluate(WIDTH) == 703  # no table or figure is cut
        cut = "all => all.filter(e => e.scrollWidth > e.clientWidth + 1).length"
        assert tab.locator(".scroll").evaluate_all(cut) == 0
        assert tab.evaluate("getComputedStyle(document.body).color") == "rgb(27, 34, 41)"
        assert errors == []


def test_without_scripts_all_is_there_but_buttons_and_dark_is_dark(open_page, page):
    with open_page(page, javascript=False, dark=True) as (tab, errors, _):
        assert tab.locator("article:visible").count() > 20
        assert tab.locator("button:visible").count() == 0
        assert max(map(int, re.findall(r"\d+", tab.evaluate(GROUND)))) < 128
        assert errors == []
