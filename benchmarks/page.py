"""The page in headless Chromium: from a slider to the picture, a diagram of a million points, sizes.

Usage: ``python benchmarks/page.py``. It needs the built page (`make app`), Playwright and Chromium, and
prints milliseconds of the browser's clock: medians, and the 95th percentile. What the screen takes to show a
frame is not among them.
"""

from __future__ import annotations

import gzip
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests"))
from app.static_site import CHROMIUM, FLAGS, STATIC, served, what_is_missing

REPEATS = 200

# An input event of the first slider, until both pictures are drawn; and the drawing of both alone.
_SLIDE = """async repeats => {
  const { front } = document.querySelector("#app");
  const slider = document.querySelector("input[type=range]");
  const [low, high] = [Number(slider.min), Number(slider.max)];
  const [whole, drawing] = [[], []];
  const wait = () => new Promise(go => setTimeout(go, 15));
  for (let k = 0; k < repeats; k++) {
    slider.value = String(low + (0.2 + 0.6 * k / repeats) * (high - low));
    const a = performance.now();
    slider.dispatchEvent(new Event("input"));
    await front.motion.latest.settled();
    const b = performance.now();
    front.motion.portrait?.draw();
    front.motion.series.draw();
    const c = performance.now();
    whole.push(c - a);
    drawing.push(c - b);
    await front.settled();
    await wait();
  }
  return { whole, drawing, points: front.run.t.length, steps: front.run.steps };
}"""

_DIAGRAM = """async n => {
  const { front } = document.querySelector("#app");
  const panel = front.panels.get("diagram");
  panel.job.stop();
  await panel.settled();
  const x = Float64Array.from({ length: n }, () => 1.2 * Math.random());
  const y = x.map(v => Math.sin(7 * v) + v * Math.random());
  panel.points.clear();
  panel.points.add(x, y);
  const times = [];
  for (let k = 0; k < 15; k++) {
    const a = performance.now();
    panel.picture.draw();
    times.push(performance.now() - a);
  }
  return times;
}"""


def line(what: str, times: list[float]) -> None:
    print(f"{what:56s} median {np.median(times):7.2f} ms, 95 % {np.quantile(times, 0.95):7.2f} ms")


def measure(page: Any, address: str, name: str) -> None:
    page.goto(f"{address}#p={name}")
    page.reload()
    page.evaluate(
        "(async () => { while (!document.querySelector('#app').front) await new Promise(setTimeout); })()"
    )
    page.evaluate(_SLIDE, 30)  # the engine is compiled while it runs
    found = page.evaluate(_SLIDE, REPEATS)
    line(f"{name}: slider to picture, {found['steps']} steps, {found['points']} points", found["whole"])
    line(f"{name}: of this drawing", found["drawing"])


def main() -> int:
    missing = what_is_missing() or ("" if CHROMIUM else "there is no chromium")
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        missing = missing or "playwright is not installed"
    if missing:
        print(f"left out: {missing}")
        return 0
    with (
        tempfile.TemporaryDirectory() as folder,
        served(Path(folder)) as address,
        sync_playwright() as playwright,
    ):
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=list(FLAGS))
        page = browser.new_page(viewport={"width": 1400, "height": 900})
        for name in ("dry_friction", "dry_friction_attractor_III", "welander", "friction_chain"):
            measure(page, address, name)
        page.goto(f"{address}#p=dry_friction")
        page.reload()
        page.evaluate(
            "(async () => { while (!document.querySelector('#app').front) await new Promise(setTimeout); })()"
        )
        page.get_by_role("tab", name="Diagram").click()
        line("a diagram of 10^6 points drawn again", page.evaluate(_DIAGRAM, 1_000_000))
        browser.close()
    for name in ("app.js", "filippov.wasm"):
        data = (STATIC / name).read_bytes()
        print(f"{name:56s} {len(data) / 1e6:7.3f} MB, {len(gzip.compress(data, 9)) / 1e6:7.3f} MB gzipped")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
