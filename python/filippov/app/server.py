"""The page in a browser: a server for this computer alone, from the standard library.

It listens on 127.0.0.1, gives out the files of one folder, the model it was made for and the reference
problems, and answers requests about that model to who has its token. It writes no file and executes nothing
that it is sent.
"""

from __future__ import annotations

import hmac
import json
import secrets
import sys
import threading
from functools import cached_property
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple
from urllib.parse import urlsplit

from filippov import problems
from filippov.app.engine import Engine
from filippov.app.files import ENGINE, front, static_folder
from filippov.app.page import Page, make_page, problem_rows
from filippov.errors import FilippovError, InputError

__all__ = ["MOST_BYTES", "TOKEN_HEADER", "Server"]

TOKEN_HEADER = "X-Filippov-Token"
MOST_BYTES = 1 << 20  # of a request
_HOST = "127.0.0.1"
_SECONDS_TO_SEND = 30.0
_KINDS = {
    ".html": "text/html; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".wasm": "application/wasm",
    ".svg": "image/svg+xml",
}
_BYTES, _JSON = "application/octet-stream", "application/json"
# A page may load from this server alone; workers are made of the script itself.
_POLICY = (
    "default-src 'none'; script-src 'self' 'wasm-unsafe-eval'; worker-src 'self' blob:; connect-src 'self'; "
    "style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'"
)


