"""The local server answers this computer's page and nobody else, and gives out nothing but its own files."""

from __future__ import annotations

import http.client
import json
import signal
import socket
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import filippov as fl
import pytest
from command_line import COMMAND, ENVIRONMENT
from filippov.app import make_page
from filippov.app.files import NotBuilt
from filippov.app.reply import read_reply
from filippov.app.server import MOST_BYTES, TOKEN_HEADER, Server
from filippov.cli import main

SECRET = "not to be given out"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Built files, with a secret beside them and one of a kind that is not served among them."""
    outside = tmp_path_factory.mktemp("outside")
    (outside / "secret.js").write_text(SECRET)
    folder = outside / "static"
    folder.mkdir()
    (folder / "app.js").write_text("export const mount = 1;\n")
    (folder / "index.html").write_text("<!doctype html><title>page</title>")
    (folder / "filippov.wasm").write_bytes(b"\0asm")
    (folder / "notes.txt").write_text(SECRET)
    (folder / "more").mkdir()
    (folder / "more" / "inner.js").write_text(SECRET)
    return folder


@pytest.fixture(scope="module")
def server(folder: Path) -> Iterator[Server]:
    with Server(make_page("dry_friction"), folder=folder) as running:
        yield running


def ask(
    server: Server, method: str, path: str, body: bytes | None = None, **headers: str | None
) -> tuple[int, dict[str, str], bytes]:
    """Ask as the page does; a header that is None is left out."""
    given: dict[str, str | None] = {
        "Host": f"127.0.0.1:{server.port}",
        TOKEN_HEADER: server.token,
        "Content-Type": "application/json" if method == "POST" else None,
        **{name.replace("_", "-"): value for name, value in headers.items()},
    }
    connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=60)
    try:
        connection.putrequest(method, path, skip_host=True, skip_accept_encoding=True)
        for name, value in given.items():
            if value is not None:
                connection.putheader(name, value)
        if body is not None and "Content-Length" not in given:
            connection.putheader("Content-Length", str(len(body)))
        connection.endheaders(body)
        response = connection.getresponse()
        return response.status, dict(response.getheaders()), response.read()
    finally:
        connection.close()


RUN = json.dumps({"kind": "run", "params": {"F": 0.5}}).encode()


def test_the_page_gets_its_files_its_model_and_its_answers(server: Server) -> None:
    status, headers, body = ask(server, "GET", "/")
    assert (status, body) == (200, b"<!doctype html><title>page</title>")
    assert headers["Content-Type"] == "text/html; charset=utf-8"
    status, headers, body = ask(server, "GET", "/filippov.wasm")
    assert (status, headers["Content-Type"], body) == (200, "application/wasm", b"\0asm")
    status, _, body = ask(server, "GET", "/model")
    assert (status, body) == (200, make_page("dry_friction").to_bytes())
    status, _, body = ask(server, "POST", "/ask", RUN)
    problem = fl.problems.get("dry_friction")
    expected = problem.system().solve(problem.t_span, problem.y0, F=0.5)
    assert status == 200
    assert read_reply(body).header["end"] == expected.y[:, -1].tolist()


def test_several_pages_may_ask_at_once(server: Server) -> None:
    from concurrent.futures import ThreadPoolExecutor

    with ThreadPoolExecutor(8) as pool:
        found = list(pool.map(lambda _: ask(server, "POST", "/ask", RUN), range(32)))
    assert {status for status, _, _ in found} == {200}
    assert len({body for _, _, body in found}) == 1


@pytest.mark.parametrize(
    ("method", "path"), [("POST", "/ask"), ("GET", "/model"), ("HEAD", "/model")], ids=lambda value: value
)
@pytest.mark.parametrize("token", [None, "", "wrong", "é"])
def test_a_missing_or_wrong_token_is_refused(
    server: Server, method: str, path: str, token: str | None
) -> None:
    status, _, body = ask(server, method, path, RUN if method == "POST" else None, **{TOKEN_HEADER: token})
    assert status == 403
    if method != "HEAD":
        assert b"The token is missing or wrong" in body


@pytest.mark.parametrize("path", ["/", "/app.js", "/model", "/ask", "/models/index.json"])
@pytest.mark.parametrize(
    "headers",
    [
        {"Host": "evil.example"},
        {"Host": "evil.example:80"},
        {"Host": "127.0.0.1"},
        {"Host": None},
        {"Origin": "http://evil.example"},
        {"Origin": "null"},
        {"Origin": "http://127.0.0.1"},
        {"Origin": "https://127.0.0.1:{port}"},
        {"Sec_Fetch_Site": "cross-site"},
        {"Sec_Fetch_Site": "same-site"},
    ],
    ids=str,
)
def test_who_comes_from_elsewhere_is_refused_even_with_the_token(
    server: Server, path: str, headers: dict[str, str | None]
) -> None:
    method, body = ("POST", RUN) if path == "/ask" else ("GET", None)
    given = {name: value and value.format(port=server.port) for name, value in headers.items()}
    status, _, text = ask(server, method, path, body, **given)
    assert status == 403
    assert b"only." in text or b"may not ask here." in text


@pytest.mark.parametrize("host", ["127.0.0.1", "localhost"])
def test_the_page_itself_is_no_stranger(server: Server, host: str) -> None:
    own = f"{host}:{server.port}"
    headers = {"Host": own, "Origin": f"http://{own}", "Sec_Fetch_Site": "same-origin"}
    assert ask(server, "POST", "/ask", RUN, **headers)[0] == 200


def test_a_link_from_elsewhere_opens_the_page(server: Server) -> None:
    status, headers, _ = ask(server, "GET", "/", Sec_Fetch_Site="cross-site", Sec_Fetch_Mode="navigate")
    assert status == 200
    assert "frame-ancestors 'none'" in headers["Content-Security-Policy"]


PATHS = [
    "/../secret.js",
    "/%2e%2e/secret.js",
    "/..%2fsecret.js",
    "/static/../../secret.js",
    "//secret.js",
    "/more/inner.js",
    "/more/../../secret.js",
    "/notes.txt",
    "/app.js/",
    "/app.js%00.html",
    "\\..\\secret.js",
    "/models/../app.js",
    "/models/..%2f..%2fsecret.flp",
    "/models/no_such_problem.flp",
    "/models/",
    "http://127.0.0.1/../secret.js",
    "/etc/passwd",
    "/__init__.py",
]


@pytest.mark.parametrize("path", PATHS)
def test_nothing_outside_of_its_list_is_given_out(server: Server, path: str) -> None:
    status, _, body = ask(server, "GET", path)
    assert status == 404
    assert SECRET.encode() not in body


def test_models_of_the_reference_problems_are_there(server: Server) -> None:
    status, _, body = ask(server, "GET", "/models/index.json")
    assert status == 200
    assert [row["name"] for row in json.loads(body)] == fl.problems.names()
    status, _, body = ask(server, "GET", "/models/biased_relay.flp")
    assert (status, body) == (200, make_page("biased_relay").to_bytes())


@pytest.mark.parametrize(
    ("method", "path", "headers", "status"),
    [
        ("POST", "/ask", {"Content_Length": None}, 411),
        ("POST", "/ask", {"Content_Length": "-1"}, 411),
        ("POST", "/ask", {"Content_Length": "0", "Transfer_Encoding": "chunked"}, 411),
        ("POST", "/ask", {"Content_Length": "1e3"}, 411),
        ("POST", "/ask", {"Content_Length": "9" * 40}, 411),
        ("POST", "/ask", {"Content_Length": str(MOST_BYTES + 1)}, 413),
        ("POST", "/ask", {"Content_Type": "text/plain", "Content_Length": "0"}, 415),
        ("POST", "/ask", {"Content_Type": "multipart/form-data", "Content_Length": "0"}, 415),
        ("POST", "/app.js", {"Content_Length": "0"}, 405),
        ("GET", "/ask", {}, 405),
        ("PUT", "/app.js", {}, 501),
        ("DELETE", "/app.js", {}, 501),
        ("OPTIONS", "/ask", {"Origin": "http://evil.example"}, 501),
    ],
)
def test_other_requests_are_refused(
    server: Server, method: str, path: str, headers: dict[str, str | None], status: int
) -> None:
    found, answered, _ = ask(server, method, path, None, **headers)
    assert found == status
    assert "Access-Control-Allow-Origin" not in answered


def test_nothing_that_is_sent_is_executed(server: Server, tmp_path: Path) -> None:
    """Text in any field is data: no file is made, and what has no meaning is refused or left alone."""
    target = tmp_path / "made"
    code = f"__import__('pathlib').Path({str(target)!r}).touch()"
    requests: list[dict[str, Any]] = [
        {"kind": code},
        {"kind": "run", "text": code, "reference": code, "title": code},
        {"kind": "run", "params": {code: 1.0}},
        {"kind": "run", "params": {"F": code}},
        {"kind": "run", "y0": [code, code]},
        {"kind": "run", "method": code},
        {"kind": "cycle", "section": code, "period": code},
        {"kind": "continuation", "parameter": "F", "range": [0.1, code], "store": str(target)},
        {"kind": "script", "text": code, "params": {"F": 0.5}, "store": str(target)},
    ]
    for request in requests:
        status, _, body = ask(server, "POST", "/ask", json.dumps(request).encode())
        reply = read_reply(body).header
        assert status == 200
        assert not target.exists()
        assert reply["ok"] is ("text" in request)
        if request["kind"] == "script":
            assert code not in reply["text"]


def test_headers_keep_other_pages_away(server: Server) -> None:
    for path in ("/", "/app.js", "/nothing"):
        _, headers, _ = ask(server, "GET", path)
        assert "Access-Control-Allow-Origin" not in headers
        assert headers["X-Content-Type-Options"] == "nosniff"
        assert headers["Cross-Origin-Resource-Policy"] == "same-origin"
        assert "default-src 'none'" in headers["Content-Security-Policy"]
        assert headers["Cache-Control"] == "no-store"
        assert "Python" not in headers["Server"]


def test_it_listens_on_this_computer_alone_and_tokens_differ(folder: Path) -> None:
    page = make_page("biased_relay")
    with Server(page, folder=folder) as first, Server(page, folder=folder) as second:
        assert first._http.server_address[0] == "127.0.0.1"
        assert first.token != second.token
        assert len(first.token) >= 32
        assert first.url == f"http://127.0.0.1:{first.port}/#token={first.token}"


def test_a_black_box_has_no_model_and_is_answered(folder: Path) -> None:
    system = fl.System(lambda t, x: [-float(str(float(x[0]))) - 1.0], n=1, surfaces=lambda t, x: x[0])
    with Server(make_page(system, [1.0], (0, 1)), folder=folder) as running:
        assert ask(running, "GET", "/model")[0] == 204
        _, _, body = ask(running, "POST", "/ask", b'{"kind": "run"}')
    expected = system.solve((0, 1), [1.0])
    assert read_reply(body).header["end"] == expected.y[:, -1].tolist()


def test_a_browser_that_goes_away_disturbs_nobody(server: Server, capfd: pytest.CaptureFixture[str]) -> None:
    with socket.create_connection(("127.0.0.1", server.port)) as connection:
        connection.sendall(b"POST /ask HTTP/1.1\r\nHost: x\r\nContent-Length: 100\r\n\r\n{")
    assert ask(server, "POST", "/ask", RUN)[0] == 200
    assert capfd.readouterr().err == ""


def test_where_the_page_was_not_built_it_says_so(tmp_path: Path) -> None:
    with pytest.raises(NotBuilt, match="`make app` builds it"):
        Server(make_page("biased_relay"), folder=tmp_path)


@pytest.mark.parametrize("port", [-1, 65536, 1.5, True])
def test_what_is_no_port_is_named(folder: Path, port: Any) -> None:
    with pytest.raises(fl.InputError, match=r"^port: a number from 0 to 65535"):
        Server(make_page("biased_relay"), port, folder=folder)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["nothing.py"], "nothing.py: there is no such file"),
        (["dry_frict"], "did you mean 'dry_friction'"),
        (["model.py", "--port", "x"], "--port: a number from 0 to 65535 is needed, not 'x'"),
        (["model.py", "--port", "65536"], "--port: a number from 0 to 65535"),
        (["model.py", "--param", "G=1"], "--param: model has no parameter 'G'"),
        (["model.py", "--param", "F=2:0"], "--param F: a number, or LOW:HIGH, is needed, not '2:0'"),
        (["model.py", "--param", "F=0:1:2"], "--param F: a number, or LOW:HIGH"),
        (["model.py", "--y0", "1"], "y0: the system has 2 states, y0 has 1"),
        (["model.py", "--t", "1", "2", "3"], "--t: the end, or start and end"),
        (["model.py", "--method", "Radau"], "method"),
    ],
)
def test_a_mistake_in_the_command_is_one_line(
    model: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], message: str
) -> None:
    assert main(["app", "--no-browser", *arguments]) == 2
    shown = capsys.readouterr()
    assert shown.out == ""
    assert message in shown.err
    assert shown.err.count("\n") == 1


def test_the_command_serves_until_it_is_interrupted(model: Path, folder: Path) -> None:
    start = (
        "import sys, pathlib, filippov.app.files as files, filippov.app.server as server; "
        f"server.static_folder = files.static_folder = lambda: pathlib.Path({str(folder)!r}); "
        "from filippov.cli import main; sys.exit(main(sys.argv[1:]))"
    )
    command = [COMMAND[0], "-c", start, "app", "model.py", "--no-browser", "--param", "F=0:2", "--t", "9"]
    with subprocess.Popen(
        command, cwd=model.parent, env=ENVIRONMENT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        try:
            assert process.stdout is not None
            title, _, url = process.stdout.readline().strip().partition(": ")
            assert title == "model", process.communicate()
            address, _, token = url.partition("/#token=")
            connection = http.client.HTTPConnection(address.removeprefix("http://"), timeout=60)
            headers = {TOKEN_HEADER: token, "Content-Type": "application/json"}
            connection.request("POST", "/ask", b'{"kind": "describe"}', headers)
            page = read_reply(connection.getresponse().read()).header["page"]
            connection.close()
            process.send_signal(signal.SIGINT)
            _, errors = process.communicate(timeout=60)
        finally:
            process.kill()
    assert page["ranges"] == {"F": [0.0, 2.0]}
    assert (page["y0"], page["t_span"]) == ([1.0, 2.0], [0.0, 9.0])
    assert (process.returncode, errors) == (0, "")
