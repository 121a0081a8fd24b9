"""A plain HTTP/1.1 reverse proxy: Debian's nginx, unprivileged, with all its files in one folder.

Its server is the one that docs/howto/behind_a_proxy.md shows, with other ports.
"""

from __future__ import annotations

import os
import re
import shutil
import signal
import socket
import subprocess
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from tests.support.ports import free_port
from tests.support.waiting import wait_until

__all__ = ["Nginx", "nginx_program"]

PAGE = Path(__file__).resolve().parents[3] / "docs" / "howto" / "behind_a_proxy.md"
CONFIG = """\
daemon off;
pid {folder}/nginx.pid;
worker_processes 1;
{user}
events {{ worker_connections 256; }}
http {{
    access_log {folder}/access.log;
    client_body_temp_path {folder}/t1;
    proxy_temp_path {folder}/t2;
    fastcgi_temp_path {folder}/t3;
    uwsgi_temp_path {folder}/t4;
    scgi_temp_path {folder}/t5;
{page}
}}
"""


def shown() -> str:
    """The page's server."""
    match = re.search(r"```nginx\n(.*?)```", PAGE.read_text(), re.DOTALL)
    assert match is not None
    return match[1]


def nginx_program() -> str:
    """Where nginx is; skips the test where there is none, but in CI."""
    found = shutil.which("nginx", path=f"{os.environ.get('PATH', '')}:/usr/sbin:/usr/local/sbin")
    if found is None:
        assert "CI" not in os.environ, "CI must have nginx: see .ci/run"
        pytest.skip("no nginx on this machine (Debian: apt install nginx-light)")
    return found


@dataclass
class Nginx:
    """In front of an HTTP server on `upstream`; use as a context manager."""

    folder: Path
    upstream: int
    path: str = ""
    certificate: Path | None = None  # with its key beside it, .key
    port: int = field(default_factory=free_port)
    process: subprocess.Popen[bytes] | None = None

    def __enter__(self) -> Nginx:
        self.start()
        return self

    def __exit__(self, *_exc: object) -> None:
        self.stop()

    @property
    def url(self) -> str:
        """Its address."""
        scheme, host = ("https", "localhost") if self.certificate else ("http", "127.0.0.1")
        return f"{scheme}://{host}:{self.port}{self.path}"

    def start(self) -> None:
        """Listen."""
        self.folder.mkdir(exist_ok=True)
        tls = ""
        if self.certificate is not None:
            key = self.certificate.with_suffix(".key")
            tls = f" ssl; ssl_certificate {self.certificate}; ssl_certificate_key {key}"
        user = "user root;" if hasattr(os, "geteuid") and os.geteuid() == 0 else ""
        page = shown()
        for there, here in (
            ("listen 80;", f"listen 127.0.0.1:{self.port}{tls};"),
            ("location / {", f"location {self.path}/ {{"),
            ("http://127.0.0.1:8080;", f"http://127.0.0.1:{self.upstream}/;"),
        ):
            assert page.count(there) == 1, f"{PAGE.name} has no {there!r} any more"
            page = page.replace(there, here)
        text = CONFIG.format(folder=self.folder, user=user, page=page)
        (self.folder / "nginx.conf").write_text(text)
        with (self.folder / "error.log").open("ab") as log:
            command = [nginx_program(), "-p", self.folder, "-e", self.folder / "error.log", "-c", "nginx.conf"]
            self.process = subprocess.Popen(command, stdout=log, stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL)
        wait_until(self._answers, timeout_s=60)

    def stop(self) -> None:
        """Cut every connection and stop listening."""
        if self.process is not None:
            self.process.send_signal(signal.SIGTERM)
            self.process.wait(60)
            self.process = None

    @property
    def requests(self) -> list[str]:
        """Lines of its access log, of requests that are over."""
        return (self.folder / "access.log").read_text().splitlines()

    def _answers(self) -> bool:
        assert self.process is not None
        assert self.process.poll() is None, (self.folder / "error.log").read_text()
        with socket.socket() as probe:
            return probe.connect_ex(("127.0.0.1", self.port)) == 0
