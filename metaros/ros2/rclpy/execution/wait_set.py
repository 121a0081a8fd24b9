"""Wait sets in Python: what waitables of programs put there, and which of it is ready.

An entity is given by its handle, or as itself. Data of a subscription or service is handed out by the executor all the
same: a wait set tells that some is there, and takes none.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from metaros.executor import Mailbox

__all__ = ["WaitSet", "mailboxes_of"]

_KINDS = ("subscription", "guard_condition", "timer", "client", "service", "event")


def mailboxes_of(handle: Any) -> Sequence[Mailbox]:
    """Where what arrives for an endpoint of the library waits."""
    several: Sequence[Mailbox] | None = getattr(handle, "mailboxes", None)
    if several is not None:
        return several
    single = getattr(handle, "_mailbox", None)
    return () if single is None else (single,)


class WaitSet:
    """Entities by kind; each `add_` returns the index by which `is_ready` is asked.

    The arguments of the original, numbers of entities and a context, are taken and not needed.
    """

    def __init__(self, *_: object) -> None:
        self._entities: dict[str, list[Any]] = {kind: [] for kind in _KINDS}
        self._ready: dict[str, list[bool]] = {kind: [] for kind in _KINDS}

    def _add(self, kind: str, entity: Any) -> int:
        handle = getattr(entity, "handle", entity)
        self._entities[kind].append(handle)
        self._ready[kind].append(False)
        return len(self._entities[kind]) - 1

    def add_subscription(self, subscription: Any) -> int:
        """Ready when a message waits."""
        return self._add("subscription", subscription)

    def add_guard_condition(self, guard_condition: Any) -> int:
        """Ready when it was triggered since the last look."""
        return self._add("guard_condition", guard_condition)

    def add_timer(self, timer: Any) -> int:
        """Ready when it is due."""
        return self._add("timer", timer)

    def add_client(self, client: Any) -> int:
        """Ready when a response waits."""
        return self._add("client", client)

    def add_service(self, service: Any) -> int:
        """Ready when a request waits."""
        return self._add("service", service)

    def add_event(self, event: Any) -> int:
        """Ready when it happened since the last look."""
        return self._add("event", event)

    def clear_entities(self) -> None:
        """Empty it."""
        for kind in _KINDS:
            self._entities[kind].clear()
            self._ready[kind].clear()

    def look(self) -> float | None:
        """See what is ready, which answers triggers; for how many seconds nothing else can be by itself, None for ever.

        Executors call it, before they ask waitables.
        """
        waits: list[float] = []
        for kind, entities in self._entities.items():
            for index, entity in enumerate(entities):
                self._ready[kind][index] = _ready(kind, entity)
                if kind == "timer" and (patience_s := entity.patience_s()) is not None:
                    waits.append(patience_s)
        return min(waits, default=None)

    def is_ready(self, entity_type: str, index: int) -> bool:
        """Whether the entity that was added as this one is ready; ValueError of a kind that there is not."""
        if entity_type not in self._ready:
            raise ValueError(f"{entity_type!r} is no kind of entity; there are {', '.join(_KINDS)}")
        ready = self._ready[entity_type]
        return 0 <= index < len(ready) and ready[index]

    def get_ready_entities(self, entity_type: str) -> list[int]:
        """The pointers of the handles that are ready."""
        pairs = zip(self._entities[entity_type], self._ready[entity_type], strict=True)
        return [getattr(entity, "pointer", id(entity)) for entity, ready in pairs if ready]


def _ready(kind: str, entity: Any) -> bool:
    if kind == "timer":
        return bool(entity.is_timer_ready())
    if kind in ("guard_condition", "event"):
        triggered = bool(getattr(entity, "triggered", False))
        if triggered:
            entity.triggered = False
        return triggered
    return any(mailbox.pending for mailbox in mailboxes_of(entity))
