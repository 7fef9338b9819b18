"""A page on this machine: who may ask, what is answered, and how much of it.

The address holds a token that nobody can guess. `/?TOKEN` is the page, everything else lies below `/TOKEN/`: without it
nothing is answered, and another site's page, which may send requests here, does not know it. Names of hosts are looked
at because a stranger's name may lead here (DNS rebinding). No path of the file system is taken from a request: what
lies below the token are the package's own files, and what a handler makes of numbers.
"""

import hmac
import ipaddress
import json
import logging
import secrets
import socket
import threading
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from http import HTTPStatus
from typing import Any

from placerec.errors import PageError, PlacerecError, check_optional
from placerec.page import assets

log = logging.getLogger(__name__)

HERE = "127.0.0.1"
# What a request may hold; seconds that a client may be silent; clients and requests at once.
MAX_HEADER, MAX_BODY, SILENCE, CLIENTS, THREADS = 1 << 14, 1 << 23, 20, 200, 6
# Answers a second, and how many at once: a page that is scrolled asks for a hundred pictures.
RATE, BURST = 300, 600
_HEADERS = {
    "Content-Security-Policy": (
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; connect-src 'self'; "
        "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    ),
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
}


@dataclass(frozen=True)
class Request:
    """What a page asks for: the parts of the path below the token, and for POST the JSON that was sent."""

    method: str
    parts: tuple[str, ...]
    sent: Any = None

    def number(self, index: int, below: int) -> int:
        """The whole number that part `index` is; RefusedError unless it is 0 to `below` - 1."""
        text = self.parts[index] if index < len(self.parts) else ""
        # int() takes more than digits, and takes long for a million of them.
        if not (text.isascii() and text.isdecimal() and len(text) < 10 and int(text) < below):
            raise RefusedError(HTTPStatus.NOT_FOUND, "no such number")
        return int(text)


@dataclass(frozen=True)
class Answer:
    """A body of a MIME type; `keep`: seconds that the browser need not ask again."""

    body: bytes
    kind: str = "application/json"
    status: HTTPStatus = HTTPStatus.OK
    keep: int = 0


class RefusedError(Exception):
    """A request that is not answered, and why."""

    def __init__(self, status: HTTPStatus, reason: str) -> None:
        super().__init__(status, reason)
        self.status, self.reason = status, reason


Handler = Callable[[Request], Answer | None]


def json_answer(value: object, status: HTTPStatus = HTTPStatus.OK) -> Answer:
    """An answer of JSON; nan is not JSON and raises ValueError."""
    # A path may hold what is no text.
    return Answer(json.dumps(value, ensure_ascii=False, allow_nan=False).encode("utf-8", "replace"), status=status)


@dataclass
class _Allowance:
    """How many answers are left: `rate` more each second, `most` at most."""

    rate: float
    most: float
    left: float = field(init=False)
    since: float = field(init=False)

    def __post_init__(self) -> None:
        self.left, self.since = self.most, time.monotonic()
        self._lock = threading.Lock()

    def take(self) -> bool:
        """Whether there is one, which is taken."""
        with self._lock:
            now = time.monotonic()
            self.left = min(self.most, self.left + (now - self.since) * self.rate)
            self.since = now
            if self.left < 1:
                return False
            self.left -= 1
            return True


def check_server() -> None:
    """Raise MissingExtraError if no page can be served: before any work."""
    check_optional("waitress", "a page")


class PageServer:
    """Serves one page: `html` is its file in the package, `handler` answers what is below the token.

    `handler` returns None for what it does not know. `port`: 0 for a free one. Raises MissingExtraError without
    waitress, PageError where the port cannot be had.
    """

    def __init__(self, html: str, handler: Handler, *, host: str = HERE, port: int = 0) -> None:
        check_server()
        from waitress.server import create_server

        # Of what strangers send wrong nobody needs to hear.
        logging.getLogger("waitress").addHandler(logging.NullHandler())
        self.html, self.handler, self.host = html, handler, host
        self.token = secrets.token_urlsafe(24)
        self._allowance = _Allowance(RATE, BURST)
        try:
            family = socket.AF_INET6 if ":" in host else socket.AF_INET
            bound = socket.create_server((host, port), family=family, backlog=128)
        except (OSError, OverflowError) as error:
            reason = getattr(error, "strerror", None) or error
            raise PageError(f"{host}:{port}: no page can be served there: {reason}; choose another --port") from error
        self.port: int = bound.getsockname()[1]
        self._server: Any = create_server(
            self._answered,
            sockets=[bound],
            threads=THREADS,
            ident=None,
            max_request_header_size=MAX_HEADER,
            max_request_body_size=MAX_BODY,
            channel_timeout=SILENCE,
            cleanup_interval=5,
            connection_limit=CLIENTS,
        )

    @property
    def address(self) -> str:
        """What is opened in the browser, with the token."""
        name = socket.gethostname() if self.host in ("0.0.0.0", "::", "") else self.host
        return f"http://{f'[{name}]' if ':' in name else name}:{self.port}/?{self.token}"

    def run(self) -> None:
        """Serve until Ctrl-C, or until `close` is called in another thread."""
        try:
            self._server.run()
        finally:
            self.close()

    def start(self) -> None:
        """Serve in a thread of its own, until `close`."""
        threading.Thread(target=self.run, daemon=True, name="page").start()

    def close(self) -> None:
        """Answer nothing any more."""
        self._server.task_dispatcher.shutdown(timeout=1)
        self._server.close()

    def _answered(self, environ: Mapping[str, Any], start: Callable[..., Any]) -> Iterable[bytes]:
        """The WSGI application."""
        try:
            answer = self._answer(environ)
        except RefusedError as refusal:
            answer = Answer(refusal.reason.encode(), "text/plain; charset=utf-8", refusal.status)
        except PlacerecError as error:
            answer = json_answer({"error": str(error)}, HTTPStatus.BAD_REQUEST)
        except Exception as error:  # A thread that dies would tell nobody.
            log.error("the page asked %s, which failed: %r", environ.get("PATH_INFO"), error)
            answer = Answer(b"it failed", "text/plain; charset=utf-8", HTTPStatus.INTERNAL_SERVER_ERROR)
        keep = f"private, max-age={answer.keep}" if answer.keep else "no-store"
        headers = {
            **_HEADERS,
            "Content-Type": answer.kind,
            "Content-Length": str(len(answer.body)),
            "Cache-Control": keep,
        }
        start(f"{answer.status.value} {answer.status.phrase}", [*headers.items()])
        return [answer.body]

    def _answer(self, environ: Mapping[str, Any]) -> Answer:
        self._check_sender(environ)
        if not self._allowance.take():
            raise RefusedError(HTTPStatus.TOO_MANY_REQUESTS, "too many requests; wait a second")
        method = environ["REQUEST_METHOD"]
        if method not in ("GET", "POST"):
            raise RefusedError(HTTPStatus.METHOD_NOT_ALLOWED, "GET and POST alone")
        if "HTTP_RANGE" in environ:
            raise RefusedError(HTTPStatus.REQUESTED_RANGE_NOT_SATISFIABLE, "parts of answers are not served")
        token, *parts = environ["PATH_INFO"].removeprefix("/").split("/")
        if method == "GET" and not token and not parts and self._is_token(environ.get("QUERY_STRING", "")):
            return self._page()
        if not self._is_token(token):
            raise RefusedError(HTTPStatus.FORBIDDEN, "the address lacks the token that was printed")
        if method == "GET" and len(parts) == 1 and parts[0] in assets.names():
            kind = assets.TYPES[parts[0].rpartition(".")[2]]
            return Answer(assets.text(parts[0]).encode(), f"{kind}; charset=utf-8")
        answer = self.handler(Request(method, tuple(parts), _sent(environ) if method == "POST" else None))
        if answer is None:
            raise RefusedError(HTTPStatus.NOT_FOUND, "nothing there")
        return answer

    def _page(self) -> Answer:
        html = assets.text(self.html).replace("{token}", self.token)
        return Answer(html.encode(), "text/html; charset=utf-8")

    def _is_token(self, text: str) -> bool:
        return hmac.compare_digest(text.encode("utf-8", "replace"), self.token.encode())

    def _check_sender(self, environ: Mapping[str, Any]) -> None:
        asked = environ.get("HTTP_HOST", "")
        name, _, port = asked.rpartition(":")
        if port != str(self.port) or not self._is_known(name.strip("[]")):
            raise RefusedError(HTTPStatus.MISDIRECTED_REQUEST, "this host is called otherwise")
        origin = environ.get("HTTP_ORIGIN")
        if origin is not None and origin != f"http://{asked}":
            raise RefusedError(HTTPStatus.FORBIDDEN, "another site asks")
        if environ.get("HTTP_SEC_FETCH_SITE", "none") not in ("none", "same-origin"):
            raise RefusedError(HTTPStatus.FORBIDDEN, "another site asks")

    def _is_known(self, name: str) -> bool:
        """Whether a name is one that leads here by the user's will: of all names of hosts, no stranger's."""
        if name == self.host or (self.host == HERE and name == "localhost"):
            return True
        if self.host == HERE:
            return False
        try:
            ipaddress.ip_address(name)
        except ValueError:
            return name.lower() == socket.gethostname().lower()
        return True


def _sent(environ: Mapping[str, Any]) -> Any:
    # Of what a form of another site could send nothing is JSON.
    if environ.get("CONTENT_TYPE", "").partition(";")[0] != "application/json":
        raise RefusedError(HTTPStatus.UNSUPPORTED_MEDIA_TYPE, "JSON alone")
    try:
        return json.loads(environ["wsgi.input"].read(MAX_BODY))
    except (ValueError, RecursionError) as error:
        raise RefusedError(HTTPStatus.BAD_REQUEST, "that is no JSON") from error
