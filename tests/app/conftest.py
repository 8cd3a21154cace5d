"""A browser, the built page, and a server for both. Tests that are skipped name what is missing."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import pytest

from app.static_site import CHROMIUM, FLAGS, served, what_is_missing

SECONDS = 60.0  # a net for what hangs


@pytest.fixture(scope="session")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """The address of a static site with the built page and all problems."""
    missing = what_is_missing()
    if missing:
        pytest.skip(missing)
    with served(tmp_path_factory.mktemp("site")) as address:
        yield address


@pytest.fixture(scope="session")
def browser() -> Iterator[Any]:
    sync_api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    if CHROMIUM is None:
        pytest.skip("there is no chromium")
    with sync_api.sync_playwright() as playwright:
        started = playwright.chromium.launch(executable_path=CHROMIUM, args=list(FLAGS))
        yield started
        started.close()


Opener = Callable[..., Any]


@pytest.fixture
def open_page(site: str, browser: Any) -> Iterator[Opener]:
    """A function that opens the page at a fragment, and waits until all of it is drawn.

    At the end no page may have reported an error, and none may have asked another origin for anything.
    """
    contexts, faults, addresses = [], [], []

    def open_at(
        fragment: str = "#p=dry_friction", *, script: str = "", wait: bool = True, **options: Any
    ) -> Any:
        options.setdefault("viewport", {"width": 1400, "height": 900})
        context = browser.new_context(accept_downloads=True, **options)
        contexts.append(context)
        context.set_default_timeout(1000 * SECONDS)
        page = context.new_page()
        page.on("pageerror", lambda error: faults.append(str(error)))
        page.on("request", lambda request: addresses.append(request.url))
        if script:
            page.add_init_script(script)
        page.goto(site + fragment)
        wait_until(page, "document.querySelector('#app').front || document.querySelector('.complaint')")
        if wait:
            settle(page)
        return page

    yield open_at
    for context in contexts:
        context.close()
    assert faults == []
    elsewhere = [a for a in addresses if not a.startswith((site, "blob:" + site.rstrip("/"), "data:"))]
    assert elsewhere == []


def wait_until(page: Any, condition: str) -> None:
    """Wait until a condition holds; the policy of the page forbids what Playwright would do for it."""
    page.evaluate(
        f"(async () => {{ while (!({condition})) await new Promise(go => setTimeout(go, 15)); }})()"
    )


def settle(page: Any) -> None:
    """Wait until nothing is computed or drawn any more."""
    page.evaluate("document.querySelector('#app').front.settled()")


def front(page: Any, expression: str) -> Any:
    """Return the value of an expression of the front: ``front(page, "run.switches.length")``."""
    return page.evaluate(f"document.querySelector('#app').front.{expression}")
