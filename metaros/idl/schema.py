"""Interfaces as "ros2msg" text: what MCAP files, Foxglove and our own channels carry as schema."""

from __future__ import annotations

from metaros.errors import DefinitionError
from metaros.idl.catalogue import Catalogue, default_catalogue, parse_definition
from metaros.idl.definitions import Definition, Field, MessageDefinition, ServiceDefinition
from metaros.idl.literals import format_literal

__all__ = ["add_schema_text", "definition_text", "schema_text"]

_SEPARATOR = "=" * 80


def definition_text(definition: Definition) -> str:
    """The interface alone, in the format it would be parsed from."""
    if isinstance(definition, MessageDefinition):
        return _message_text(definition)
    parts: tuple[MessageDefinition, ...]
    if isinstance(definition, ServiceDefinition):
        parts = (definition.request, definition.response)
    else:
        parts = (definition.goal, definition.result, definition.feedback)
    return "---\n".join(_message_text(part) for part in parts)


def schema_text(name: str, catalogue: Catalogue | None = None) -> str:
    """The message `name`, then every message it is made of under a `MSG: package/Name` title."""
    home = (catalogue or default_catalogue()).home(name)
    return home.memo("schema", name, lambda: _schema(name, home))


def add_schema_text(name: str, text: str, catalogue: Catalogue) -> None:
    """Learn the message `name` and its parts from such a text; all or nothing is added."""
    definitions = [parse_definition(part, title) for title, part in _sections(name, text)]
    trial = Catalogue(base=catalogue)
    trial.add_all(definitions)
    trial.dependencies(name)
    catalogue.add_all([item for item in definitions if item.name not in catalogue or catalogue.get(item.name) != item])


def _schema(name: str, catalogue: Catalogue) -> str:
    parts = [_message_text(catalogue.message(name))]
    for part in catalogue.dependencies(name):
        package, kind, short = part.split("/")
        title = f"{package}/{short}" if kind == "msg" else part
        parts.append(f"{_SEPARATOR}\nMSG: {title}\n{_message_text(catalogue.message(part))}")
    return "".join(parts)


def _message_text(definition: MessageDefinition) -> str:
    lines = [
        f"{item.type.text()} {item.name}={format_literal(item.type.base, item.value)}" for item in definition.constants
    ]
    lines += [_field_text(field) for field in definition.fields]
    return "".join(f"{line}\n" for line in lines)


def _field_text(field: Field) -> str:
    text = f"{field.type.text()} {field.name}"
    return text if field.default is None else f"{text} {format_literal(field.type.base, field.default)}"


def _sections(name: str, text: str) -> list[tuple[str, str]]:
    sections: list[tuple[str, list[str]]] = [(name, [])]
    lines = iter(text.splitlines())
    for line in lines:
        if len(line) >= 3 and not line.strip("="):
            title = next(lines, "")
            if not title.startswith("MSG: "):
                raise DefinitionError(
                    f"the schema of {name}: expected `MSG: package/Name` after the ===, found {title[:60]!r}"
                )
            sections.append((_full_name(title[5:].strip()), []))
        else:
            sections[-1][1].append(line)
    return [(title, "\n".join(body)) for title, body in sections]


def _full_name(title: str) -> str:
    parts = title.split("/")
    return f"{parts[0]}/msg/{parts[1]}" if len(parts) == 2 else title
