"""The page in a browser: what a hand, a key and a link do to it, and what it writes."""

from __future__ import annotations

import base64
import csv
import io
import json
import os
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
import zlib
from pathlib import Path
from typing import Any

import filippov as fl
import numpy as np
import pytest
from filippov.app import make_page, write_script

from app.conftest import front, settle, wait_until
from app.static_site import STATIC, model_bytes, packed

AXE = Path(__file__).resolve().parents[2] / "web" / "node_modules" / "axe-core" / "axe.min.js"

# The share of pixels of a canvas that differ from its corner.
_DRAWN = """canvas => {
  const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
  let n = 0;
  for (let k = 0; k < data.length; k += 4)
    n += data[k] !== data[0] || data[k + 1] !== data[1] || data[k + 2] !== data[2];
  return n / (data.length / 4);
}"""


# The switches of the run on the screen, and where it ends.
_SUMMARY = """() => {
  const { switches, t, y, n } = document.querySelector("#app").front.run;
  return { kinds: switches.map(s => [s.kind, s.from, s.to]), t: t.at(-1), y: [...y.slice(-n)] };
}"""


def drawn(page: Any, picture: str) -> float:
    """Return the share of a picture that is not ground."""
    return float(page.locator(f".picture.{picture} canvas").evaluate(_DRAWN))


def place(page: Any, value: tuple[float, float]) -> dict[str, float]:
    """Return the place of a state in the portrait, in the pixels of its canvas."""
    return dict(
        page.evaluate(
            """value => { const { frame } = document.querySelector("#app").front.motion;
            return { x: frame.x.at(value[0]), y: frame.y.at(value[1]) }; }""",
            list(value),
        )
    )


def box(page: Any) -> list[float]:
    window = front(page, "motion.window()")
    return [*window["x"], *window["y"]]


def show(page: Any, tab: str) -> None:
    page.get_by_role("tab", name=tab).click()
    settle(page)


def saved(page: Any, row: str, kind: str) -> bytes:
    """Return the file that an entry of the menu writes."""
    page.get_by_text("Save", exact=True).click()
    entry = page.locator(".file").filter(has=page.get_by_text(row, exact=True))
    with page.expect_download() as download:
        entry.get_by_role("button", name=kind).click()
    return Path(download.value.path()).read_bytes()


@pytest.mark.parametrize(
    "name", ["dry_friction", "bouncing_ball", "dieci_lopez_4_4", "biased_relay", "friction_chain"]
)
def test_nothing_is_blank(open_page: Any, name: str) -> None:
    page = open_page(f"#p={name}")
    for picture in ["portrait", "series"] if front(page, "model.n") > 1 else ["series"]:
        assert drawn(page, picture) > 0.01, picture
        assert "switch" in page.locator(f".picture.{picture} canvas").get_attribute("aria-label")
    assert page.locator(".status").inner_text() != ""
    show(page, "Poincaré section")
    assert drawn(page, "section") > 0.001 or page.locator(".section .words").inner_text() != ""


def test_every_problem_gives_the_native_switches_and_states(open_page: Any) -> None:
    page = open_page("#p=dry_friction")
    names = page.evaluate("[...document.querySelector('header select').options].map(option => option.value)")
    assert len(names) > 20
    for name in names:
        page.evaluate(
            "name => { document.querySelector('#app').front = null; location.hash = `p=${name}` }", name
        )
        wait_until(page, f"document.querySelector('#app').front?.host.problem === {name!r}")
        settle(page)
        run = page.evaluate(_SUMMARY)
        problem = fl.problems.get(name)
        native = problem.solve(rtol=1e-6, atol=1e-9)
        kinds = [[s.kind, str(s.mode_before), str(s.mode_after)] for s in native.switches]
        assert run["kinds"] == kinds, name
        assert run["t"] == pytest.approx(native.t[-1], rel=1e-12), name
        np.testing.assert_allclose(run["y"], native.y[:, -1], rtol=1e-8, atol=1e-11, err_msg=name)


