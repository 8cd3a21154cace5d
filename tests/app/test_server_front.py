"""The front at a local server, which the test plays: what it asks of the kernel, what it computes itself."""

from __future__ import annotations

import json
import math
import struct
from collections.abc import Callable
from typing import Any

import filippov as fl
import numpy as np
import pytest

from app.conftest import front, settle, wait_until
from app.static_site import model_bytes

KINDS = [
    "describe",
    "run",
    "section",
    "diagram",
    "portrait",
    "basins",
    "sample",
    "cycle",
    "continuation",
    "script",
]


def reply(header: dict[str, Any], **arrays: Any) -> bytes:
    """Return a reply as bytes."""
    places, blocks, place = {}, [], 0
    for name, values in arrays.items():
        block = np.ascontiguousarray(values, dtype="<f8")
        places[name] = [place, list(block.shape)]
        place += block.size
        blocks.append(block.tobytes())
    text = json.dumps({"ok": True, **header, "arrays": places}).encode()
    head = struct.pack("<I", len(text)) + text
    return head + bytes(-len(head) % 8) + b"".join(blocks)


def describe() -> bytes:
    problem = fl.problems.get("dry_friction")
    page = {"title": "played", "y0": problem.y0, "t_span": problem.t_span}
    params = [{"name": name, "value": value} for name, value in problem.system().params.items()]
    header = {
        "kind": "describe",
        "n": 2,
        "states": ["y", "v"],
        "params": params,
        "surfaces": ["v"],
        "page": page,
    }
    return reply({**header, "kinds": KINDS})


def run(request: dict[str, Any], **more: Any) -> bytes:
    """Return a circle in one mode, as a run."""
    t = np.linspace(0.0, 2.0 * math.pi, 50)
    header = {
        "kind": request["kind"],
        "success": True,
        "message": "played",
        "pieces": [{"mode": "+", "first": 0, "last": 49, "kind": "region"}],
        "switches": [],
        **more,
    }
    return reply(header, t=t, y=np.column_stack([np.cos(t), np.sin(t)]))


def branch(request: dict[str, Any]) -> bytes:
    value = np.linspace(*request["range"], 20)
    y = np.column_stack([value, -value])
    special = [{"index": 10, "value": value[10], "code": "LP", "text": "a fold"}]
    header = {
        "kind": "continuation",
        "parameter": request["parameter"],
        "text": "20 points.",
        "special": special,
    }
    return reply(header, value=value, y=y, low=-y, high=y, stable=np.r_[np.ones(10), np.zeros(10)])


ANSWERS: dict[str, Callable[[dict[str, Any]], bytes]] = {
    "describe": lambda _: describe(),
    "run": run,
    "cycle": lambda request: run(
        request, period=2 * math.pi, multipliers=[[0.5, 0.25]], text="A cycle, played."
    ),
    "continuation": branch,
    "script": lambda request: reply({"kind": "script", "text": f"# F = {request['params']['F']}\n"}),
}


@pytest.fixture
def at_server(site: str, browser: Any) -> Any:
    """A function that opens the page at a server with a model, and returns the page and what was asked."""
    contexts = []

    def open_at(model: bytes | None, token: str = "right") -> tuple[Any, list[dict[str, Any]]]:
        context = browser.new_context(viewport={"width": 1400, "height": 900}, accept_downloads=True)
        contexts.append(context)
        page, asked = context.new_page(), []

        def refuse(route: Any) -> bool:
            if route.request.headers.get("x-filippov-token") == "right":
                return False
            route.fulfill(status=403, body="The token is missing or wrong.", content_type="text/plain")
            return True

        def give(route: Any) -> None:
            if not refuse(route):
                route.fulfill(status=200 if model else 204, body=model or b"")

        def ask(route: Any) -> None:
            if refuse(route):
                return
            request = route.request.post_data_json
            asked.append(request)
            answer = ANSWERS.get(request["kind"])
            unknown = {"ok": False, "error": f"{request['kind']}: not played", "code": "kind"}
            route.fulfill(status=200, body=answer(request) if answer else reply(unknown))

        page.route("**/model", give)
        page.route("**/ask", ask)
        page.goto(f"{site}#token={token}")
        wait_until(page, "document.querySelector('#app').front || document.querySelector('.complaint')")
        return page, asked

    yield open_at
    for context in contexts:
        context.close()


def test_a_traced_model_is_computed_in_the_page(at_server: Any) -> None:
    page, asked = at_server(model_bytes("dry_friction"))
    settle(page)
    assert front(page, "run.switches.length") == 42
    assert [request["kind"] for request in asked] == ["describe"]


def test_a_black_box_is_computed_by_the_kernel(at_server: Any) -> None:
    page, asked = at_server(None)
    settle(page)
    assert front(page, "run.t.length") == 50
    assert {"describe", "run", "portrait"} == {request["kind"] for request in asked}
    assert page.get_by_text("portrait: not played").count() == 1, "what is missing is said"
    page.get_by_role("slider", name="parameter F").press("ArrowRight")
    settle(page)
    assert [request for request in asked if request["kind"] == "run"][-1]["params"]["F"] > 0.4


def test_cycles_and_branches_come_from_the_kernel(at_server: Any) -> None:
    page, asked = at_server(model_bytes("dry_friction"))
    settle(page)
    page.get_by_role("tab", name="Cycles").click()
    page.get_by_role("button", name="Find the cycle").click()
    page.get_by_text("A cycle, played.").wait_for()
    assert asked[-1]["y0"] == front(page, "run.y.slice(-2)"), "from the end of the run on the screen"
    assert asked[-1]["t0"] == front(page, "run.t.at(-1)")
    assert "0.5 + 0.25i" in page.locator(".places").inner_text()
    assert front(page, "motion.cycle.t.length") == 50
    page.get_by_role("button", name="Follow").click()
    page.get_by_text("20 points.").wait_for()
    settle(page)
    assert asked[-1]["parameter"] == "F"
    assert asked[-1]["y0"] == pytest.approx([1.0, 0.0])
    assert "LP at F" in page.locator(".branch canvas").get_attribute("aria-label")
    assert "section" not in asked[-2], "the kernel needs none for a cycle"
    row = page.locator(".special tr")
    assert row.inner_text().split("\t") == ["LP", f"F = {asked[-1]['range'][1] * 10 / 19:.8g}", "a fold"]
    row.get_by_role("button").click()
    settle(page)
    assert front(page, "state.params.F") == pytest.approx(asked[-1]["range"][1] * 10 / 19)
    assert front(page, "motion.cycle") is None, "it was that of other parameters"


def test_the_script_is_that_of_the_kernel(at_server: Any) -> None:
    page, _ = at_server(model_bytes("dry_friction"))
    settle(page)
    page.get_by_text("Save", exact=True).click()
    with page.expect_download() as download:
        page.locator(".file").filter(has=page.get_by_text("Python script")).get_by_role("button").click()
    with open(download.value.path(), encoding="utf-8") as file:
        assert file.read() == "# F = 0.4\n"


def test_a_wrong_token_is_told_in_the_words_of_the_server(at_server: Any) -> None:
    page, asked = at_server(None, token="wrong")
    assert page.locator(".complaint").inner_text() == "The token is missing or wrong."
    assert asked == []
