"""Pages served by a process of their own, as a user starts them, and what is asked of them."""

import http.client
import json
import signal
import subprocess
import sys
import urllib.parse
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import IO, Any

# However this process was started, that one is to hear of Ctrl-C.
_PLACEREC = (
    "import signal; signal.signal(signal.SIGINT, signal.default_int_handler); from placerec.cli import main; main()"
)


@dataclass(frozen=True)
class Served:
    """A page that is served: the process, the address that it printed, and that address in parts."""

    process: "subprocess.Popen[str]"
    address: str

    @property
    def port(self) -> int:
        port = urllib.parse.urlsplit(self.address).port
        assert port
        return port

    @property
    def token(self) -> str:
        return urllib.parse.urlsplit(self.address).query

    def ask(
        self, path: str, *, method: str = "GET", sent: Any = None, **headers: str
    ) -> tuple[int, Any, dict[str, str]]:
        """Status, body (JSON as values) and headers (names in lower case) of the answer to a request."""
        link = http.client.HTTPConnection("127.0.0.1", self.port, timeout=30)
        given = {name.replace("_", "-"): value for name, value in headers.items()}
        body = None
        if sent is not None:
            body, given = json.dumps(sent), {"Content-Type": "application/json", **given}
        link.request(method, path, body=body, headers=given)
        answer = link.getresponse()
        found, kind = answer.read(), answer.getheader("Content-Type") or ""
        link.close()
        names = {name.lower(): value for name, value in answer.getheaders()}
        return answer.status, json.loads(found) if kind == "application/json" else found, names

    def below(self, path: str, **how: Any) -> tuple[int, Any, dict[str, str]]:
        """What is answered below the token."""
        return self.ask(f"/{self.token}/{path}", **how)


@contextmanager
def serving(*args: object, stdout: IO[str] | None = None) -> Iterator[Served]:
    """A command with a page, without a browser; it is interrupted at the end, and must end well.

    `stdout`: where its data go, if these are not the address, which then is on stderr.
    """
    command = [sys.executable, "-c", _PLACEREC, *map(str, args), "--no-browser"]
    out = subprocess.PIPE if stdout is None else stdout
    with subprocess.Popen(command, stdout=out, stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr
        told = process.stdout or process.stderr
        address = next((line.strip() for line in told if line.startswith("http")), "")
        if not address:
            raise AssertionError(process.stderr.read())
        try:
            yield Served(process, address)
        finally:
            killed = process.poll() is not None
            if not killed:
                process.send_signal(signal.SIGINT)
            _, said = process.communicate(timeout=30)
        assert "Traceback" not in said, said
        assert killed or process.returncode == 0, said
