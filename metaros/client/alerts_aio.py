"""Alerts as both clients have them, at `client.alerts`; see `metaros.client`."""

from __future__ import annotations

from collections.abc import AsyncGenerator, Callable, Mapping, Sequence
from contextlib import aclosing
from typing import Any

from metaros.client import alert_requests
from metaros.client.alert_results import Alert, AlertChange
from metaros.client.http import AsyncHttp

__all__ = ["AsyncAlerts"]

Names = str | Sequence[str]
Documents = list[Any]
Sentences = list[str]
UNRESOLVED = ("open", "acknowledged")


class AsyncAlerts:
    """`client.alerts`: alerts, silences, checks, and what would have fired. It awaits."""

    def __init__(self, http: AsyncHttp, follow: Callable[[Any], AsyncGenerator[Any, None]]) -> None:
        """`follow` has the replies of WatchAlerts to a request, begun again when the connection is lost."""
        self._http = http
        self._follow = follow

    async def list(
        self,
        *,
        states: Names | None = UNRESOLVED,
        severities: Names | None = None,
        robots: Names | None = None,
        causes: Names | None = None,
        text: str = "",
        start: str = "",
        end: str = "",
        quiet: bool | None = None,
        limit: int = 1000,
    ) -> list[Alert]:
        """The newest that are not resolved (`states=None`: of all), the newest first, at most so many.

        `causes` are globs; with `start` and `end` those that were not resolved at some time in between; `quiet` are
        those that nobody is told of, or the others.
        """
        found: list[Alert] = []
        before: Any = None
        while len(found) < limit:
            asked = alert_requests.alerts(
                states=states,
                severities=severities,
                robots=robots,
                causes=causes,
                text=text,
                start=start,
                end=end,
                quiet=quiet,
                limit=limit - len(found),
                before=before,
            )
            page, before = await self._http.send(asked)
            found += page
            if before is None:
                break
        return found

    async def get(self, alert: str) -> Alert:
        """One, with its findings and remarks."""
        return await self._http.send(alert_requests.alert(alert))

    async def watch(
        self, *, robots: Names | None = None, causes: Names | None = None, severities: Names | None = None
    ) -> AsyncGenerator[AlertChange, None]:
        """Those that are, then each change as it happens, until it is left."""
        async with aclosing(self._follow(alert_requests.watch_request(robots, causes, severities))) as replies:
            async for reply in replies:
                if reply.change != "began":
                    yield AlertChange(reply.change, Alert.of_message(reply.alert))

    async def acknowledge(self, alert: str, text: str = "") -> Alert:
        """Somebody sees to it: it is not told again until it gets worse."""
        return await self._http.send(alert_requests.action(alert, "acknowledge", {"text": text}))

    async def unacknowledge(self, alert: str, text: str = "") -> Alert:
        """Nobody sees to it after all."""
        return await self._http.send(alert_requests.action(alert, "unacknowledge", {"text": text}))

    async def resolve(self, alert: str, text: str = "") -> Alert:
        """It is over; what is found anew opens again."""
        return await self._http.send(alert_requests.action(alert, "resolve", {"text": text}))

    async def assign(self, alert: str, assignee: str = "") -> Alert:
        """Who sees to it; "" is nobody."""
        return await self._http.send(alert_requests.action(alert, "assign", {"assignee": assignee}))

    async def comment(self, alert: str, text: str) -> Alert:
        """Say something to it; with its findings and remarks."""
        return await self._http.send(alert_requests.action(alert, "comments", {"text": text}, idempotent=False))

    async def normal(self, alert: str, text: str = "") -> Sentences:
        """What was found is normal: what was taught, a sentence each."""
        return await self._http.send(alert_requests.normal(alert, text))

    async def silence(self, alert: str, *, for_s: float = 3600.0, reason: str = "") -> Any:
        """Tell nobody of its cause on its robot for a while; the silence."""
        return await self._http.send(alert_requests.silence(alert, for_s=for_s, reason=reason))

    async def clip(self, alert: str) -> str:
        """Save its evidence from the robot's black box; the recording's id."""
        return await self._http.send(alert_requests.clip(alert))

    async def silences(self) -> Documents:
        """Those that are not over."""
        return await self._http.send(alert_requests.silences())

    async def add_silence(
        self,
        *,
        robots: Names | None = None,
        causes: Names | None = None,
        up_to: str = "error",
        for_s: float = 3600.0,
        reason: str = "",
    ) -> Any:
        """Tell nobody of whatever matches these globs, up to a severity; the silence."""
        asked = alert_requests.add_silence(robots=robots, causes=causes, up_to=up_to, for_s=for_s, reason=reason)
        return await self._http.send(asked)

    async def end_silence(self, silence: str) -> Any:
        """End it now."""
        return await self._http.send(alert_requests.end_silence(silence))

    async def checks(self) -> Documents:
        """What is looked for, with its bounds."""
        return await self._http.send(alert_requests.checks())

    async def set_check(self, check: str, **changes: Any) -> Any:
        """Have a check be another for the whole fleet: enabled, low, high, for_s, clear_s, severity."""
        return await self._http.send(alert_requests.check(check, changes))

    async def reset_check(self, check: str) -> Any:
        """Have a check be as it comes."""
        return await self._http.send(alert_requests.reset_check(check))

    async def learning(self, robot: str) -> Documents:
        """Which series of a robot are learned still, how odd each is, and what is expected now."""
        return await self._http.send(alert_requests.learning(robot))

    async def band(self, robot: str, series: str, *, start: str = "-15m", end: str = "now") -> Documents:
        """A series and what was expected of it: [stamp_ms, value, low, high, score] each."""
        return await self._http.send(alert_requests.band(robot, series, start=start, end=end))

    async def backtest(
        self,
        robot: str,
        *,
        series: Names | None = None,
        start: str = "-12h",
        end: str = "now",
        checks: Mapping[str, Mapping[str, Any]] | None = None,
        only: Names | None = None,
    ) -> Any:
        """What would have fired over stored history, with changes of checks by their id, or only with some of them."""
        asked = alert_requests.backtest(robot, series=series, start=start, end=end, checks=checks, only=only)
        return await self._http.send(asked)
