"""Serves one page on localhost, below a path that only who is told it knows."""

from __future__ import annotations

import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from socket import AF_INET, AF_INET6

from hapticlink.visualization.browser_code.one_file import POLICY, headers


@contextmanager
def serve_page(html: str, host: str, ports: Sequence[int], token: str) -> Iterator[int]:
    """Serves `html` at /<token>/ within the context, which gets the first of the ports that is
    free; 0 is any. Raises OSError where none is."""
    body, path = html.encode(), f"/{token}/"

    class Handler(BaseHTTPRequestHandler):
        timeout = 10

        def do_GET(self) -> None:
            if self.path != path:
                self.send_error(HTTPStatus.NOT_FOUND)
                return
            self.send_response(HTTPStatus.OK)
            content = {"Content-Type": "text/html; charset=utf-8", "Content-Length": str(len(body))}
            for name, value in {**headers(POLICY), **content}.items():
                self.send_header(name, value)
            self.end_headers()
            self.wfile.write(body)

        def version_string(self) -> str:
            return "hapticlink"

        def log_message(self, *said: object) -> None:
            pass  # the terminal shows what the command says

    class Server(ThreadingHTTPServer):
        address_family = AF_INET6 if ":" in host else AF_INET
        daemon_threads = True

        def handle_error(self, *of: object) -> None:
            pass  # a window that was closed while it loaded

    def bound(port: int, *others: int) -> Server:
        try:
            return Server((host, port), Handler)
        except OSError:
            if not others:
                raise
            return bound(*others)

    with bound(*ports) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        try:
            yield server.server_address[1]
        finally:
            server.shutdown()
