"""Types that a command names: the catalogue's, else asked of the nodes that use them, or of a robot's gateway."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from metaros.errors import UnavailableError, UnknownTypeError

if TYPE_CHECKING:
    from metaros.cli.graph_target.target import GraphTarget
    from metaros.idl import Catalogue
    from metaros.node import Node

__all__ = ["ShownInterface", "find_shown"]

_KINDS = ("msg", "srv", "action")
_ASK_S = 2.0  # for each node that is asked what its type is


class ShownInterface(NamedTuple):
    """A type, where it is defined, and who told it; "" for the catalogue."""

    name: str
    catalogue: Catalogue
    told_by: str = ""


def find_shown(target: GraphTarget, typed: str) -> ShownInterface:
    """The type that is meant by "pkg/Name" or "pkg/kind/Name"; UnknownTypeError, with near matches, where nobody knows.

    With a robot it is as the robot has it.
    """
    from metaros.idl import default_catalogue

    if target.robot is not None:
        return _of_robot(target, typed)
    shipped = default_catalogue()
    known = next((name for name in _names(typed) if name in shipped), None)
    if known is not None:
        return ShownInterface(known, shipped)
    return _of_nodes(target, typed)


def _names(typed: str) -> list[str]:
    package, *rest = typed.split("/")
    return [f"{package}/{kind}/{rest[0]}" for kind in _KINDS] if len(rest) == 1 else [typed]


def _of_nodes(target: GraphTarget, typed: str) -> ShownInterface:
    from metaros.cli.shared.types import full_type
    from metaros.node import Node

    try:
        full_type(typed, "msg")
    except UnknownTypeError as error:
        unknown = error
    try:
        with (
            target.connect() as context,
            Node("metaros_cli", context=context, enable_rosout=False, enable_parameters=False) as node,
        ):
            return _ask(node, typed, unknown)
    except UnavailableError as error:
        where = str(error).partition("\n")[0]
        raise UnknownTypeError(f"{unknown}\nnodes that may know it could not be asked: {where}") from None


def _ask(node: Node, typed: str, unknown: UnknownTypeError) -> ShownInterface:
    from metaros.node.introspection import find_interface, hash_in_use

    name = next((name for name in _names(typed) if hash_in_use(node, name)), None)
    if name is None:
        raise UnknownTypeError(f"{unknown}\nand no node that is there now uses it") from None
    found = find_interface(node, name, timeout_s=_ASK_S)
    return ShownInterface(found.name, found.catalogue, found.told_by)


def _of_robot(target: GraphTarget, typed: str) -> ShownInterface:
    from metaros.cli.remote.interfaces import find_remote_interface

    assert target.robot is not None
    problem: UnknownTypeError | None = None
    for name in _names(typed):
        try:
            catalogue, told = find_remote_interface(target.robot, name)
        except UnknownTypeError as error:
            problem = problem or error
            continue
        return ShownInterface(name, catalogue, f"robot {target.robot.robot}" if told else "")
    assert problem is not None
    raise problem
