"""Something that answers where the command line expects a gateway, and says what a test likes."""

from __future__ import annotations

import json
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

__all__ = ["hostile_gateway"]


@contextmanager
def hostile_gateway(answers: Mapping[str, Any], *, status: int = 200, headers: Mapping[str, str] = {}) -> Iterator[str]:
    """Answers by the beginning of the path, the longest first: bytes as they are, all else as JSON. The address."""

    class Handler(BaseHTTPRequestHandler):
        def _answer(self) -> None:
            self.rfile.read(int(self.headers.get("Content-Length") or 0))
            fits = [path for path in sorted(answers, key=len, reverse=True) if self.path.startswith(path)]
            found = answers[fits[0]] if fits else {}
            body = found if isinstance(found, bytes) else json.dumps(found).encode()
            self.send_response(status if fits else 404)
            for name, value in headers.items():
                self.send_header(name, value)
            self.send_header("Content-Length", str(len(body)))
            self.end_headers()
            self.wfile.write(body)

        do_GET = do_POST = do_PATCH = do_DELETE = _answer

        def log_message(self, *_args: object) -> None:
            """Say nothing."""

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    server.daemon_threads = False  # the end waits for them
    thread = threading.Thread(target=server.serve_forever, args=(0.01,), daemon=True)
    thread.start()
    try:
        yield f"http://127.0.0.1:{server.server_address[1]}"
    finally:
        server.shutdown()
        thread.join(60)
        server.server_close()