def test_dragging_a_slider_holds_the_axes_and_computes_the_last_value(open_page: Any) -> None:
    page = open_page()
    before, ended = box(page), front(page, "run.y.at(-1)")
    slider = page.get_by_role("slider", name="parameter F")
    rect = slider.bounding_box()
    y = rect["y"] + rect["height"] / 2
    page.mouse.move(rect["x"] + rect["width"] * 0.34, y)
    page.mouse.down()
    for share in np.linspace(0.34, 0.9, 30):
        page.mouse.move(rect["x"] + rect["width"] * share, y)
    settle(page)
    assert box(page) == before
    page.mouse.up()
    settle(page)
    value = front(page, "state.params.F")
    assert value == pytest.approx(1.08, abs=0.05)
    assert front(page, "run.y.at(-1)") != ended
    native = (
        fl.problems.get("dry_friction")
        .system()
        .solve((0, 188.49555921538757), [1, 2], {"F": value}, rtol=1e-6, atol=1e-9)
    )
    assert len(native.switches) == front(page, "run.switches.length")


def test_the_newest_request_wins(open_page: Any) -> None:
    page = open_page()
    runs = page.evaluate(
        """async () => {
          const root = document.querySelector("#app");
          let runs = 0;
          root.addEventListener("filippov:ran", () => runs++);
          const slider = document.querySelector("input[type=range]");
          for (let k = 1; k <= 200; k++) {
            slider.value = String(0.004 * k);
            slider.dispatchEvent(new Event("input"));
          }
          await root.front.settled();
          return runs;
        }"""
    )
    assert 1 <= runs <= 3
    assert front(page, "state.params.F") == pytest.approx(0.8, abs=0.01)


def test_a_click_starts_a_trajectory_there_and_moves_the_sliders(open_page: Any) -> None:
    page = open_page()
    before = box(page)
    page.locator(".portrait canvas").click(position=place(page, (0.5, -0.5)))
    settle(page)
    assert front(page, "state.y0") == pytest.approx([0.5, -0.5], abs=0.01)
    assert front(page, "run.y.slice(0, 2)") == front(page, "state.y0")
    fields = page.locator(".quantity").filter(has=page.get_by_role("slider", name="initial value"))
    assert [float(fields.nth(k).get_by_role("textbox").input_value()) for k in (0, 1)] == pytest.approx(
        front(page, "state.y0"), abs=1e-5
    )
    assert box(page) == before


def test_keys_do_what_a_hand_does(open_page: Any) -> None:
    page = open_page()
    portrait = page.locator(".portrait canvas")
    portrait.focus()
    window = box(page)
    page.keyboard.press("ArrowRight")
    page.keyboard.press("Shift+ArrowDown")
    settle(page)
    step = 0.01 * (window[1] - window[0]), 0.1 * (window[3] - window[2])
    assert front(page, "state.y0") == pytest.approx([1 + step[0], 2 - step[1]], abs=0.006)
    page.keyboard.press("+")
    assert box(page)[1] - box(page)[0] == pytest.approx((window[1] - window[0]) / 1.25)
    page.keyboard.press("f")
    settle(page)
    assert front(page, "state.box") is None
    page.keyboard.press("k")
    settle(page)
    assert len(front(page, "state.kept")) == 1
    page.get_by_role("slider", name="parameter F").focus()
    page.keyboard.press("ArrowRight")
    settle(page)
    assert front(page, "state.params.F") > 0.4
    page.get_by_role("tab", name="Switches").focus()
    page.keyboard.press("ArrowRight")
    assert page.get_by_role("tab", name="Poincaré section").get_attribute("aria-selected") == "true"
    series = page.locator(".series canvas")
    series.focus()
    page.keyboard.press("ArrowRight")
    assert "mode" in page.locator(".reading").inner_text()


def test_a_number_is_typed_as_people_write_it(open_page: Any) -> None:
    page = open_page()
    field = page.get_by_label("ω", exact=True)
    field.fill("2/3")
    field.press("Enter")
    settle(page)
    assert front(page, "state.params.omega") == 2 / 3
    field.fill("two")
    assert field.get_attribute("aria-invalid") is not None
    assert front(page, "state.params.omega") == 2 / 3


