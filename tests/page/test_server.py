"""What the server of a page refuses, and that it goes on answering: against the running command."""

import socket
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from helpers.missing_packages import run_without
from helpers.pages import Served, serving
from helpers.small_world import write_images
from helpers.typed_commands import fails

from placerec.page.server import _Allowance

pytest.importorskip("waitress", reason="needs waitress, which serves the pages")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_images(tmp_path_factory.mktemp("served") / "seq1", 0)


@pytest.fixture(scope="module")
def served(folder: Path) -> Iterator[Served]:
    with serving("label", folder, "-q") as found:
        yield found


def test_the_page_and_its_files_have_strict_headers(served: Served) -> None:
    status, html, headers = served.ask(f"/?{served.token}")
    assert status == 200
    assert served.token.encode() in html
    for path in ("page.css", "label.js", "state", "nothing"):
        headers |= served.below(path)[2]
        policy = headers["content-security-policy"]
        assert policy.startswith("default-src 'none'; script-src 'self';")
        assert "unsafe" not in policy
        assert "*" not in policy
        assert headers["x-content-type-options"] == "nosniff"
        assert headers["referrer-policy"] == "no-referrer"
        assert headers["x-frame-options"] == "DENY"
        assert headers["cache-control"] == "no-store"
        assert "server" not in headers


def test_without_the_token_nothing_is_answered(served: Served) -> None:
    wrong = served.token[:-1] + ("a" if served.token[-1] != "a" else "b")
    for path in (
        "/",
        f"/?{wrong}",
        f"/?token={served.token}",
        "/state",
        f"/{wrong}/state",
        f"/{wrong}/page.css",
        "//",
        "/%C3%A9",
    ):
        assert served.ask(path)[0] == 403, path
    assert served.below("state")[0] == 200


@pytest.mark.parametrize(
    "path",
    [
        *(
            "../../etc/passwd",
            "..%2f..%2fetc%2fpasswd",
            "picture/0/../small",
            "picture/0/0/../../../etc/passwd",
            "page.css/..",
        ),
        *(
            "picture/0/999999999/small",
            "picture/0/-1/small",
            "picture/9/0/small",
            "picture/0/0/huge",
            "picture/0/0x1/small",
        ),
        *(
            f"picture/0/{'9' * 5000}/small",
            "picture/0/%C2%B2/small",
            "times/99",
            "labels/",
            "static/page.css",
            "%00",
            "__init__.py",
        ),
    ],
    ids=lambda path: path[:30],
)
def test_what_is_no_number_in_its_range_is_not_there(served: Served, path: str) -> None:
    status, body, _ = served.below(path)
    assert status == 404
    assert b"root:" not in body
    assert len(body) < 100


def test_other_names_and_other_sites_are_refused(served: Served) -> None:
    for host in (
        "evil.example",
        f"evil.example:{served.port}",
        "127.0.0.1",
        f"127.0.0.1.evil.example:{served.port}",
        "",
    ):
        assert served.below("state", Host=host)[0] == 421, host
    assert served.below("state", Host=f"localhost:{served.port}")[0] == 200
    for origin in ("http://evil.example", "null", f"https://127.0.0.1:{served.port}", "http://127.0.0.1:1"):
        assert served.below("state", Origin=origin)[0] == 403, origin
    assert served.below("state", Origin=f"http://127.0.0.1:{served.port}")[0] == 200
    assert served.below("state", Sec_Fetch_Site="cross-site")[0] == 403
    assert served.below("state", Sec_Fetch_Site="same-origin")[0] == 200


def test_what_is_sent_must_be_json_of_labels(served: Served, folder: Path) -> None:
    assert served.below("labels/0", method="POST", sent=[], Content_Type="text/plain")[0] == 415
    assert served.below("labels/0", method="POST", sent={"stretches": []})[0] == 400
    for stretches in (
        "x",
        [1],
        [[0, 99, "a"]],
        [[-1, 3, "a"]],
        [[0, 2, ""]],
        [[0, 2, "a"], [1, 3, "b"]],
        [[2, 2, "a"]],
    ):
        status, found, _ = served.below("labels/0", method="POST", sent={"version": "", "stretches": stretches})
        assert (status, "error" in found) == (400, True), stretches
    for method in ("PUT", "DELETE", "OPTIONS", "HEAD", "TRACE"):
        assert served.below("labels/0", method=method)[0] == 405, method
    assert served.below("state", Range="bytes=0-99999999999")[0] == 416
    state = served.below("state")[1]
    assert state["drives"][0]["stretches"] == [[0, 6, "hall"], [6, 12, "kitchen"]]
    assert sorted(path.name for path in folder.iterdir()) == ["localization", "std_cam"]


def test_a_large_body_and_a_large_header_are_refused(served: Served) -> None:
    post = (
        f"POST /{served.token}/labels/0 HTTP/1.1\r\nHost: 127.0.0.1:{served.port}\r\nContent-Length: 99999999\r\n\r\n"
    )
    for request in (
        b"GET / HTTP/1.1\r\nHost: " + b"a" * 200_000 + b"\r\n\r\n",
        post.encode(),
    ):
        with socket.create_connection(("127.0.0.1", served.port), timeout=20) as line:
            line.sendall(request)
            assert line.recv(100).split()[1] in (b"431", b"413")
    assert served.below("state")[0] == 200


def test_clients_that_say_nothing_or_little_hold_nobody_up(served: Served) -> None:
    others = [socket.create_connection(("127.0.0.1", served.port)) for _ in range(50)]
    try:
        for line in others[:25]:
            line.sendall(b"GET /state HTTP/1.1\r\nHost:")
        begun = time.monotonic()
        assert served.below("state")[0] == 200
        assert time.monotonic() - begun < 5
    finally:
        for line in others:
            line.close()


def test_how_much_is_answered_in_a_second_is_bounded() -> None:
    allowance = _Allowance(rate=10, most=5)
    assert [allowance.take() for _ in range(7)] == [True] * 5 + [False] * 2
    allowance.since -= 0.2
    assert [allowance.take() for _ in range(3)] == [True, True, False]


def test_a_port_that_is_taken_and_a_package_that_is_missing_are_told(served: Served, folder: Path) -> None:
    fails(
        rf"127\.0\.0\.1:{served.port}: no page can be served there: .*; choose another --port",
        "label",
        folder,
        "--port",
        served.port,
    )
    # Before anything is read.
    for command in (
        ("label", "nothing"),
        ("decode", "camera:99", "--live", "-w", "nothing", "-m", "nothing", "--page"),
    ):
        run = run_without(("waitress",), *command)
        told = "placerec: a page needs the package waitress, which is not installed: "
        assert (run.returncode, run.stderr.startswith(told)) == (1, True), run.stderr


def test_others_may_ask_only_where_that_was_said_and_only_with_the_token(folder: Path) -> None:
    with serving("label", folder, "-q", "--host", "0.0.0.0") as served:
        name = socket.gethostname()
        assert served.address == f"http://{name}:{served.port}/?{served.token}"
        for host in (f"127.0.0.1:{served.port}", f"10.1.2.3:{served.port}", f"{name}:{served.port}"):
            assert served.below("state", Host=host)[0] == 200, host
            assert served.ask("/state", Host=host)[0] == 403, host
        assert served.below("state", Host=f"evil.example:{served.port}")[0] == 421
        assert served.ask(f"/?{served.token}", Host=f"127.0.0.1:{served.port}")[0] == 200
