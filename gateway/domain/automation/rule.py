"""A rule as it is stored: its document, whose it is, and what it has done."""

from __future__ import annotations

from dataclasses import dataclass

from gateway.domain.principal import Kind, Principal, Role, in_scope

__all__ = ["SECRET", "Hook", "Maker", "NextFire", "RuleEntry", "RuleState", "RuleStats", "StoredRule"]

SECRET = "rule-secret"  # the purpose under which secrets of hooks and targets are sealed


@dataclass(frozen=True, slots=True, kw_only=True)
class Maker:
    """Who made a rule, with the role and the robots that they had then: more it may not do."""

    kind: Kind
    id: str
    name: str
    role: str
    robots: tuple[str, ...]

    @classmethod
    def of(cls, principal: Principal) -> Maker:
        """Somebody as they are now."""
        return cls(
            kind=principal.kind,
            id=principal.id,
            name=principal.name or principal.id,
            role=principal.role.word,
            robots=principal.robots,
        )

    @property
    def sees_all(self) -> bool:
        """Whether no robot was out of their scope."""
        return "*" in self.robots

    def sees(self, robot: str) -> bool:
        """Whether an event about a robot is for their rules; one about none is for who sees all."""
        return in_scope(self.robots, robot) if robot else self.sees_all

    def principal(self, name: str) -> Principal:
        """Whoever acts in their place; `name` is for people to read."""
        return Principal(kind=self.kind, id=self.id, name=name, role=Role.of(self.role), robots=self.robots)


@dataclass(frozen=True, slots=True, kw_only=True)
class StoredRule:
    """A rule's row; `document` is JSON, `revision` a number that no other change of any rule has."""

    name: str
    revision: int
    document: str
    maker: Maker
    changed_ns: int


@dataclass(frozen=True, slots=True, kw_only=True)
class RuleEntry:
    """One change of a rule; `what` is created, changed, enabled, disabled or deleted."""

    revision: int
    what: str
    by: str
    at_ns: int
    document: str


@dataclass(frozen=True, slots=True, kw_only=True)
class RuleStats:
    """What a rule has done since it was made; `error` is what went wrong last."""

    matched: int = 0
    fired: int = 0
    errors: int = 0
    fired_ns: int = 0
    error: str = ""
    error_ns: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class RuleState:
    """What a rule remembers of one group. `token` says of which `when` it is; `state` and `last` (the event that
    a timer would fire on) are JSON; `revision` 0 is a row that is not there yet; `due_ns` 0 is no timer.
    """

    rule: str
    group: str
    token: str
    state: str
    last: str = ""
    due_ns: int = 0
    revision: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class NextFire:
    """When a rule's schedule fires next, and fired last; `token` says which schedule that is. 0 is never."""

    rule: str
    token: str
    next_ns: int
    last_ns: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class Hook:
    """An endpoint for others' webhooks. `auth` is "signature" or "bearer"; `robot` is whom its events are about, or "".

    `made_by` made it; `robots` is their scope then. `accepted` and `refused` count, `used_ns` is when one came last.
    """

    name: str
    description: str
    auth: str
    robot: str
    made_by: str
    robots: tuple[str, ...]
    made_ns: int
    accepted: int = 0
    refused: int = 0
    used_ns: int = 0
