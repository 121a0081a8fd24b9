"""Posts what a rule gives to a URL, signed as Standard Webhooks has it; to nowhere inside unless a setting says so."""

from __future__ import annotations

import asyncio
import ssl
from collections.abc import Callable, Sequence
from urllib.parse import urlsplit

import h11

from gateway.automation.rules.secrets import Secrets, target_owner
from gateway.automation.rules.targets.calls import Calls, RuleContext
from gateway.domain.automation.delivery import Dead, Delivery, Done, Result, Retry
from gateway.domain.automation.event import like
from gateway.outbound.webhook import JSON, Webhook, post, signing_key
from metaros.clock import Clock
from metaros.limits import LIMITS

__all__ = ["HINT", "WebhookTarget"]

HINT = ": --webhook-private HOST lets rules post there"
GONE = (400, 401, 403, 404, 405, 410, 413, 415, 422)  # trying again will not help


class WebhookTarget:
    """A handler of the queue."""

    def __init__(
        self,
        secrets: Secrets,
        *,
        clock: Clock,
        private_hosts: Sequence[str] = (),
        context: ssl.SSLContext | None = None,
        make_context: Callable[[], ssl.SSLContext] = ssl.create_default_context,
    ) -> None:
        """`private_hosts` are globs of names that may be in a private network, and be spoken to without TLS."""
        self._calls = Calls()
        self.room, self.timeout_s, self.ended = self._calls.room, self._calls.timeout_s, self._calls.ended
        self._secrets = secrets
        self._clock = clock
        self._private_hosts = tuple(private_hosts)
        self._context = context
        self._make_context = make_context

    async def deliver(self, delivery: Delivery) -> Result:
        """One POST; the delivery's id is the message's, so that the receiver knows a second one for what it is."""
        rule_context = RuleContext(delivery)
        url = str(rule_context.fields["url"])
        parts = urlsplit(url)
        private = any(like(str(parts.hostname), glob) for glob in self._private_hosts)
        if parts.scheme != "https" and not private:
            return Dead("webhook_insecure", f"{parts.hostname} is plain http{HINT}")
        with self._calls.counted():
            secret = await self._secrets.find(target_owner(rule_context.rule, rule_context.target))
            webhook = Webhook(
                url=url,
                secret=signing_key(secret) if secret else b"",
                private=private,
                context=await self._trust() if parts.scheme == "https" else None,
            )
            return await self._post(webhook, delivery)

    async def _post(self, webhook: Webhook, delivery: Delivery) -> Result:
        at_s = self._clock.wall_ns() // 10**9
        try:
            async with asyncio.timeout(LIMITS.target_s):
                status = await post(
                    webhook, delivery.put.payload, message=delivery.id, at_s=at_s, content_type=JSON, hint=HINT
                )
        except TimeoutError:
            return Retry("webhook_timeout", f"no answer in {LIMITS.target_s:g} s")
        except (OSError, ValueError, h11.ProtocolError) as error:  # ValueError: a name that is none for TLS
            return Retry("webhook_unreachable", str(error) or type(error).__name__)
        if 200 <= status < 300:
            return Done(f"{status}")
        if status in GONE:
            return Dead("webhook_refused", f"the receiver answers {status}")
        return Retry("webhook_failed", f"the receiver answers {status}", counts=status not in (429, 503))

    async def _trust(self) -> ssl.SSLContext:
        """Made once, on a thread: reading the system's roots takes long enough to be felt on the event loop."""
        if self._context is None:
            self._context = await asyncio.to_thread(self._make_context)
        return self._context
