"""Which targets have something waiting, and when the first of it is due: a guess that the store corrects. Pure.

What is not in it is found when the store is looked through again; what is in it for nothing costs one look-up.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

from gateway.store.automation.deliveries import LeaseRequest, Ready

__all__ = ["DueTargets"]

_Target = tuple[str, str]


class DueTargets:
    """Targets in the order in which their turn comes."""

    def __init__(self, *, most: int) -> None:
        self._most = most
        self._due_ns: dict[_Target, int] = {}

    def __len__(self) -> int:
        return len(self._due_ns)

    def note(self, rows: Iterable[Ready]) -> None:
        """Something of these waits; a full table learns of further ones when the store is looked through again."""
        for row in rows:
            key = (row.kind, row.target)
            known = self._due_ns.get(key)
            if known is not None or len(self._due_ns) < self._most:
                self._due_ns[key] = row.due_ns if known is None else min(known, row.due_ns)

    def lease_requests(
        self, kind: str, *, now_ns: int, room: int, of_target: Callable[[str], int]
    ) -> list[LeaseRequest]:
        """Room for so many deliveries of a kind, shared by the targets that have something due.

        They leave this table with that; what is left of them is noted when it is known, behind the others.
        """
        due = [target for (of, target), due_ns in self._due_ns.items() if of == kind and due_ns <= now_ns]
        found: list[LeaseRequest] = []
        left = room
        for place, target in enumerate(due):
            if left <= 0:
                break
            most = min(-(-left // (len(due) - place)), of_target(target))
            if most > 0:
                found.append(LeaseRequest(kind, target, most))
                del self._due_ns[kind, target]
                left -= most
        return found

    def next_ns(self, now_ns: int) -> int | None:
        """When the next of all will be due, beside those that are."""
        return min((due_ns for due_ns in self._due_ns.values() if due_ns > now_ns), default=None)
