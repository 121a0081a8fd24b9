"""`metaros interface`: what the catalogue knows of message, service and action types."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated, Any

import typer

from metaros.cli.graph_target.target import GraphTarget, graph_command
from metaros.cli.shared.options import Format, FormatOption
from metaros.errors import UnknownTypeError

if TYPE_CHECKING:
    from metaros.cli.graph_target.interfaces import ShownInterface
    from metaros.idl import Catalogue, MessageDefinition

__all__ = ["register"]

group = typer.Typer(name="interface", no_args_is_help=True, help="Message, service and action types.")


TypeArgument = Annotated[str, typer.Argument(metavar="TYPE", help="Such as std_msgs/String or std_srvs/srv/Trigger.")]
OnlyMessages = Annotated[bool, typer.Option("--only-msgs", "-m", help="Only messages.")]
OnlyServices = Annotated[bool, typer.Option("--only-srvs", "-s", help="Only services.")]
OnlyActions = Annotated[bool, typer.Option("--only-actions", "-a", help="Only actions.")]


def register(app: typer.Typer) -> None:
    """Add the noun."""
    app.add_typer(group)


@group.command("list")
def list_(
    word: Annotated[str, typer.Argument(metavar="WORD", help="Only names that contain this.")] = "",
    messages: OnlyMessages = False,
    services: OnlyServices = False,
    actions: OnlyActions = False,
    output: FormatOption = Format.TEXT,
) -> None:
    """List the types of the catalogue."""
    from metaros.cli.shared.output import Output

    names = _names(messages=messages, services=services, actions=actions)
    found = [name for name in names if word.lower() in name.lower()]
    Output(output).names(found)
    if not found:
        raise UnknownTypeError(
            f"no interface whose name contains {word!r}\n`metaros interface packages` shows where to look"
        )


@group.command("packages")
def packages(
    messages: OnlyMessages = False,
    services: OnlyServices = False,
    actions: OnlyActions = False,
    output: FormatOption = Format.TEXT,
) -> None:
    """List the packages that have interfaces."""
    from metaros.cli.shared.output import Output

    names = _names(messages=messages, services=services, actions=actions)
    Output(output).names(sorted({name.split("/")[0] for name in names}))


@group.command("package")
def package(
    name: Annotated[str, typer.Argument(metavar="PACKAGE", help="Such as sensor_msgs.")],
    output: FormatOption = Format.TEXT,
) -> None:
    """List the interfaces of one package."""
    from metaros.cli.shared.connection import closest
    from metaros.cli.shared.output import Output

    names = _names()
    found = [full for full in names if full.startswith(f"{name}/")]
    if not found:
        hint = closest(name, {full.split("/")[0] for full in names}) or "`metaros interface packages` shows all"
        raise UnknownTypeError(f"no package {name!r} in the catalogue\n{hint}")
    Output(output).names(found)


@group.command("proto")
@graph_command
def proto(
    target: GraphTarget,
    type_name: TypeArgument,
    no_quotes: Annotated[bool, typer.Option("--no-quotes", help="Without the quotes around it.")] = False,
) -> None:
    """Print a message with its default values, to copy, change and publish; of a service or action what one sends."""
    from metaros.cli.shared.render import message_yaml, plain
    from metaros.idl import message_class

    found, out = _find(target, type_name), target.out
    full = found.name
    kind: Any = message_class(full, found.catalogue)
    message = (kind.Request if "/srv/" in full else kind.Goal if "/action/" in full else kind)()
    if out.json:
        out.objects(plain(message))
    else:
        text = message_yaml(message, full=True)
        out.line(text if no_quotes else f'"{text}\n"')


@group.command("hash")
@graph_command
def hash_(target: GraphTarget, type_name: TypeArgument) -> None:
    """Print a type's RIHS01 hash; of a service or action the hashes of all that goes over the wire."""
    from metaros.idl import type_hash

    found, out = _find(target, type_name), target.out
    full = found.name
    names = (full, *(f"{full}{suffix}" for suffix in _on_the_wire(full)))
    hashes = {name: type_hash(name, found.catalogue) for name in names}
    if out.json:
        out.objects(hashes)
    elif len(hashes) == 1:
        out.line(hashes[full])
    else:
        out.table(("Type", "Hash"), hashes.items())


@group.command("show")
@graph_command
def show(target: GraphTarget, type_name: TypeArgument) -> None:
    """Show a type's fields, nested ones below theirs, and its hash; running nodes are asked what is not known here."""
    from metaros.idl import type_hash

    found, out = _find(target, type_name), target.out
    full, catalogue = found.name, found.catalogue
    if out.json:
        from metaros.idl.schema import definition_text

        text = definition_text(catalogue.get(full))
        source = {"told_by": found.told_by} if found.told_by else {}
        out.objects({"name": full, "hash": type_hash(full, catalogue), "definition": text, **source})
        return
    out.line(out.style(f"# {full}  {type_hash(full, catalogue)}", "2"))
    if found.told_by:
        out.line(out.style(f"# told by {found.told_by}", "2"))
    for line in _interface(full, catalogue):
        out.line(line)


def _find(target: GraphTarget, type_name: str) -> ShownInterface:
    """A type as typed, `std_msgs/String` or `std_srvs/Trigger`: of the catalogue, else asked for."""
    from metaros.cli.graph_target.interfaces import find_shown

    return find_shown(target, type_name)


def _names(*, messages: bool = False, services: bool = False, actions: bool = False) -> list[str]:
    """All interfaces of the catalogue, or those of the kinds asked for."""
    from metaros.idl import default_catalogue

    wanted = {kind for kind, on in (("msg", messages), ("srv", services), ("action", actions)) if on}
    return [name for name in default_catalogue().names() if not wanted or name.split("/")[1] in wanted]


def _on_the_wire(name: str) -> tuple[str, ...]:
    """What is sent for a type: a service's messages, an action's services and topic."""
    if "/srv/" in name:
        return ("_Request", "_Response", "_Event")
    return ("_SendGoal", "_GetResult", "_FeedbackMessage") if "/action/" in name else ()


def _interface(name: str, catalogue: Catalogue) -> Iterator[str]:
    from metaros.idl import ActionDefinition, ServiceDefinition

    definition = catalogue.get(name)
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
        yield from _message(part, "", catalogue)


def _message(definition: MessageDefinition, indent: str, catalogue: Catalogue) -> Iterator[str]:
    for constant in definition.constants:
        yield f"{indent}{constant.type.text()} {constant.name}={constant.value!r}"
    for field in definition.fields:
        default = f" {field.default!r}" if field.default is not None else ""
        yield f"{indent}{field.type.text()} {field.name}{default}"
        if field.type.is_nested:
            yield from _message(catalogue.message(field.type.base), indent + "\t", catalogue)
