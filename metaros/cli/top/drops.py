"""Subscriptions of the domain that drop or lose messages, queried from their processes.

Only Meta-ROS contexts answer; a peer's answer is data from outside, so each row is checked and the count is bounded.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from metaros.cli.shared.output import human_bytes
from metaros.limits import LIMITS

if TYPE_CHECKING:
    from metaros.wire import WireSession

__all__ = ["DROP_COLUMNS", "DropRow", "ask", "drop_cells", "drop_rows"]

DROP_COLUMNS = ("Subscription", "Topic", "Waiting", "Size", "Dropped", "Lost", "Expired", "Malformed")
_PATIENCE_S = 1.0


@dataclass(frozen=True, slots=True)
class DropRow:
    """One subscription; None: `queued` where its process cannot tell, `depth` where it keeps all."""

    node: str
    topic: str
    depth: int | None
    queued: int | None
    queued_bytes: int | None
    dropped: int
    lost: int
    expired: int
    malformed: int

    @property
    def missing(self) -> int:
        """Messages that did not reach the callback."""
        return self.dropped + self.lost + self.expired + self.malformed


def ask(session: WireSession) -> list[bytes]:
    """What every context of the domain answers; waits until all have, a second at most."""
    import zenoh

    replies = session.check_open().get(
        f"@metaros/{session.domain}/*/subscriptions",
        timeout=_PATIENCE_S,
        congestion_control=zenoh.CongestionControl.DROP,
        consolidation=zenoh.ConsolidationMode.NONE,
    )
    return [reply.ok.payload.to_bytes() for reply in replies if reply.ok is not None]


def drop_rows(answers: Iterable[bytes], *, word: str = "") -> tuple[DropRow, ...]:
    """The rows that can be read and whose node or topic contains `word`: who misses most first."""
    rows = []
    for answer in answers:
        try:
            found = json.loads(answer)
        except ValueError:
            continue
        for item in found[: LIMITS.subscription_rows] if isinstance(found, list) else ():
            row = _row(item)
            if row is not None and (word in row.node or word in row.topic):
                rows.append(row)
    return tuple(sorted(rows, key=lambda row: (-row.missing, row.node, row.topic)))


def _row(item: Any) -> DropRow | None:
    try:
        names = [str(item[name])[: LIMITS.ros_name_chars] for name in ("node", "topic")]
        maybe = [None if item[name] is None else int(item[name]) for name in ("depth", "queued", "queued_bytes")]
        counts = [int(item[name]) for name in ("dropped", "lost", "expired", "malformed")]
    except (TypeError, KeyError, ValueError, OverflowError):
        return None
    return DropRow(names[0], names[1], maybe[0], maybe[1], maybe[2], *counts)


def drop_cells(row: DropRow) -> tuple[str, ...]:
    """A subscription in words; a dash for none."""
    waiting = "–" if row.queued is None else f"{row.queued}/{'all' if row.depth is None else row.depth}"
    size = human_bytes(row.queued_bytes) if row.queued_bytes else "–"
    counts = (f"{count:,}" if count else "–" for count in (row.dropped, row.lost, row.expired, row.malformed))
    return row.node, row.topic, waiting, size, *counts
