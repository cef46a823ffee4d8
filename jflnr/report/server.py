"""A page of this machine's own: served to its browsers, and to no page of another site."""

import sys
from collections.abc import Callable, Mapping
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any
from urllib.parse import parse_qsl, urlsplit

# The page's own scripts and styles, and this server; no other page may show it in itself.
POLICY = "default-src 'unsafe-inline' 'self' data:; frame-ancestors 'none'"


class Server(ThreadingHTTPServer):
    """One thread for each connection, since browsers keep some that they do not use.

    port: 0 for one that is free. answer: from what is asked for, and the values that come with it,
    to the code of HTTP, the type of the answer, and its text. Raises OSError for a port that is
    taken.
    """

    daemon_threads = True

    def __init__(
        self, port: int, answer: Callable[[str, Mapping[str, str]], tuple[int, str, str]]
    ) -> None:
        self.answer = answer
        try:
            super().__init__(("127.0.0.1", port), Handler)
        except OSError as error:
            raise OSError(f"port {port} cannot be used: {error.strerror}") from None

    def handle_error(self, request: Any, client_address: Any) -> None:
        if not isinstance(sys.exception(), ConnectionError):  # the page was closed
            super().handle_error(request, client_address)


class Handler(BaseHTTPRequestHandler):
    """Answers GET of the page that it serves, and of no other."""

    server: Server

    def do_GET(self) -> None:
        where = urlsplit(self.path)
        code, kind, text = 403, "text/plain", '{"error": "this is for the page of jflnr view only"}'
        if self._own():
            code, kind, text = self.server.answer(where.path, dict(parse_qsl(where.query)))
        self.send_response(code)
        self.send_header("Content-Type", f"{kind}; charset=utf-8")
        self.send_header("Content-Security-Policy", POLICY)
        self.send_header("Cache-Control", "no-store")
        self.end_headers()
        self.wfile.write(text.encode(errors="replace"))

    def _own(self) -> bool:
        """Whether no other page asks, nor one of a name that was made to mean this machine."""
        names = {f"{host}:{self.server.server_port}" for host in ("127.0.0.1", "localhost")}
        site = self.headers.get("Sec-Fetch-Site", "none")
        return self.headers.get("Host") in names and site in ("same-origin", "none")

    def log_message(self, *_: Any) -> None:
        """Who asked for what is of no interest."""
