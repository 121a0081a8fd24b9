"""`metaros interface`: what the catalogue knows of message, service and action types."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated

import typer

from metaros.cli.options import Format, FormatOption

if TYPE_CHECKING:
    from metaros.idl import MessageDefinition

__all__ = ["register"]

group = typer.Typer(name="interface", no_args_is_help=True, help="Message, service and action types.")


def register(app: typer.Typer) -> None:
    """Add the noun."""
    app.add_typer(group)


@group.command("list")
def list_(
    word: Annotated[str, typer.Argument(metavar="WORD", help="Only names that contain this.")] = "",
    messages: Annotated[bool, typer.Option("--only-msgs", "-m", help="Only messages.")] = False,
    services: Annotated[bool, typer.Option("--only-srvs", "-s", help="Only services.")] = False,
    actions: Annotated[bool, typer.Option("--only-actions", "-a", help="Only actions.")] = False,
    output: FormatOption = Format.TEXT,
) -> None:
    """List the types of the catalogue."""
    from metaros.cli.output import Output
    from metaros.idl import default_catalogue

    wanted = {kind for kind, on in (("msg", messages), ("srv", services), ("action", actions)) if on}
    names = default_catalogue().names()
    found = [name for name in names if word.lower() in name.lower() and (not wanted or name.split("/")[1] in wanted)]
    out = Output(output)
    if out.json:
        out.objects(found)
    else:
        out.line("\n".join(found))


@group.command("show")
def show(
    type_name: Annotated[str, typer.Argument(metavar="TYPE", help="Such as std_msgs/String or std_srvs/srv/Trigger.")],
    output: FormatOption = Format.TEXT,
) -> None:
    """Show a type's fields, nested ones indented below theirs, and its hash."""
    from metaros.cli.output import Output
    from metaros.cli.types import full_type
    from metaros.idl import default_catalogue, type_hash

    kinds = ("msg", "srv", "action")
    names = default_catalogue()
    package, *rest = type_name.split("/")
    kind = next((kind for kind in kinds if len(rest) == 1 and f"{package}/{kind}/{rest[0]}" in names), "msg")
    full = full_type(type_name, kind)
    out = Output(output)
    if out.json:
        from metaros.idl.schema import definition_text

        out.objects({"name": full, "hash": type_hash(full), "definition": definition_text(names.get(full))})
        return
    out.line(out.style(f"# {full}  {type_hash(full)}", "2"))
    for line in _interface(full):
        out.line(line)


def _interface(name: str) -> Iterator[str]:
    from metaros.idl import ActionDefinition, ServiceDefinition, default_catalogue

    definition = default_catalogue().get(name)
    parts: tuple[MessageDefinition, ...]
    match definition:
        case ServiceDefinition(request=request, response=response):
            parts = (request, response)
        case ActionDefinition(goal=goal, result=result, feedback=feedback):
            parts = (goal, result, feedback)
        case _:
            parts = (definition,)
    for number, part in enumerate(parts):
        if number:
            yield "---"
        yield from _message(part, "")


def _message(definition: MessageDefinition, indent: str) -> Iterator[str]:
    from metaros.idl import default_catalogue

    for constant in definition.constants:
        yield f"{indent}{constant.type.text()} {constant.name}={constant.value!r}"
    for field in definition.fields:
        default = f" {field.default!r}" if field.default is not None else ""
        yield f"{indent}{field.type.text()} {field.name}{default}"
        if field.type.is_nested:
            nested = default_catalogue().get(field.type.base)
            yield from _message(nested, indent + "\t")  # type: ignore[arg-type]  # fields are messages only
