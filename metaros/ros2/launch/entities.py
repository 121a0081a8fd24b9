"""What a launch file is made of: descriptions that hold entities, and actions, which do something."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, TypeAlias

__all__ = ["Action", "LaunchDescription", "LaunchDescriptionEntity", "SomeActionsType", "flatten"]


class LaunchDescriptionEntity:
    """Anything that may stand in a launch description."""

    def visit(self, context: Any) -> list[LaunchDescriptionEntity] | None:
        """Do what it does; the entities that come in its place."""
        return None

    def describe_sub_entities(self) -> list[LaunchDescriptionEntity]:
        """What it holds, without a launch."""
        return []


class LaunchDescription(LaunchDescriptionEntity):
    """What `generate_launch_description()` returns: entities in their order."""

    def __init__(
        self, initial_entities: Iterable[LaunchDescriptionEntity] | None = None, *, deprecated_reason: str | None = None
    ) -> None:
        self.entities = list(initial_entities or ())
        self.deprecated_reason = deprecated_reason

    def visit(self, context: Any) -> list[LaunchDescriptionEntity] | None:
        """Its entities."""
        return self.entities

    def describe_sub_entities(self) -> list[LaunchDescriptionEntity]:
        """Its entities."""
        return self.entities

    def add_action(self, action: LaunchDescriptionEntity) -> None:
        """One more at the end."""
        self.entities.append(action)

    add_entity = add_action

    def get_launch_arguments(self) -> list[Any]:
        """The declared arguments of this description and of all that it holds, each name once."""
        found: dict[str, Any] = {}
        pending: list[Any] = list(self.entities)
        while pending:
            entity = pending.pop(0)
            if hasattr(entity, "default_value") and hasattr(entity, "choices"):
                found.setdefault(entity.name, entity)
            pending[:0] = entity.describe_sub_entities()
        return list(found.values())


class Action(LaunchDescriptionEntity):
    """An entity that does something, unless its condition says no. Subclasses have `execute`."""

    def __init__(self, *, condition: Any = None) -> None:
        self.condition = condition

    def visit(self, context: Any) -> list[LaunchDescriptionEntity] | None:
        """Execute it, where its condition holds."""
        if self.condition is not None and not self.condition.evaluate(context):
            return None
        return self.execute(context)

    def execute(self, context: Any) -> list[LaunchDescriptionEntity] | None:
        """Do it; entities that come next."""
        return None

    def describe(self) -> str:
        """For messages."""
        return f"{type(self).__name__}()"


SomeActionsType: TypeAlias = "LaunchDescriptionEntity | Iterable[LaunchDescriptionEntity] | None"


def flatten(entities: SomeActionsType) -> list[LaunchDescriptionEntity]:
    """One, several or none, as a list."""
    if entities is None:
        return []
    return [entities] if isinstance(entities, LaunchDescriptionEntity) else list(entities)
