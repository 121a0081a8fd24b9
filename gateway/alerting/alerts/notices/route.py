"""A route of notices: where alerts go, which of them, and how that goes."""

from __future__ import annotations

import ssl
from dataclasses import dataclass, field
from typing import Literal

from gateway.domain.alert import Alert, rank
from gateway.domain.automation.event import like
from gateway.domain.finding import FindingSeverity
from gateway.outbound.webhook import Webhook

__all__ = ["PRIVATE_HINT", "Delivery", "Mailbox", "Route", "RouteState"]

PRIVATE_HINT = ": private = true lets notices go into a private network"


@dataclass(frozen=True, slots=True, kw_only=True)
class Mailbox:
    """Which server takes the mail, and whom it is to."""

    host: str
    port: int
    tls: Literal["starttls", "tls", "off"]
    sender: str
    to: tuple[str, ...]
    user: str = ""
    password: str = field(default="", repr=False)
    private: bool = False
    context: ssl.SSLContext | None = field(default=None, compare=False, repr=False)

    @property
    def target(self) -> str:
        """The server's address."""
        return f"{self.host}:{self.port}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Route:
    """One route of the file. Empty `robots` and `causes` are all of them; both are globs."""

    name: str
    to: Webhook | Mailbox
    severity: FindingSeverity = "warning"  # the least that is told
    robots: tuple[str, ...] = ()
    causes: tuple[str, ...] = ()
    wait_s: float = 10.0  # how old an alert is before it is told
    again_s: float = 600.0  # an alert that began again is told so often at most
    repeat_s: float = 14_400.0  # an open one is told again so often
    link: str = ""  # the dashboard's address before an alert's path

    @property
    def kind(self) -> str:
        """What it is called in the file."""
        return "webhook" if isinstance(self.to, Webhook) else "smtp"

    def wants(self, alert: Alert) -> bool:
        """Whether such alerts go there."""
        return (
            rank(alert.severity) >= rank(self.severity)
            and (not self.robots or any(like(alert.robot, glob) for glob in self.robots))
            and (not self.causes or any(like(alert.cause, glob) for glob in self.causes))
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class RouteState:
    """A route as people see it: without secrets, with what became of its notices since the gateway began."""

    name: str
    kind: str
    target: str
    severity: FindingSeverity
    robots: tuple[str, ...]
    causes: tuple[str, ...]
    sent: int = 0
    failed: int = 0
    waiting: int = 0
    last_ns: int = 0  # when one last arrived
    last_error: str = ""  # why the last one did not; "" once one has


@dataclass(frozen=True, slots=True, kw_only=True)
class Delivery:
    """What became of one notice; `status` is what the receiver answered, 0 where it did not."""

    ok: bool
    status: int = 0
    error: str = ""
    took_s: float = 0.0
