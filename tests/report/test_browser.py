"""The page in a real browser: headless Chromium, from disk."""

import io
import re
import shutil

import left_out
import pytest
from PIL import Image
from playwright import sync_api as playwright

from surgsim.report.write import write_report

CHROMIUM = next(filter(None, map(shutil.which, left_out.BROWSERS)), None)
pytestmark = pytest.mark.needs("chromium")

ARGUMENTS = ["--no-sandbox", "--disable-gpu", "--disable-background-networking"]
CONTRAST = """() => {
  const paint = document.createElement("canvas").getContext("2d", { willReadFrequently: true });
  const rgb = (colour) => {
    paint.clearRect(0, 0, 1, 1);
    paint.fillStyle = colour;
    paint.fillRect(0, 0, 1, 1);
    return [...paint.getImageData(0, 0, 1, 1).data];
  };
  const light = (c) => {
    const linear = (x) => x <= 0.03928 ? x / 12.92 : ((x + 0.055) / 1.055) ** 2.4;
    const [r, g, b] = c.map((x) => linear(x / 255));
    return 0.2126 * r + 0.7152 * g + 0.0722 * b;
  };
  const ratio = (a, b) => {
    const [x, y] = [light(a), light(b)].sort((p, q) => q - p);
    return (x + 0.05) / (y + 0.05);
  };
  const behind = (element) => {
    for (let e = element; e; e = e.parentElement) {
      const c = rgb(getComputedStyle(e).backgroundColor);
      if (c[3] === 255) return c;
    }
    return [255, 255, 255, 255];
  };
  const found = { text: {}, shape: {} };
  const texts = "p, th, td, a, small, h1, h2, h3, li, dt, dd, button, figcaption, text, summary";
  for (const e of document.querySelectorAll(texts)) {
    const style = getComputedStyle(e);
    const ink = e instanceof SVGElement ? style.fill : style.color;
    const r = ratio(rgb(ink), behind(e));
    found.text[`${e.tagName} ${ink}`] = Math.min(r, found.text[`${e.tagName} ${ink}`] ?? 99);
  }
  for (const e of document.querySelectorAll("path.line, path.median, path.fill")) {
    const style = getComputedStyle(e);
    const ink = e.classList.contains("fill") ? style.fill : style.stroke;
    found.shape[ink] = ratio(rgb(ink), behind(e));
  }
  return found;
}"""

OPEN_ALL = "document.querySelectorAll('details').forEach(d => d.open = true)"
CUT_OFF = """() => [...document.querySelectorAll('.scroll')]
  .filter(box => box.scrollWidth > box.clientWidth)
  .map(box => `${box.ariaLabel}: ${box.scrollWidth} of ${box.clientWidth}`)"""


@pytest.fixture(scope="module")
def browser():
    with playwright.sync_playwright() as runner:
        browser = runner.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
        yield browser
        browser.close()


@pytest.fixture(scope="module", params=[False, True], ids=["plain", "awkward"])
def address(request, made_results):
    return write_report(made_results(awkward=request.param)).resolve().as_uri()


@pytest.fixture
def open_page(browser):
    """Opens the page in a fresh profile; whatever the browser complains about or asks for fails the test."""
    contexts, complaints, asked = [], [], []

    def open_it(address, **settings):
        context = browser.new_context(**settings)
        contexts.append(context)
        page = context.new_page()
        page.on("console", lambda message: complaints.append(message.text))
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.on("dialog", lambda dialog: (complaints.append(dialog.message), dialog.dismiss()))
        page.on("request", lambda request: asked.append(request.url))
        page.goto(address)
        return page

    yield open_it
    for context in contexts:
        context.close()
    assert complaints == []
    assert len([url for url in asked if not url.startswith("data:")]) == len(contexts)  # the page alone


