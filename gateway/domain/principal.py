"""The caller of a request: a person, a program with a key, a robot, or anonymous; its role and its robots."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import IntEnum
from functools import lru_cache
from typing import Literal

from metaros.errors import NameError_
from metaros.idl.globs import Glob

__all__ = ["EVERY_ROBOT", "NOBODY", "Kind", "Principal", "Role", "anonymous_viewer", "check_robots", "in_scope"]

Kind = Literal["anonymous", "user", "key", "robot"]
EVERY_ROBOT = ("*",)


class Role(IntEnum):
    """Roles in order: each may do all that the one before may."""

    NONE = 0  # what is public, nothing else
    VIEWER = 1
    OPERATOR = 2
    ADMIN = 3

    @property
    def word(self) -> str:
        """The role as people, tables and JSON write it: "viewer"."""
        return self.name.lower()

    @classmethod
    def of(cls, word: str) -> Role:
        """The role of a word; ValueError for "none" and for what is no role."""
        found = {role.word: role for role in cls if role}.get(word)
        if found is None:
            raise ValueError(f"{word[:40]!r} is no role: viewer, operator or admin")
        return found


@dataclass(frozen=True, slots=True, kw_only=True)
class Principal:
    """Made by an authenticator from a credential; valid for the one request or socket it came with.

    `session_id` and `csrf` belong to a browser's session; they are empty for keys, robots and nobody. `id` names the
    user, key or robot for ever; `name` is for people to read. `scopes` are a key's further rights, such as "lambda".
    """

    kind: Kind
    id: str = ""
    name: str = ""
    role: Role = Role.NONE
    robots: tuple[str, ...] = ()
    scopes: frozenset[str] = frozenset()
    session_id: str = ""
    csrf: str = ""

    def sees(self, robot_id: str) -> bool:
        """Whether the robot is in scope: for everybody else it does not exist."""
        return in_scope(self.robots, robot_id)

    @property
    def sees_all(self) -> bool:
        """Whether no robot is out of scope, now or later."""
        return "*" in self.robots


NOBODY = Principal(kind="anonymous", name="anonymous")


def in_scope(patterns: tuple[str, ...], robot_id: str) -> bool:
    """Whether a robot is one of those that a principal's patterns let it see."""
    return "*" in patterns or any(_glob(pattern).matches(robot_id) for pattern in patterns)


def anonymous_viewer() -> Principal:
    """Somebody unknown on this very machine, where the settings let them look."""
    return Principal(kind="anonymous", name="anonymous", role=Role.VIEWER, robots=EVERY_ROBOT)


def check_robots(patterns: Iterable[str]) -> tuple[str, ...]:
    """Patterns over robot ids as a principal keeps them; ValueError for one that is none."""
    kept = tuple(dict.fromkeys(patterns))
    for pattern in kept:
        try:
            _glob(pattern)
        except NameError_ as error:
            raise ValueError(str(error)) from error
    return kept


@lru_cache(maxsize=4096)
def _glob(pattern: str) -> Glob:
    return Glob(pattern)