@pytest.mark.parametrize("by_name", [True, False])
def test_a_link_brings_back_the_model_and_the_view(open_page: Any, by_name: bool) -> None:
    page = open_page("#p=dry_friction")
    if not by_name:
        page.evaluate("Object.assign(document.querySelector('#app').front.host, { problem: null })")
    page.get_by_label("F", exact=True).fill("0.123")
    page.locator(".portrait canvas").click(position=place(page, (-0.25, 1.0)))
    page.get_by_role("button", name="Keep").click()
    page.get_by_role("button", name="Copy link").click()
    settle(page)
    show(page, "Poincaré section")
    fragment = front(page, "fragment()")
    assert fragment.startswith("#p=dry_friction&s=" if by_name else "#m=")
    assert len(fragment) < 1500
    other = open_page(fragment)
    assert front(other, "state") == front(page, "state")
    assert front(other, "run.switches") == front(page, "run.switches")
    assert page.evaluate("location.hash").startswith(fragment[:9])


@pytest.mark.parametrize(
    ("fragment", "words"),
    [
        ("#m=AAAA", "model cannot be read"),
        ("#m=AwA", "not a file of filippov"),
        ("#p=no_such_problem", "no model"),
        ("#p=../../secret", "no model"),
        (
            "#p=dry_friction&s=" + packed(b'{"y0": [1, 2, 3]}'),
            "a start needs 2 numbers, for y, v; there are 3",
        ),
        ("#m=" + packed(model_bytes("dry_friction", y0=[1, 2, 3])), "PAGE.y0: 2 numbers are needed"),
    ],
)
def test_a_link_that_is_no_good_is_answered_in_words(open_page: Any, fragment: str, words: str) -> None:
    page = open_page(fragment, wait=False)
    assert words in page.locator(".complaint").inner_text()


def test_what_a_link_carries_is_text_and_no_code(open_page: Any) -> None:
    code = "<img src=x onerror='window.wasRun = 1'><script>window.wasRun = 1</script>"
    model = model_bytes("dry_friction", title=code, text=code, reference=code)
    view = json.dumps({"method": "auto", "section": {"by": "surface", "surface": code}, "parameter": code})
    page = open_page(f"#m={packed(model)}&s={packed(view.encode())}")
    show(page, "Model")
    assert page.locator("textarea").input_value() == code
    assert page.locator("#app img, #app script").count() == 0
    assert page.evaluate("window.wasRun") is None


def test_a_page_without_its_engine_says_so(open_page: Any) -> None:
    script = """const get = window.fetch;
    window.fetch = (a, ...b) => String(a).endsWith(".wasm") ? Promise.reject(new Error()) : get(a, ...b);"""
    page = open_page(script=script, wait=False)
    assert "filippov.wasm is missing" in page.locator(".complaint").inner_text()


def test_a_run_that_fails_is_told_where_the_picture_would_be(open_page: Any) -> None:
    page = open_page()
    page.evaluate("document.querySelector('#app').front.state.method = 'no such method'")
    page.get_by_role("slider", name="parameter F").press("ArrowRight")
    settle(page)
    assert "method" in page.locator(".portrait .words").inner_text()
    assert "method" in page.locator(".series .words").inner_text()
    assert page.locator(".switches tbody tr").count() == 0, "the switches of the run before are gone"
    page.get_by_role("group").filter(has_text="Accuracy").locator("summary").click()
    for method in page.locator("select[aria-label=method] option").all_inner_texts():
        if method != "no such method":
            page.get_by_label("method", exact=True).last.select_option(method)
            settle(page)
            assert front(page, "run.switches.length") > 30, method


def test_the_page_works_without_workers(open_page: Any) -> None:
    page = open_page(
        script="delete window.Worker; window.Worker = class { constructor() { throw new Error('no') } };"
    )
    assert front(page, "run.switches.length") == 42
    show(page, "Poincaré section")
    assert drawn(page, "section") > 0.001