def column(page, name, board=".main"):
    """Numbers of a column of the leaderboard, from top to bottom; None where there is none."""
    button = page.locator(f'button[data-name="{name}"]')
    index = button.evaluate("button => button.parentElement.cellIndex")
    table = page.locator(f"{board} table").filter(has=button)
    cells = table.locator(f"tbody tr > :nth-child({index + 1})")
    return [float(v) if v else None for v in cells.evaluate_all("cells => cells.map(c => c.dataset.value)")]


@pytest.mark.parametrize(("name", "best_first"), [("tip_error_rms_mm", min), ("manipulability_mean", max)])
def test_pressing_a_heading_sorts_best_first_and_again_worst_first(open_page, address, name, best_first):
    page = open_page(address)
    heading = page.locator(f'.main button[data-name="{name}"]')
    heading.click()
    first = column(page, name)
    assert first == sorted(first, reverse=best_first is max)
    assert len(set(first)) == 4
    heading.click()
    assert column(page, name) == first[::-1]
    sorts = page.locator(".main th[aria-sort]").evaluate_all("all => all.map(th => th.ariaSort)")
    assert sorted(sorts)[:1] == ["ascending" if best_first is max else "descending"]
    assert sorts.count("none") == len(sorts) - 1


def test_the_keyboard_sorts_too_and_what_has_no_value_stays_last(open_page, address):
    page = open_page(address)
    page.locator("#leaderboard summary").click()
    button = page.locator('.all button[data-name="convergence_time_s"]')
    for key in ("Enter", "Space"):
        button.focus()
        page.keyboard.press(key)
        values = column(page, "convergence_time_s", ".all")
        assert values[-1] is None
        assert values[:-1] == sorted(values[:-1], reverse=key == "Space")
    assert page.locator("#sorted").inner_text() == "Sorted by time to converge [s], descending."


def test_names_sort_as_text(open_page, address):
    page = open_page(address)
    page.locator('.main button[data-name="controller"]').click()
    names = page.locator(".main tbody th").all_inner_texts()
    assert len(names) == 4
    assert names == page.evaluate("names => [...names].sort((a, b) => a.localeCompare(b))", names)


@pytest.mark.parametrize("width", [320, 390, 1280])
def test_nothing_overflows_sideways(open_page, address, width):
    page = open_page(address, viewport={"width": width, "height": 844})
    page.evaluate(OPEN_ALL)
    assert page.evaluate("document.documentElement.scrollWidth") == width
    wide = page.locator("main > section").evaluate_all("all => all.map(s => s.getBoundingClientRect().right)")
    assert max(wide) <= width
    board = page.locator(".main").evaluate("box => [box.scrollWidth, box.clientWidth]")
    assert (board[0] > board[1]) == (width < 1000)  # on a phone the table scrolls inside its box


@pytest.fixture(scope="module")
def wide_address(wide_results):
    return write_report(wide_results).resolve().as_uri()


@pytest.mark.parametrize("width", [1280, 1600])
def test_no_table_is_cut_off_on_a_desktop(open_page, wide_address, width):
    page = open_page(wide_address, viewport={"width": width, "height": 900})
    page.evaluate(OPEN_ALL)
    assert page.evaluate("document.documentElement.scrollWidth") == width
    assert page.locator(".board").count() > 5
    assert page.evaluate(CUT_OFF) == []


def test_no_table_is_cut_off_on_paper(open_page, wide_address):
    between_margins = 687  # of A4 with 14 mm on both sides
    page = open_page(wide_address, viewport={"width": between_margins, "height": 900})
    page.emulate_media(media="print")
    page.evaluate(OPEN_ALL)
    assert page.evaluate("document.documentElement.scrollWidth") == between_margins
    rights = page.locator("table").evaluate_all("all => all.map(t => t.getBoundingClientRect().right)")
    assert len(rights) > 20
    assert max(rights) <= between_margins
    # A browser prints the headings of a table again on the next sheet, but leaves out what buttons paint.
    shown = page.locator(".board button").evaluate_all("all => all.map(b => getComputedStyle(b).display)")
    assert set(shown) == {"contents"}
    assert not page.locator("#leaderboard .printed").is_visible()  # it would deny what stands above it


