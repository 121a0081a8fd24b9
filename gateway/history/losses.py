"""Losses of samples in API responses: when, how many, why, of which topic. Pure."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

__all__ = ["MAX_LOSSES", "Loss", "loss_view", "merged_losses"]

MAX_LOSSES = 1000  # in one answer


@dataclass(frozen=True, slots=True, kw_only=True)
class Loss:
    """`count` samples that are not stored; `topic` None: metric rows, or a channel that nobody remembers."""

    from_ns: int
    to_ns: int
    count: int
    reason: str
    topic: str | None


def merged_losses(losses: Iterable[Loss], *, within_ns: int = 0, most: int = MAX_LOSSES) -> list[Loss]:
    """In order of time, those of one topic and reason that are no further apart than `within_ns` as one; the newest."""
    open_: dict[tuple[str | None, str], Loss] = {}
    done: list[Loss] = []
    for loss in sorted(losses, key=lambda item: item.from_ns):
        key = (loss.topic, loss.reason)
        before = open_.get(key)
        if before is not None and loss.from_ns - before.to_ns <= within_ns:
            to_ns, count = max(before.to_ns, loss.to_ns), before.count + loss.count
            open_[key] = replace(before, to_ns=to_ns, count=count)
            continue
        if before is not None:
            done.append(before)
        open_[key] = loss
    done += open_.values()
    return sorted(done, key=lambda item: (item.from_ns, item.to_ns))[-most:]


def loss_view(loss: Loss) -> dict[str, Any]:
    """A loss as JSON."""
    return {
        "from_ms": loss.from_ns / 1e6,
        "to_ms": loss.to_ns / 1e6,
        "count": loss.count,
        "reason": loss.reason,
        "topic": loss.topic,
    }