def test_the_diagram_grows_is_stopped_and_is_refined_by_a_rectangle(open_page: Any) -> None:
    page = open_page("#p=dry_friction_attractor_I")
    page.get_by_role("tab", name="Diagram").click()
    wait_until(page, "document.querySelector('#app').front.panels.get('diagram').points.length > 0")
    page.get_by_role("button", name="Stop").click()
    settle(page)
    done = front(page, "panels.get('diagram').done")
    total = front(page, "panels.get('diagram').total")
    assert 0 < done < total
    page.evaluate("Object.assign(document.querySelector('#app').front.state, { skip: 5, count: 5 })")
    page.get_by_role("button", name="Draw again").click()
    settle(page)
    assert front(page, "panels.get('diagram').points.length") == total * 5
    assert drawn(page, "diagram") > 0.002
    canvas = page.locator(".diagram canvas")
    canvas.scroll_into_view_if_needed()
    rect = canvas.bounding_box()
    page.mouse.move(rect["x"] + 0.4 * rect["width"], rect["y"] + 0.3 * rect["height"])
    page.mouse.down()
    page.mouse.move(rect["x"] + 0.6 * rect["width"], rect["y"] + 0.8 * rect["height"], steps=5)
    page.mouse.up()
    settle(page)
    low, high = front(page, "state.range")
    assert 0.3 < low < high < 0.9
    assert min(front(page, "panels.get('diagram').points.x.slice()")) >= low - 1e-9
    page.get_by_role("button", name="Zoom out").click()
    settle(page)
    assert front(page, "state.range") == pytest.approx([0, 1.2])


def test_the_basins_are_drawn_and_a_click_starts_there(open_page: Any) -> None:
    page = open_page("#p=dieci_lopez_4_4")
    page.get_by_role("tab", name="Basins").click()
    page.get_by_label("cells each way").fill("16")
    page.get_by_label("cells each way").press("Enter")
    settle(page)
    assert drawn(page, "basins") > 0.2
    assert "16 by 16 cells" in page.locator(".basins canvas").get_attribute("aria-label")
    before = front(page, "state.y0")
    page.locator(".basins canvas").click(position={"x": 300, "y": 150})
    settle(page)
    assert front(page, "state.y0") != before


def test_pictures_are_saved_as_they_are_seen(open_page: Any) -> None:
    page = open_page()
    png = saved(page, "phase portrait", "PNG")
    assert png[:8] == b"\x89PNG\r\n\x1a\n"
    assert len(png) > 10_000
    for row in ("phase portrait", "time series"):
        svg = saved(page, row, "SVG")
        root = ElementTree.fromstring(svg)
        paths = root.findall(".//{http://www.w3.org/2000/svg}path")
        assert len(paths) > 10
        assert b"#0072b2" in svg  # the colour of the mode +
        assert b"NaN" not in svg


def test_tables_are_saved_with_all_digits(open_page: Any) -> None:
    page = open_page()
    native = fl.problems.get("dry_friction").solve(rtol=1e-6, atol=1e-9)
    rows = list(csv.DictReader(io.StringIO(saved(page, "switches", "CSV").decode())))
    assert [row["kind"] for row in rows] == list(native.switches.kind)
    np.testing.assert_allclose([float(row["t"]) for row in rows], native.switches.t, rtol=1e-10)
    curve = list(csv.DictReader(io.StringIO(saved(page, "curve", "CSV").decode())))
    assert len(curve) == front(page, "run.t.length")
    assert {row["mode"] for row in curve} == {"+", "-", "0"}


def test_the_script_repeats_the_run(open_page: Any, tmp_path: Path) -> None:
    page = open_page()
    page.get_by_label("F", exact=True).fill("0.15")
    settle(page)
    script = saved(page, "Python script", "py").decode()
    script += "import json\nprint('##', json.dumps([list(sol.switches.kind), sol.y[:, -1].tolist()]))\n"
    path = tmp_path / "run.py"
    path.write_text(script, encoding="utf-8")
    root = str(Path(fl.__file__).parent.parent)
    done = subprocess.run(
        [sys.executable, str(path)],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        env={**os.environ, "PYTHONPATH": root},
    )
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "picture.png").exists()
    kinds, end = json.loads(done.stdout.split("##")[1])
    assert kinds == front(page, "run.switches.map(s => s.kind)")
    np.testing.assert_allclose(end, front(page, "run.y.slice(-2)"), atol=1e-8)


