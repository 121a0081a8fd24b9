"""One Chromium for a worker, and pages used again: a new one costs a second of CPU, a blank one a third of it."""

from __future__ import annotations

import asyncio
import shutil
from collections.abc import Iterator
from contextlib import contextmanager

from playwright.sync_api import Browser, BrowserContext, Page, expect, sync_playwright

__all__ = ["ARGUMENTS", "CHROMIUM", "DESKTOP", "INSECURE_HOST", "PHONE", "Chromium", "Pages", "sign_in"]

# The first is Debian's package of Chromium's old headless mode: the same engine for a quarter less CPU.
PROGRAMS = ("chromium-headless-shell", "chromium", "chromium-browser", "google-chrome")
CHROMIUM = next((found for found in map(shutil.which, PROGRAMS) if found), None)
ARGUMENTS = [
    "--no-sandbox",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]
DESKTOP = {"width": 1440, "height": 900}
PHONE = {"width": 390, "height": 844}
PATIENCE_MS = 60_000  # a loaded machine paints late
INSECURE_HOST = "robots.test"  # this machine, which the browser takes for another one
RESOLVE = f"--host-resolver-rules=MAP {INSECURE_HOST} 127.0.0.1"
FORGET = "() => { try { localStorage.clear(); sessionStorage.clear() } catch {} }"


def sign_in(page: Page, link: str) -> None:
    """What the page of a one-time link does, without the page: it is looked at by its own tests, and costs a load."""
    base, _, token = link.partition("/signin#")
    answer = page.context.request.post(f"{base}/api/v1/auth/link", data={"token": token})
    assert answer.ok, answer.text()


class Chromium:
    """The process, and a page of each kind that is kept for the next test."""

    def __init__(self) -> None:
        expect.set_options(timeout=PATIENCE_MS)
        self._playwright = sync_playwright().start()
        self._loop = asyncio.get_running_loop()
        self._browser = self.launch()
        asyncio._set_running_loop(None)
        self.kept: dict[bool, Page] = {}  # by whether it is touched

    def launch(self, *arguments: str, env: dict[str, str | float | bool] | None = None) -> Browser:
        """Another Chromium, with arguments of its own."""
        return self._playwright.chromium.launch(
            executable_path=CHROMIUM, args=[*ARGUMENTS, RESOLVE, *arguments], env=env
        )

    @property
    def browser(self) -> Browser:
        """Chromium, started again if it has crashed."""
        if not self._browser.is_connected():
            self.kept.clear()
            self._browser = self.launch()
        return self._browser

    @contextmanager
    def used(self) -> Iterator[None]:
        """Playwright's event loop counts as running in this thread for as long only: other tests have loops too."""
        asyncio._set_running_loop(self._loop)
        try:
            yield
        finally:
            asyncio._set_running_loop(None)

    def close(self) -> None:
        """End it."""
        with self.used():
            self._browser.close()
            self._playwright.stop()


class Pages:
    """The pages of one test: a kept one the first time, new ones beside it."""

    def __init__(self, chromium: Chromium) -> None:
        self.errors: list[str] = []  # of scripts, on any page
        self._chromium = chromium
        self._lent: dict[bool, Page] = {}
        self._contexts: list[BrowserContext] = []

    def open(
        self,
        url: str,
        *,
        size: dict[str, int] = DESKTOP,
        scheme: str = "light",
        touch: bool = False,
        own: bool = False,
        clock: bool = False,
        link: str = "",
    ) -> Page:
        """Open an address at a size and in a colour scheme, signed in by a link if one is given.

        A page that gets listeners, routes or scripts of its own is the test's `own`: these cannot all be taken back.
        So is one with a `clock`, whose time the test moves on: `page.clock.fast_forward`.
        """
        browser = self._chromium.browser
        if own or clock or touch in self._lent:
            page = self._new(browser, touch)
            self._contexts.append(page.context)
        else:
            page = self._lent[touch] = self._chromium.kept.pop(touch, None) or self._new(browser, touch)
        if clock:
            page.clock.install()
        page.on("pageerror", self._note)
        page.set_viewport_size(size)  # type: ignore[arg-type]
        page.emulate_media(color_scheme=scheme)  # type: ignore[arg-type]
        if link:
            sign_in(page, link)
        page.goto(url)
        return page

    def _note(self, error: object) -> None:
        self.errors.append(str(error))

    def _new(self, browser: Browser, touch: bool) -> Page:
        """It takes any certificate, as if its root were in the machine's trust store."""
        context = browser.new_context(viewport=DESKTOP, has_touch=touch, is_mobile=touch, ignore_https_errors=True)  # type: ignore[arg-type]
        page = context.new_page()
        page.set_default_timeout(PATIENCE_MS)
        return page

    def clear(self) -> None:
        """End new pages; kept ones go blank, and know nobody any more."""
        for context in self._contexts:
            context.close()
        for touch, page in self._lent.items():
            for other in page.context.pages:
                if other is not page:
                    other.close()
            if page.is_closed():
                page.context.close()
                continue
            page.evaluate(FORGET)
            page.remove_listener("pageerror", self._note)
            page.goto("about:blank")
            page.mouse.up()
            page.mouse.move(0, 0)
            page.context.clear_cookies()
            page.context.clear_permissions()
            self._chromium.kept[touch] = page