def test_a_shade_tells_that_a_table_goes_on(open_page, wide_address):
    page = open_page(wide_address, viewport={"width": 390, "height": 844})
    page.evaluate(OPEN_ALL)
    box = page.locator(".board").first
    assert box.evaluate("box => box.scrollWidth > box.clientWidth")

    def darkness():
        """Of the right edge, of a line just above the bottom that no text reaches."""
        shot = Image.open(io.BytesIO(box.screenshot())).convert("L")
        return 255 - shot.getpixel((shot.width - 3, shot.height - 12))

    assert darkness() > 30
    box.evaluate("box => box.scrollLeft = box.scrollWidth")
    assert darkness() < 5


def test_text_in_figures_can_be_read_on_a_phone(open_page, address):
    page = open_page(address, viewport={"width": 390, "height": 844})
    sizes = page.locator("figure svg").evaluate_all(
        "all => all.filter(s => s.checkVisibility()).map(s => 11 * s.getBoundingClientRect().width / 360)"
    )
    assert min(sizes) > 9.5


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_contrast(open_page, address, scheme):
    page = open_page(address, color_scheme=scheme)
    background = page.evaluate("getComputedStyle(document.body).backgroundColor")
    assert (sum(map(int, re.findall(r"\d+", background))) < 150) == (scheme == "dark")
    found = page.evaluate(CONTRAST)
    assert len(found["text"]) >= 15
    assert {name: ratio for name, ratio in found["text"].items() if ratio < 4.5} == {}
    assert len(found["shape"]) >= 4
    assert {name: ratio for name, ratio in found["shape"].items() if ratio < 3.0} == {}


def test_print_is_dark_on_white_even_from_dark_mode(open_page, address):
    page = open_page(address, color_scheme="dark")
    page.emulate_media(media="print")
    assert page.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(255, 255, 255)"
    assert page.evaluate("getComputedStyle(document.body).color") == "rgb(0, 0, 0)"
    assert not page.locator("nav").is_visible()
    assert page.pdf(format="A4")[:5] == b"%PDF-"


def test_links_to_recordings_are_folded_in_the_list_of_runs(open_page, address):
    page = open_page(address)
    link = page.locator("#runs a", has_text="recording").first
    assert not link.is_visible()
    page.locator("#runs summary").click()
    assert link.is_visible()
    assert link.evaluate("a => a.protocol") == "file:"


def test_what_is_read_first_is_above_the_fold_and_the_rest_is_folded(open_page, address):
    page = open_page(address, viewport={"width": 1280, "height": 900})
    lead, picture = page.locator("header .lead"), page.locator("header img")
    assert lead.inner_text().startswith(("rcm_inverse_dynamics wins", "javascript:alert(1) wins"))
    for seen in (lead, picture, page.locator(".failing")):
        box = seen.bounding_box()
        assert box["y"] + box["height"] < 900
    assert picture.evaluate("image => image.complete && image.naturalWidth > 0")
    assert page.evaluate("document.documentElement.scrollHeight") < 6000
    assert page.locator("details[open]").count() == 0


def test_a_link_to_something_folded_unfolds_it(open_page, address):
    page = open_page(f"{address}#scenario-1")
    assert page.locator("#scenario-1").evaluate("fold => fold.open")
    page.evaluate("location.hash = 'scenario-0'")
    page.wait_for_function("document.getElementById('scenario-0').open")


def test_paper_shows_what_matters_and_no_more(open_page, address):
    page = open_page(address)
    page.evaluate("dispatchEvent(new Event('beforeprint'))")
    unfolded = page.locator("details[open] > summary").all_inner_texts()
    assert [text.split(" [")[0] for text in unfolded] == [
        "Every pair by RCM error, RMS",
        "How the figures are made",
        "What the metrics mean, and which differences matter",
    ]
    page.evaluate("dispatchEvent(new Event('afterprint'))")
    assert page.locator("details[open]").count() == 0
    page.emulate_media(media="print")
    assert page.locator("#methods h3").first.is_visible()  # without the script's help