TYPED = """
import numpy as np

def oscillator(t, x, F=0.4, omega=1/3):
    y, v = x
    return v, -y + np.sin(omega * t) - F * np.sign(v)
"""


@pytest.mark.parametrize("case", ["reference", "text", "bytes", "one state"])
def test_the_page_and_the_kernel_write_the_same_script(open_page: Any, case: str) -> None:
    names: dict[str, Any] = {}
    exec(TYPED, names)
    friction = fl.System(names["oscillator"], states=("y", "v"))
    ramp = fl.System(lambda t, x, a=1e-5: [a - np.sign(x[0])], n=1, states=("x",))
    shown = {
        "reference": make_page("dry_friction", params={"F": 0.7}, axes=(0, 1)),
        "text": make_page(friction, [1.0, -2e-7], (0, 40), text=TYPED, method="DOP853"),
        "bytes": make_page(friction, [1.0, 2e16], (0, 4), rtol=1e-8),
        "one state": make_page(ramp, [1 / 3]),
    }[case]
    link = base64.urlsafe_b64encode(zlib.compress(shown.to_bytes(), wbits=-15)).decode().rstrip("=")
    page = open_page(f"#m={link}")
    assert saved(page, "Python script", "py").decode() == write_script(shown)


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_a_screen_reader_and_weak_eyes_find_no_serious_fault(open_page: Any, scheme: str) -> None:
    if not AXE.exists():
        pytest.skip("axe-core is not installed: npm ci in web/")
    page = open_page(color_scheme=scheme, bypass_csp=True)
    for tab in ("Switches", "Poincaré section", "Model"):
        show(page, tab)
        page.add_script_tag(path=str(AXE))
        found = page.evaluate("axe.run(document, { resultTypes: ['violations'] })")
        serious = [
            (fault["id"], [node["html"][:120] for node in fault["nodes"]])
            for fault in found["violations"]
            if fault["impact"] in ("serious", "critical")
        ]
        assert serious == [], tab


def test_light_and_dark(open_page: Any) -> None:
    ground = "getComputedStyle(document.querySelector('#app')).backgroundColor"
    page = open_page(color_scheme="dark")
    assert page.evaluate(ground) == "rgb(22, 24, 29)"
    page.get_by_role("button", name="Light").click()
    settle(page)
    assert page.evaluate(ground) == "rgb(255, 255, 255)"
    page.emulate_media(color_scheme="dark")
    assert page.evaluate(ground) == "rgb(255, 255, 255)", "what was chosen by hand stays"


@pytest.mark.parametrize("name", ["dry_friction", "friction_chain"])
@pytest.mark.parametrize("width", [360, 768, 1200, 1400])
def test_the_page_fits_its_window_and_canvases_have_their_real_pixels(
    open_page: Any, width: int, name: str
) -> None:
    page = open_page(f"#p={name}", viewport={"width": width, "height": 844}, device_scale_factor=2)
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    sides = "f => [f.lastElementChild.getBoundingClientRect(), ...f.querySelectorAll('.tools > *')].map(e => "
    sides += "(e.getBoundingClientRect?.() ?? e).right)"
    for figure in page.locator("section.figure").all():
        edge, *tools = figure.evaluate(sides)
        assert max([0, *tools]) <= edge + 1, "what stands above a picture does not reach into the next one"
    for picture in ("portrait", "series"):
        size = page.locator(f".{picture} canvas").evaluate(
            "c => [c.width, c.clientWidth, c.height, c.clientHeight]"
        )
        assert size[0] == 2 * size[1]
        assert size[2] == 2 * size[3]
    page.set_viewport_size({"width": width - 60, "height": 844})
    settle(page)
    width_now, shown = page.locator(".portrait canvas").evaluate("c => [c.width, c.clientWidth]")
    assert width_now == 2 * shown


def test_the_built_files_are_of_the_size_that_is_promised() -> None:
    if not (STATIC / "app.js").exists():
        pytest.skip("the page was not built")
    assert (STATIC / "app.js").stat().st_size < 150_000
    assert b"http://" not in (STATIC / "app.js").read_bytes().replace(b"http://www.w3.org/2000/svg", b"")


