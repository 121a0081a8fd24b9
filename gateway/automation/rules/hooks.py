"""Hooks: endpoints for others' webhooks. What comes in proves who sent it, and becomes an event.

The signature is that of Standard Webhooks (https://www.standardwebhooks.com): HMAC-SHA256 over id, time and body. A
message is taken once, by its id, and only while its time is not far off. All methods on the event loop.
"""

from __future__ import annotations

import hmac
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, TypeVar

import orjson

from gateway.automation.rules.errors import HookExistsError, HookRefusedError, UnknownHookError
from gateway.automation.rules.event_intake import EventIntake
from gateway.automation.rules.registry import Database
from gateway.automation.rules.secrets import Secrets, hook_owner, new_secret
from gateway.domain.automation.gateway_event import WEBHOOK, GatewayEvent
from gateway.domain.automation.rule import Hook
from gateway.domain.fleet.command import new_command_id
from gateway.domain.principal import Principal, in_scope
from gateway.errors import BodyTooLargeError, InvalidRequestError, TooManyError, TooManyRequestsError
from gateway.outbound.webhook import signature, signing_key
from gateway.store.automation import hooks as table
from gateway.store.engine import StoreEngine
from metaros.clock import Clock
from metaros.limits import LIMITS, Limits

__all__ = ["AUTHS", "HookManager", "Received"]

Result = TypeVar("Result")
AUTHS = ("signature", "bearer")
KEPT_HEADERS = ("content-type", "user-agent", "webhook-id", "webhook-timestamp", "x-github-event", "x-event-type")
HEADER_CHARS = 256
_NAME = re.compile(r"[a-z0-9][a-z0-9_.-]{0,62}")


@dataclass(frozen=True, slots=True, kw_only=True)
class Received:
    """What became of a webhook: the event's id, and whether it had come before."""

    id: str
    duplicate: bool


@dataclass(slots=True)
class _Bucket:
    """How often a hook may be used."""

    room: float
    at_s: float


