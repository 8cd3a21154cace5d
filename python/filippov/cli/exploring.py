"""`filippov app`: the interactive page of a model in the browser."""

from __future__ import annotations

import argparse
import webbrowser
from pathlib import Path
from typing import Any

from filippov.cli.mistakes import Mistake, assignments, hint, number
from filippov.cli.model import Model, load_model
from filippov.cli.solving import add_model_options, initial_state, interval

__all__ = ["add_app_options", "app"]

_FIRST_MODEL = "dry_friction"


def add_app_options(command: argparse.ArgumentParser) -> None:
    """Add the arguments of `filippov app`."""
    add_model_options(command, default=_FIRST_MODEL)
    command.add_argument("--t", nargs="+", metavar="T", help="end, or start and end; 0 20 by default")
    how = command.add_argument_group("how it is solved")
    how.add_argument("--rtol", metavar="TOL", help="relative tolerance, 1e-6 by default")
    how.add_argument("--atol", metavar="TOL", help="absolute tolerance, 1e-9 by default")
    how.add_argument("--method", metavar="NAME", help='"auto" (default), "Taylor", "DOPRI5", "Rodas5P", ...')
    where = command.add_argument_group("where it is shown")
    where.add_argument("--port", metavar="N", help="the port; a free one by default")
    where.add_argument("--no-browser", action="store_true", help="print the address, open no browser")


def app(given: argparse.Namespace) -> int:
    """Serve the page of a model until Ctrl-C."""
    # A part of the package that no other command needs.
    from filippov.app.page import make_page
    from filippov.app.server import Server

    model = load_model(given.model, given.system)
    options: dict[str, Any] = {} if given.method is None else {"method": given.method}
    for name in ("rtol", "atol"):
        if getattr(given, name) is not None:
            options[name] = number(getattr(given, name), f"--{name}")
    has_span = given.t is not None or model.t_span is not None
    page = make_page(
        model.system,
        initial_state(given, model),
        interval(given, model) if has_span else None,
        _values_and_ranges(given, model),
        title=_title(given.model, model),
        **options,
    )
    if not Path(given.model).exists():
        page = page._replace(reference=model.name)
    server = Server(page, _port(given.port))
    try:
        print(f"{page.title}: {server.url}", flush=True)
        why = page.why_it_stays()
        if why:
            print(f"computed by this process: {why}", flush=True)
        print("Ctrl-C ends it.", flush=True)
        if not given.no_browser and not webbrowser.open(server.url):
            print("no browser was found: open the address yourself", flush=True)
        server.serve()
    except KeyboardInterrupt:
        print()
    finally:
        server.close()
    return 0


def _title(text: str, model: Model) -> str:
    return model.name.replace("_", " ") if not text.endswith(".py") else model.name


def _port(text: str | None) -> int:
    if text is None:
        return 0
    if not (text.isascii() and text.isdigit() and int(text) <= 65535):
        raise Mistake(f"--port: a number from 0 to 65535 is needed, not {text!r}")
    return int(text)


def _values_and_ranges(given: argparse.Namespace, model: Model) -> dict[str, Any]:
    """Return what ``--param`` says: ``F=0.4`` a value, ``F=0:2`` the range of a slider."""
    known = model.system.params
    found: dict[str, Any] = {}
    for name, text in assignments(given.param, "--param").items():
        if name not in known:
            all_known = f"the parameters are {', '.join(known)}" if known else "it has none"
            raise Mistake(f"--param: {model.name} has no parameter {name!r}{hint(name, known)}; {all_known}")
        ends = [number(part, f"--param {name}") for part in text.split(":")]
        if len(ends) > 2 or (len(ends) == 2 and not ends[0] < ends[1]):
            raise Mistake(f"--param {name}: a number, or LOW:HIGH, is needed, not {text!r}")
        found[name] = ends[0] if len(ends) == 1 else tuple(ends)
    return found