def test_the_model_in_a_link_is_small(site: str) -> None:
    assert len(model_bytes("dry_friction")) < 1000


def test_a_field_that_depends_on_time_is_that_of_the_marked_instant(open_page: Any) -> None:
    page = open_page("#p=dry_friction")
    assert front(page, "motion.plane.instant") == 0
    ends = "motion.plane.points.slice()"
    before = front(page, ends)
    page.locator(".series canvas").hover(position={"x": 300, "y": 100})
    settle(page)
    assert front(page, "motion.plane.instant") > 50
    assert front(page, ends) != before, "where the surface attracts has moved"
    page.mouse.move(5, 5)
    settle(page)
    assert front(page, "motion.plane.instant") == 0
    assert front(page, ends) == before


def test_a_model_is_typed_in_the_page(open_page: Any) -> None:
    if not (STATIC / "filippov_text.wasm").exists():
        pytest.skip("the reader of Python text was not built: filippov_text.wasm is missing")
    page = open_page("#p=biased_relay")
    page.get_by_role("tab", name="Model").click()
    page.get_by_text("no Python runs").wait_for()
    area = page.get_by_label("the right-hand side in Python")
    page.get_by_text("This model has come without a text").wait_for()
    area.fill("def f(t, x):\n    y, v = x\n    while v:\n        v = 0\n    return v, -y\n")
    page.get_by_role("button", name="Use this text").click()
    page.locator(".editor .wrong").wait_for()
    assert page.locator(".editor .wrong").inner_text().startswith("Line 3")
    text = "import numpy as np\n\ndef drum(t, x, k=2.0):\n    y, v = x\n    return v, -k * y - np.sign(v)\n"
    area.fill(text)
    area.press("Control+Enter")
    wait_until(page, "document.querySelector('#app').front?.model.n === 2")
    settle(page)
    assert front(page, "model.params") == [{"name": "k", "value": 2}]
    assert front(page, "run.switches.length") > 0
    assert page.get_by_role("tab", name="Model").get_attribute("aria-selected") == "true"
    assert area.input_value() == text
    other = open_page(front(page, "fragment()"))
    assert front(other, "run.switches") == front(page, "run.switches")


def empty_page(browser: Any, address: str, **options: Any) -> Any:
    page = browser.new_context(**options).new_page()
    page.goto(address)
    page.get_by_role("heading", name="Write a system").wait_for()
    return page


def test_a_page_without_a_model_takes_a_text(site: str, browser: Any) -> None:
    if not (STATIC / "filippov_text.wasm").exists():
        pytest.skip("the reader of Python text was not built: filippov_text.wasm is missing")
    page = empty_page(browser, site + "index.html")
    text = page.get_by_label("The right-hand side in Python").input_value()
    page.get_by_text("no Python runs").wait_for()
    page.get_by_role("button", name="Use this text").click()
    wait_until(page, "document.querySelector('#app').front")
    settle(page)
    assert front(page, "model.page.text") == text
    names: dict[str, Any] = {}
    exec(text, names)
    native = fl.System(names["oscillator"], n=2).solve(names["t_span"], names["y0"], rtol=1e-6, atol=1e-9)
    assert front(page, "run.switches.map(s => s.kind)") == native.switches.kind.tolist()
    page.reload()
    wait_until(page, "document.querySelector('#app').front")
    assert front(page, "model.page.text") == text, "the address holds the model"
    page.go_back()
    page.get_by_role("heading", name="Write a system").wait_for()
    page.context.close()


def test_a_page_without_a_model_opens_reference_problems(site: str, browser: Any) -> None:
    page = empty_page(browser, site)
    rows = page.locator(".problems dt").all_inner_texts()
    assert "welander" in rows
    assert fl.problems.get("welander").note in page.locator(".problems").inner_text()
    page.get_by_role("button", name="welander").click()
    wait_until(page, "document.querySelector('#app').front")
    assert front(page, "model.states") == ["T", "S"]
    page.get_by_role("link", name="filippov").click()
    page.get_by_role("heading", name="Write a system").wait_for()
    page.context.close()