class HookManager:
    """Makes hooks, and takes what comes to them."""

    def __init__(
        self,
        database: Database,
        intake: EventIntake,
        secrets: Secrets,
        *,
        clock: Clock,
        limits: Limits = LIMITS,
    ) -> None:
        self._database = database
        self._intake = intake
        self._secrets = secrets
        self._clock = clock
        self._limits = limits
        self._buckets: dict[str, _Bucket] = {}

    async def list(self) -> list[Hook]:
        """Every hook, by name."""
        return await self._reading(table.read_hooks)

    async def get(self, name: str) -> Hook:
        """One hook; UnknownHookError."""

        found = (
            await self._reading(lambda engine: table.read_hook(engine, name))
            if _NAME.fullmatch(name) is not None
            else None
        )
        if found is None:
            raise UnknownHookError.of(name)
        return found

    async def make(
        self, name: str, *, description: str = "", auth: str = "signature", robot: str = "", maker: Principal
    ) -> tuple[Hook, str]:
        """A hook, and its secret, which nobody is shown again.

        Raises:
            InvalidRequestError: the name, the way of proof or the robot is none.
            HookExistsError, TooManyError: there is one of that name; there are as many as can be.
        """
        if _NAME.fullmatch(name) is None:
            raise InvalidRequestError("name: 1 to 63 of a-z, 0-9, '_', '.', '-', a letter or digit first")
        if auth not in AUTHS:
            raise InvalidRequestError(f"auth: one of {', '.join(AUTHS)}")
        if not in_scope(maker.robots, robot) if robot else not maker.sees_all:
            raise InvalidRequestError("robot: whoever does not see every robot names one of theirs")
        hook = Hook(
            name=name,
            description=description,
            auth=auth,
            robot=robot,
            made_by=maker.name or maker.id,
            robots=maker.robots,
            made_ns=self._clock.wall_ns(),
        )
        secret = new_secret()

        def job(engine: StoreEngine) -> None:
            if len(table.read_hooks(engine)) >= self._limits.hooks:
                raise TooManyError(f"there are {self._limits.hooks} hooks already")
            if not table.add_hook(engine, hook):
                raise HookExistsError(f"there is a hook {name} already")
            self._secrets.keep_within(engine, hook_owner(name), secret)

        await self._database.run(job)
        return hook, secret

    async def rotate(self, name: str) -> str:
        """Another secret, from now on; UnknownHookError."""
        await self.get(name)
        return await self._secrets.make(hook_owner(name))

    async def remove(self, name: str) -> None:
        """Take a hook away; UnknownHookError."""
        if not await self._database.run(lambda engine: table.remove_hook(engine, name)):
            raise UnknownHookError.of(name)

    async def receive(self, name: str, headers: Mapping[str, str], body: bytes) -> Received:
        """What came to a hook; `headers` have lower-case names.

        Raises:
            UnknownHookError: there is none of that name.
            TooManyRequestsError: it comes too often.
            HookRefusedError: it does not prove who sent it.
            BodyTooLargeError, InvalidRequestError: it is too large, or no JSON.
            OverloadedError, StoreError: it cannot be stored now, and should come again.
        """
        hook = await self.get(name)
        self._take(name)
        if len(body) > self._limits.hook_bytes:
            raise BodyTooLargeError(f"a webhook has at most {self._limits.hook_bytes} bytes")
        secret = await self._secrets.find(hook_owner(name))
        now_ns = self._clock.wall_ns()
        try:
            _prove(hook, secret, headers, body, now_s=now_ns / 1e9, skew_s=self._limits.hook_skew_s)
        except HookRefusedError:
            await self._count(name, refused=1)
            raise
        try:
            said: Any = orjson.loads(body) if body else None
        except orjson.JSONDecodeError as error:
            raise InvalidRequestError(f"a webhook's body is JSON: {error}") from error
        gateway_event = _gateway_event(hook, headers, said, now_ns)
        new = await self._intake.accept([gateway_event])
        await self._count(name, accepted=new)
        return Received(id=gateway_event.id, duplicate=not new)

    def _take(self, name: str) -> None:
        rate, now_s = self._limits.hook_requests_per_s, self._clock.monotonic_s()
        bucket = self._buckets.setdefault(name, _Bucket(2 * rate, now_s))
        bucket.room = min(2 * rate, bucket.room + (now_s - bucket.at_s) * rate)
        bucket.at_s = now_s
        if bucket.room < 1:
            raise TooManyRequestsError(f"hook {name} takes {rate:g} a second", retry_after_s=1.0)
        bucket.room -= 1

    async def _count(self, name: str, *, accepted: int = 0, refused: int = 0) -> None:
        now_ns = self._clock.wall_ns()
        await self._database.run(
            lambda engine: table.count_hook(engine, name, accepted=accepted, refused=refused, now_ns=now_ns)
        )

    async def _reading(self, job: Callable[[StoreEngine], Result]) -> Result:
        def read(engine: StoreEngine) -> Result:
            with engine.transaction(write=False):
                return job(engine)

        return await self._database.read(read)


def _prove(hook: Hook, secret: str, headers: Mapping[str, str], body: bytes, *, now_s: float, skew_s: float) -> None:
    """HookRefusedError unless it comes from who has the secret, now."""
    if not secret:
        raise HookRefusedError("the hook has no secret: rotate it")
    if hook.auth == "bearer":
        said = headers.get("authorization", "").removeprefix("Bearer ")
        if not hmac.compare_digest(said.encode(), secret.encode()):
            raise HookRefusedError("Authorization: Bearer does not name the hook's secret")
        return
    message, text = headers.get("webhook-id", ""), headers.get("webhook-timestamp", "")
    if not (0 < len(message) <= HEADER_CHARS and message.isprintable()):
        raise HookRefusedError("webhook-id is missing, or too long")
    if not text.isdigit() or len(text) > 12 or abs(now_s - int(text)) > skew_s:
        raise HookRefusedError(f"webhook-timestamp is missing, or more than {skew_s:g} s off")
    wanted = signature(signing_key(secret), body, message=message, at_s=int(text))
    signatures = headers.get("webhook-signature", "").split(" ")[:8]
    if not any(hmac.compare_digest(one.encode(), wanted.encode()) for one in signatures):
        raise HookRefusedError("webhook-signature is not of this body, id and time by the hook's secret")


def _gateway_event(hook: Hook, headers: Mapping[str, str], said: Any, now_ns: int) -> GatewayEvent:
    kept = {name: headers[name][:HEADER_CHARS] for name in KEPT_HEADERS if name in headers}
    given = headers.get("webhook-id", "")
    usable = 0 < len(given) <= HEADER_CHARS and given.isprintable()
    return GatewayEvent(
        id=given if usable else new_command_id(now_ns),
        type=WEBHOOK,
        source=f"metaros.webhook/{hook.name}",
        at_ns=now_ns,
        robot=hook.robot,
        data={"hook": hook.name, "headers": kept, "body": said},
    )
