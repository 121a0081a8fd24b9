"""Field paths like "pose.pose.position.x" or "transforms[0].child": parsed, checked and merged into one tree."""

from __future__ import annotations

import re
from dataclasses import dataclass, field

from metaros.errors import FieldError
from metaros.idl import Catalogue, Field, FieldType
from metaros.idl.arrays import DTYPES

__all__ = ["Node", "path_tree"]

_SEGMENT = re.compile(r"([a-z][a-z0-9_]*)((?:\[[0-9]{1,9}\])?)\Z")
MAX_PATHS = 1024


@dataclass(slots=True)
class Node:
    """What is wanted below one field or element: its own value (`outputs`), members, or elements."""

    outputs: list[int] = field(default_factory=list)
    members: dict[str, Node] = field(default_factory=dict)
    elements: dict[int, Node] = field(default_factory=dict)

    def count(self) -> int:
        """How many values are wanted in total."""
        children = (*self.members.values(), *self.elements.values())
        return len(self.outputs) + sum(child.count() for child in children)


def path_tree(name: str, paths: list[str], catalogue: Catalogue) -> tuple[Node, list[str]]:
    """The tree of all `paths` into the message `name`, and the primitive type at the end of each."""
    if len(paths) > MAX_PATHS:
        raise FieldError(f"{len(paths)} paths, at most {MAX_PATHS} are allowed")
    root = Node()
    bases = [_insert(root, index, path, name, catalogue) for index, path in enumerate(paths)]
    return root, bases


def _insert(root: Node, index: int, path: str, name: str, catalogue: Catalogue) -> str:
    node, kind = root, FieldType(name)
    for segment in path.split("."):
        match = _SEGMENT.match(segment)
        if not match:
            raise FieldError(f"{path!r}: {segment!r} is no field, like `x` or `values[2]`")
        found = _member(path, match[1], kind, catalogue)
        node = node.members.setdefault(match[1], Node())
        kind = found.type
        if match[2]:
            position = int(match[2][1:-1])
            kind = _element(path, found, position)
            node = node.elements.setdefault(position, Node())
    if kind.array or kind.base not in DTYPES:
        raise FieldError(f"{path!r} of {name} is a {kind.text()}, not a number")
    node.outputs.append(index)
    return kind.base


def _member(path: str, name: str, kind: FieldType, catalogue: Catalogue) -> Field:
    if kind.array or not kind.is_nested:
        raise FieldError(f"{path!r}: {name!r} is looked for in a {kind.text()}, which has no fields")
    fields = catalogue.message(kind.base).fields
    for candidate in fields:
        if candidate.name == name:
            return candidate
    known = ", ".join(candidate.name for candidate in fields)
    raise FieldError(f"{path!r}: {kind.base} has no field {name!r}; its fields are: {known}")


def _element(path: str, found: Field, position: int) -> FieldType:
    if not found.type.array:
        raise FieldError(f"{path!r}: {found.name!r} is a {found.type.text()}, not an array")
    if found.type.capacity and position >= found.type.capacity:
        raise FieldError(f"{path!r}: {found.name!r} has at most {found.type.capacity} elements")
    return found.type.element