def test_a_page_without_a_model_and_a_reader_says_so(site: str, browser: Any) -> None:
    context = browser.new_context(viewport={"width": 390, "height": 844})
    page = context.new_page()
    page.route("**/filippov_text.wasm", lambda route: route.abort())
    page.goto(site)
    page.get_by_text("This page has no reader of Python text").wait_for()
    assert not page.get_by_role("button", name="Use this text").is_visible()
    assert page.locator(".problems dt").count() > 10
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    context.close()


def test_a_diagram_over_a_reciprocal(open_page: Any) -> None:
    """Fig. 4(a) of Piiroinen and Kuznetsov (2008): v once in each period over 1/omega."""
    page = open_page()
    page.get_by_role("tab", name="Diagram").click()
    fields = page.locator(".places")
    fields.get_by_label("points", exact=True).fill("2")
    fields.get_by_role("combobox", name="parameter").select_option("1/omega")
    fields.get_by_label("to", exact=True).fill("7")
    fields.get_by_label("to", exact=True).press("Enter")
    fields.get_by_role("combobox", name="state").select_option("1")
    settle(page)
    assert front(page, "state.range") == pytest.approx([1 / 0.3, 1 / 7])
    x = np.array(front(page, "panels.get('diagram').points.x.slice()"))
    assert (x.min(), x.max()) == pytest.approx((0.3, 7))
    assert np.allclose(np.diff(np.unique(x.round(9))), 6.7 / (len(np.unique(x.round(9))) - 1))
    words = fields.get_by_role("status").all_inner_texts()
    assert any("outside of the picture" in line for line in words), "the resonance at 1"
    fields.get_by_label("from", exact=True).fill("0")
    fields.get_by_label("from", exact=True).press("Enter")
    assert front(page, "state.range[0]") == pytest.approx(1 / 0.3), "0 has no reciprocal"
    canvas = page.locator(".diagram canvas")
    size = canvas.bounding_box()
    canvas.click(position={"x": size["width"] / 2, "y": size["height"] / 2})
    settle(page)
    assert 1 / front(page, "state.params.omega") == pytest.approx(3.65, abs=0.2), "what stands there"


def _to_a_wall(t: float, state: Any, omega: float = 1.5) -> Any:
    x, v = state
    return [v, -x - 0.1 * v + np.cos(omega * t)]


def test_a_diagram_that_carries_its_state_stays_on_its_branch_until_it_grazes(open_page: Any) -> None:
    wall = fl.Reset(lambda t, y: 1.0 - y[0], lambda t, y: [y[0], -0.8 * y[1]], direction="down")
    system = fl.System(_to_a_wall, resets=wall, n=2)
    model = make_page(system, y0=[0.0, 0.0], t_span=(0, 60)).to_bytes()
    view = {
        "section": {"by": "forcing", "frequency": "omega", "phase": 0},
        "parameter": "omega",
        "carry": True,
    }
    view |= {"range": [1.7, 1.35], "skip": 60, "count": 1, "place": "diagram"}
    page = open_page(f"#m={packed(bytes(model))}&s={packed(json.dumps(view).encode())}")
    settle(page)
    omega, x = (np.array(front(page, f"panels.get('diagram').points.{name}.slice()")) for name in "xy")
    order = np.argsort(-omega)
    jump = int(np.argmax(np.abs(np.diff(x[order]))))
    # The amplitude of the motion without impacts is 1 there: (1 - omega^2)^2 + (0.1 omega)^2 = 1.
    before, after = omega[order][jump : jump + 2]
    assert after < np.sqrt(1.99) < before + 1e-3
    assert before - after < 1e-3


def test_a_page_without_the_reader_shows_the_text_and_says_so(open_page: Any) -> None:
    script = """const get = window.fetch;
    window.fetch = (a, ...b) => String(a).includes("_text") ? Promise.reject(new Error()) : get(a, ...b);"""
    page = open_page(script=script)
    page.get_by_role("tab", name="Model").click()
    page.get_by_text("no reader of Python text").wait_for()
    assert not page.get_by_role("button", name="Use this text").is_visible()
