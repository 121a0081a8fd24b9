"""The dashboard over TLS in a real browser: `metaros up --tls on` as a process, its page and its live stream by wss."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Page, expect

from tests.e2e.chromium import Chromium
from tests.support.ports import free_port
from tests.support.processes import END_S, end
from tests.support.waiting import wait_until

pytestmark = [
    pytest.mark.browser,
    pytest.mark.integration,
    pytest.mark.xdist_group("browser"),
    pytest.mark.timeout(600),
]


@pytest.fixture
def link(tmp_path: Path, built: None) -> Iterator[str]:
    """A whole instance with one robot, nobody anonymous; the sign-in link that it printed."""
    command = [sys.executable, "-m", "metaros", "up", "--tls", "on", "--no-anonymous", "--robots", "1", "--no-host"]
    for option in ("--port", "--grpc-port", "--zenoh-port"):
        command += [option, str(free_port())]
    environ = {**os.environ, "HOME": str(tmp_path), "METAROS_RUNTIME_DIR": str(tmp_path / "run")}
    log = tmp_path / "up.log"
    with log.open("wb") as out:
        process = subprocess.Popen(
            [*command, "--data-dir", str(tmp_path / "data")],
            stdin=subprocess.DEVNULL,
            stdout=out,
            stderr=subprocess.STDOUT,
            env=environ,
        )
    try:
        wait_until(lambda: "Ctrl-C" in log.read_text() or process.poll() is not None, timeout_s=240, every_s=0.2)
        found = re.search(r"Sign in\s+(https://\S+/signin#\S+)", log.read_text())
        assert found is not None, log.read_text()
        yield found[1]
    finally:
        if process.poll() is None:
            process.send_signal(signal.SIGINT)
            process.wait(END_S)
        end(process)


@pytest.fixture
def page(chromium: Chromium) -> Iterator[Page]:
    """A page of a browser that takes any certificate, as if its root were in the machine's trust store."""
    context = chromium.browser.new_context(ignore_https_errors=True)
    opened = context.new_page()
    opened.set_default_timeout(60_000)
    yield opened
    context.close()


def test_the_dashboard_and_its_live_stream_over_tls(link: str, page: Page) -> None:
    sockets: list[str] = []
    page.on("websocket", lambda socket: sockets.append(socket.url))
    page.goto(link)
    page.get_by_role("button", name="Later").click()  # a password
    expect(page.locator("[data-account=admin]")).to_be_visible()
    assert all(cookie["secure"] for cookie in page.context.cookies())
    base = link.partition("/signin")[0]
    page.goto(f"{base}/robots/sim_1")
    page.wait_for_function("() => Number(document.querySelector('[data-card=map] canvas')?.dataset.scans) > 3")
    assert page.evaluate("window.isSecureContext") is True
    assert sockets
    assert all(url.startswith(base.replace("https", "wss", 1)) for url in sockets), sockets
