"""A change of an alert that the registry hands to the store."""

from __future__ import annotations

from dataclasses import dataclass

from gateway.domain.alert import Alert

__all__ = ["Change"]


@dataclass(frozen=True, slots=True)
class Change:
    """An alert to store over the revision it has, and what is told of it then."""

    alert: Alert
    news: tuple[str, ...]
