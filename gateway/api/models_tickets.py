"""Tickets in the API's documents."""

from __future__ import annotations

from pydantic import ConfigDict, Field

from gateway.api.model_base import Exact
from gateway.api.models_identity import RoleWord
from metaros.limits import LIMITS

__all__ = ["Ticket", "TicketRequest"]


class TicketRequest(Exact):
    """What the ticket may do at most; without robots, all that its maker sees."""

    model_config = ConfigDict(json_schema_extra={"example": {"robots": ["r1"], "ttl_s": 3600.0}})

    robots: list[str] | None = Field(default=None, min_length=1, max_length=LIMITS.robot_patterns)
    role: RoleWord = "viewer"
    ttl_s: float = Field(default=3600.0, ge=1.0, le=LIMITS.ticket_s, description="how long it is good, seconds")


class Ticket(Exact):
    """A bearer for viewers' sockets: `ws://…/foxglove?token=TICKET`."""

    model_config = ConfigDict(json_schema_extra={"example": {"ticket": "mrt_…", "expires": "2026-11-22T12:00:00Z"}})

    ticket: str
    expires: str
