"""A network camera in this process: Motion JPEG over HTTP on 127.0.0.1, for a bounded number of images and seconds."""

import threading
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import cv2

BOUNDARY = b"--image\r\nContent-Type: image/jpeg\r\nContent-Length: %d\r\n\r\n"
LONGEST = 60.0  # seconds


def jpegs(folder: Path) -> list[bytes]:
    """The images of a folder, in order, as JPEG."""
    paths = sorted(folder.glob("*.*"))
    assert paths
    encoded = [cv2.imencode(".jpg", image) for image in (cv2.imread(str(path)) for path in paths) if image is not None]
    return [data.tobytes() for _, data in encoded]


@contextmanager
def network_camera(
    parts: Iterable[bytes], *, wait: float = 0.02, hang: bool = False, over: threading.Event | None = None
) -> Iterator[str]:
    """The address of a camera that sends `parts`, `wait` seconds apart, and hangs up, or is silent from then on.

    `over` is set once all are sent.
    """
    closing = threading.Event()

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            end = time.monotonic() + LONGEST
            self.send_response(200)
            self.send_header("Content-Type", "multipart/x-mixed-replace; boundary=image")
            self.end_headers()
            try:
                for part in parts:
                    if time.monotonic() > end or closing.wait(wait):
                        return
                    self.wfile.write(BOUNDARY % len(part) + part + b"\r\n")
                if over is not None:
                    over.set()
                if hang:
                    closing.wait(LONGEST)
            except OSError:
                return  # The other side has hung up.

        def log_message(self, format: str, *args: object) -> None:
            pass

    class Server(ThreadingHTTPServer):
        daemon_threads = True

    server = Server(("127.0.0.1", 0), Handler)
    thread = threading.Thread(target=server.serve_forever, args=(0.05,), daemon=True)
    thread.start()
    try:
        yield f"http://127.0.0.1:{server.server_address[1]}/video"
    finally:
        closing.set()
        server.shutdown()
        server.server_close()
        thread.join()