class Server:
    """Serves a page to this computer.

    Parameters
    ----------
    page : Page
    port : int, optional
        0, the default, takes one that is free.
    folder : path, optional
        The built files; by default those of the package.

    Attributes
    ----------
    token : str
        What a request must show, random for every server.

    Raises
    ------
    InputError
        If the port is none.
    NotBuilt
        If the page was not built.
    OSError
        If the port is taken.

    Notes
    -----
    Refused are names of the host other than ``127.0.0.1`` and ``localhost`` (a page elsewhere whose name
    leads here), origins other than this server, requests without the token, and bodies of more than a
    megabyte. Files are given out by their names in a list made at the start, so no path leads elsewhere.
    """

    def __init__(self, page: Page, port: int = 0, folder: Path | None = None) -> None:
        front(folder)
        self.engine = Engine(page)
        self.token = secrets.token_urlsafe(24)
        self.files = _files(static_folder() if folder is None else folder)
        self._http = _Http((_HOST, _checked_port(port)), _handler_for(self))
        self._thread: threading.Thread | None = None

    @property
    def port(self) -> int:
        """The port."""
        return int(self._http.server_address[1])

    @property
    def origin(self) -> str:
        """The address without the token."""
        return f"http://{_HOST}:{self.port}"

    @property
    def url(self) -> str:
        """The address to open. The token stands behind the #, which browsers do not send."""
        return f"{self.origin}/#token={self.token}"

    @cached_property
    def hosts(self) -> frozenset[str]:
        """Names under which this computer calls the server."""
        return frozenset(f"{name}:{self.port}" for name in (_HOST, "localhost"))

    def serve(self) -> None:
        """Serve until `close` is called, or until Ctrl-C."""
        self._http.serve_forever(poll_interval=0.1)

    def start(self) -> None:
        """Serve in a thread of its own."""
        self._thread = threading.Thread(target=self.serve, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop serving."""
        if self._thread is not None:
            self._http.shutdown()
            self._thread.join()
            self._thread = None
        self._http.server_close()

    def __enter__(self) -> Server:
        self.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


class _Http(ThreadingHTTPServer):
    daemon_threads = True

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Ignore a connection that the browser closed; print every other error."""
        if not isinstance(sys.exc_info()[1], ConnectionError):
            super().handle_error(request, client_address)


class _Answer(NamedTuple):
    status: HTTPStatus
    body: bytes = b""
    kind: str = "text/plain; charset=utf-8"
    allow: str = ""


def _refused(status: HTTPStatus, sentence: str) -> _Answer:
    return _Answer(status, sentence.encode())


def _files(folder: Path) -> dict[str, Path]:
    """Return the served files by the path in their address."""
    found = {f"/{path.name}": path for path in folder.iterdir() if path.is_file() and path.suffix in _KINDS}
    if "/index.html" in found:
        found["/"] = found["/index.html"]
    return found


def _model_of(name: str) -> bytes | None:
    """Return the model of a reference problem; None if there is none of that name, or it stays in Python."""
    if name not in problems.names():
        return None
    try:
        return make_page(name).to_bytes()
    except FilippovError:
        return None


def _handler_for(server: Server) -> type[BaseHTTPRequestHandler]:
    class Handler(_Handler):
        owner = server

    return Handler


class _Handler(BaseHTTPRequestHandler):
    owner: Server
    server_version = "filippov"
    sys_version = ""
    protocol_version = "HTTP/1.1"
    timeout = _SECONDS_TO_SEND

    def do_GET(self) -> None:
        self._send(self._refusal() or self._get(urlsplit(self.path).path))

    def do_HEAD(self) -> None:
        self.do_GET()

    def do_POST(self) -> None:
        self._send(self._refusal() or self._post(urlsplit(self.path).path))

    def _get(self, path: str) -> _Answer:
        if path in self.owner.files:
            file = self.owner.files[path]
            return _Answer(HTTPStatus.OK, file.read_bytes(), _KINDS[file.suffix])
        if path == "/model":
            refusal = self._without_token()
            if refusal is not None:
                return refusal
            model = self.owner.engine.model
            return _Answer(HTTPStatus.OK, model, _BYTES) if model else _Answer(HTTPStatus.NO_CONTENT)
        if path == "/models/index.json":
            return _Answer(HTTPStatus.OK, json.dumps(problem_rows(problems.names())).encode(), _JSON)
        if path.startswith("/models/") and path.endswith(".flp"):
            model_of_problem = _model_of(path.removeprefix("/models/").removesuffix(".flp"))
            if model_of_problem is not None:
                return _Answer(HTTPStatus.OK, model_of_problem, _BYTES)
        if path == "/ask":
            return _Answer(HTTPStatus.METHOD_NOT_ALLOWED, b"POST is needed here.", allow="POST")
        missing = "" if path != f"/{ENGINE}" else ": it was not built, the kernel computes"
        return _refused(HTTPStatus.NOT_FOUND, f"There is no such file{missing}.")

    def _post(self, path: str) -> _Answer:
        if path != "/ask":
            return _Answer(HTTPStatus.METHOD_NOT_ALLOWED, b"Only /ask takes requests.", allow="GET, HEAD")
        refusal = self._without_token()
        if refusal is not None:
            return refusal
        if self.headers.get_content_type() != _JSON:
            return _refused(HTTPStatus.UNSUPPORTED_MEDIA_TYPE, "The content type must be application/json.")
        length = self._length()
        if length is None:
            return _refused(HTTPStatus.LENGTH_REQUIRED, "The request must say its length.")
        if length > MOST_BYTES:
            return _refused(HTTPStatus.REQUEST_ENTITY_TOO_LARGE, f"A request has at most {MOST_BYTES} bytes.")
        return _Answer(HTTPStatus.OK, self.owner.engine.answer(self.rfile.read(length)), _BYTES)

    def _length(self) -> int | None:
        if "Transfer-Encoding" in self.headers:
            return None
        text = self.headers.get("Content-Length", "")
        return int(text) if text.isascii() and text.isdigit() and len(text) < 16 else None

    def _refusal(self) -> _Answer | None:
        """Return the refusal of a request that does not come from this computer's page; None if it does."""
        hosts = self.owner.hosts
        host = self.headers.get_all("Host") or []
        if len(host) != 1 or host[0] not in hosts:
            return _refused(HTTPStatus.FORBIDDEN, f"This server answers as {_HOST}:{self.owner.port} only.")
        origin = self.headers.get("Origin")
        if origin is not None and origin != f"http://{host[0]}":
            return _refused(HTTPStatus.FORBIDDEN, "Pages of other servers may not ask here.")
        site = self.headers.get("Sec-Fetch-Site", "none")
        is_link = self.command in ("GET", "HEAD") and self.headers.get("Sec-Fetch-Mode") == "navigate"
        if site not in ("same-origin", "none") and not is_link:
            return _refused(HTTPStatus.FORBIDDEN, "Pages of other servers may not ask here.")
        return None

    def _without_token(self) -> _Answer | None:
        given = self.headers.get(TOKEN_HEADER, "").encode("latin-1", "replace")
        if hmac.compare_digest(given, self.owner.token.encode()):
            return None
        return _refused(
            HTTPStatus.FORBIDDEN,
            "The token is missing or wrong: open the address that `filippov app` has printed.",
        )

    def _send(self, answer: _Answer) -> None:
        is_refused = answer.status >= HTTPStatus.BAD_REQUEST
        if is_refused and (self._length() or 0) <= MOST_BYTES:
            self.rfile.read(self._length() or 0)  # else the answer may be lost with what was not read
        self.send_response(answer.status)
        headers = {
            "Content-Type": answer.kind,
            "Content-Length": str(len(answer.body)),
            "Content-Security-Policy": _POLICY,
            "X-Content-Type-Options": "nosniff",
            "Referrer-Policy": "no-referrer",
            "Cross-Origin-Resource-Policy": "same-origin",
            "Cross-Origin-Opener-Policy": "same-origin",
            "Cache-Control": "no-store",
        }
        if answer.allow:
            headers["Allow"] = answer.allow
        if is_refused:
            headers["Connection"] = "close"
        if answer.status == HTTPStatus.NO_CONTENT:
            del headers["Content-Type"], headers["Content-Length"]
        for name, value in headers.items():
            self.send_header(name, value)
        self.end_headers()
        if self.command != "HEAD":
            self.wfile.write(answer.body)

    def log_message(self, format: str, *args: Any) -> None:
        """Print nothing: the terminal shows the address alone."""


def _checked_port(port: int) -> int:
    if isinstance(port, bool) or not isinstance(port, int) or not 0 <= port <= 65535:
        raise InputError(f"port: a number from 0 to 65535 is needed, not {port!r}")
    return port
