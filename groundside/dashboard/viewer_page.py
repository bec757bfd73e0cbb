"""Serve the page of the web viewer with a policy that blocks all connections to other machines.

Rerun's page sends usage statistics, checks for newer versions and loads fonts and examples from the Internet, and has
no option to prevent this. With a content security policy the browser refuses such requests. Rerun's server cannot send
one, so this server forwards its answers and adds it.
"""

from __future__ import annotations

import http.client
import re
import shutil
import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

__all__ = ["PageServer"]

_LOOPBACK = "127.0.0.1"
_FOREIGN_LINK = re.compile(rb'<link\b[^>]*href="https?:[^>]*>')
"""Links that make the browser connect in advance, which the policy does not cover."""
_HEADERS = ("Content-Type", "Content-Length", "rerun-final-length")
"""Headers of Rerun's answers that the page needs; the last one is for its progress display."""


class PageServer:
    """Serves the viewer's page from ``viewer_port`` on ``port``, on loopback.

    Parameters
    ----------
    port : int
        Port for the browser.
    viewer_port : int
        Port of Rerun's server.
    data_port : int
        The only other port to which the page may connect.

    Raises
    ------
    OSError
        If the port is in use.
    """

    def __init__(self, port: int, viewer_port: int, data_port: int) -> None:
        policy = (
            "default-src 'self' blob: data:; "
            "script-src 'self' 'unsafe-inline' 'wasm-unsafe-eval' blob:; "
            "style-src 'self' 'unsafe-inline'; "
            f"connect-src 'self' blob: data: http://{_LOOPBACK}:{data_port}"
        )
        handler = type("Handler", (_Handler,), {"policy": policy, "viewer_port": viewer_port})
        self._server = _Server((_LOOPBACK, port), handler)
        thread = threading.Thread(target=self._server.serve_forever, args=(0.05,), name="viewer page", daemon=True)
        thread.start()

    def close(self) -> None:
        """Stop the server."""
        self._server.shutdown()
        self._server.server_close()


class _Server(ThreadingHTTPServer):
    daemon_threads = True
    # A browser may keep a connection open; closing the server does not wait for it.
    block_on_close = False

    def handle_error(self, request: object, client_address: object) -> None:
        """Ignore errors, such as of a browser that disconnects in the middle of an answer."""


class _Handler(BaseHTTPRequestHandler):
    policy: str
    viewer_port: int

    def do_GET(self) -> None:
        viewer = http.client.HTTPConnection(_LOOPBACK, self.viewer_port, timeout=5.0)
        try:
            viewer.request("GET", self.path)
            answer = viewer.getresponse()
            kept = {header: answer.headers[header] for header in _HEADERS if header in answer.headers}
            page = None
            if "html" in kept.get("Content-Type", ""):
                page = _FOREIGN_LINK.sub(b"", answer.read())
                kept["Content-Length"] = str(len(page))
            self.send_response(answer.status)
            for header, value in kept.items():
                self.send_header(header, value)
            self.send_header("Content-Security-Policy", self.policy)
            self.send_header("Referrer-Policy", "no-referrer")
            self.end_headers()
            if page is None:
                shutil.copyfileobj(answer, self.wfile, 1 << 18)
            else:
                self.wfile.write(page)
        except (OSError, http.client.HTTPException):
            self.close_connection = True
        finally:
            viewer.close()

    def log_message(self, format: str, *args: object) -> None:
        """Print nothing for a request."""
