"""A publisher's second voice: what it publishes goes out on its twin key, too, while somebody there listens."""

from __future__ import annotations

import threading
from collections.abc import Callable
from contextlib import suppress
from typing import Any, Final

import zenoh
import zenoh.ext

__all__ = ["PublisherTwin", "Put", "both"]

Put = Callable[..., None]
_REPLAY_S: Final = 1.0  # for our own cache to tell what it has


class PublisherTwin:
    """For `Endpoint.speak_both`. `declare(key)` makes a publisher; `also(put)` has each sample put there, too.

    What a transient_local publisher keeps (`depth` samples, else 0) is published there first, as it was published.
    """

    def __init__(
        self,
        session: zenoh.Session,
        key: str,
        *,
        declare: Callable[[str], zenoh.Publisher | zenoh.ext.AdvancedPublisher],
        also: Callable[[Put | None], None],
        depth: int,
    ) -> None:
        self._session, self._key, self._depth = session, key, depth
        self._declare, self._also = declare, also
        self._put: Put | None = None

    def open(self, key: str) -> None:
        """Declare it; what is kept is told at once."""
        put = self._put = self._declare(key).put
        if self._depth:
            self._replay(put)

    def present(self, others: bool) -> None:
        """Somebody there listens, or nobody any more. A latched publisher goes on: whoever comes is to find it all."""
        if others or not self._depth:
            self._also(self._put if others else None)

    def _replay(self, put: Put) -> None:
        """From our own cache; what is published meanwhile comes behind it."""
        meanwhile: list[tuple[Any, bytes]] = []
        lock, live = threading.Lock(), False

        def keep(payload: Any, *, attachment: bytes) -> None:
            with lock:
                if not live:
                    meanwhile.append((payload, attachment))
                    return
            put(payload, attachment=attachment)  # a thread that began to publish before

        self._also(keep)
        kept = self._kept()
        with lock:
            late = {attachment for _, attachment in meanwhile}
            for payload, attachment in [*(item for item in kept if item[1] not in late), *meanwhile]:
                put(payload, attachment=attachment)
            live = True
        self._also(put)

    def _kept(self) -> list[tuple[bytes, bytes]]:
        """Payloads and attachments, the oldest first."""
        kept = []
        where = f"{self._key}/@adv/pub/{self._session.info.zid()}/**?_anyke;_max={self._depth}"
        with suppress(zenoh.ZError):
            for reply in self._session.get(where, timeout=_REPLAY_S):
                sample = reply.ok
                if sample is not None and sample.attachment is not None:
                    kept.append((sample.payload.to_bytes(), sample.attachment.to_bytes()))
        return sorted(kept, key=lambda item: int.from_bytes(item[1][:8], "little"))


def both(first: Put, second: Put) -> Put:
    """Puts a sample here and there."""

    def put(payload: Any, *, attachment: bytes) -> None:
        if payload.__class__ is not bytes:
            payload = zenoh.ZBytes(payload)  # shared memory can be handed over once only
        first(payload, attachment=attachment)
        second(payload, attachment=attachment)

    return put
