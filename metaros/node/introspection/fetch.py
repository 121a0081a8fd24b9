"""Fetches types that this program does not know from nodes that use them, by ROS 2's `~/get_type_description`.

What a peer tells is believed only if it leads to the hashes in the peer's own tokens. Who is asked what is a generator
of questions, which takes answers or errors: so that threads and coroutines ask alike.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Generator
from functools import partial
from typing import Any, Final, NamedTuple, TypeVar

from metaros.errors import MetarosError, TypeHashError, UnknownTypeError
from metaros.idl import Catalogue, catalogue_of, default_catalogue, message_class, type_hash
from metaros.node.client import Client, make_client
from metaros.node.core import NodeCore
from metaros.node.introspection.described import ACTION_PARTS, learn, learn_action, remember_action
from metaros.node.introspection.type_description import SERVICE
from metaros.node.introspection.users import ActionUser, action_users, hash_in_use, part_of, root_of, users_of

__all__ = [
    "TIMEOUT_S",
    "FoundInterface",
    "fetch_interface",
    "fetch_interface_async",
    "fetch_type",
    "fetch_type_async",
    "find_interface",
    "hash_in_use",
    "users_of",
]

TIMEOUT_S: Final = 5.0
_LOOK_S: Final = 0.05
_log = logging.getLogger("metaros.node")
T = TypeVar("T")


class FoundInterface(NamedTuple):
    """A type, where it is defined, and who told it: the full name of a node, "" for what was known before."""

    name: str
    catalogue: Catalogue
    told_by: str = ""


class _Question(NamedTuple):
    """What is asked of whom."""

    node: str
    type_name: str
    type_hash: str


_Conversation = Generator[_Question, Any, T]


def fetch_type(node: NodeCore, type_name: str, type_hash: str, *, timeout_s: float = TIMEOUT_S) -> Catalogue:
    """The catalogue that has the type with that very hash: the program's own, or what a node in the graph answers.

    Of an action it is "pkg/action/X_SendGoal" and the hash of that, which stand in the graph; the catalogue has the
    whole action. Blocks up to `timeout_s` for each node that uses the type. `UnknownTypeError` says whom it asked and
    what came; so do not call it on the executor that would have to answer.
    """
    return find_interface(node, type_name, type_hash, timeout_s=timeout_s).catalogue


async def fetch_type_async(
    node: NodeCore, type_name: str, type_hash: str, *, timeout_s: float = TIMEOUT_S
) -> Catalogue:
    """The same for coroutines."""
    known = _known(node, type_name, type_hash)
    if known is None:
        known = await _ask_all_async(node, _conversation(node, type_name, type_hash), timeout_s)
    return known.catalogue


def find_interface(
    node: NodeCore, type_name: str, type_hash: str = "", *, timeout_s: float = TIMEOUT_S
) -> FoundInterface:
    """As `fetch_type`, with who told it, and by its name alone: "pkg/action/X" is one, too.

    Without a hash it is the type as the program has it, else as the graph has it, in which it is waited for.
    """
    if not type_hash and type_name not in default_catalogue():
        node.graph.wait_for(lambda: bool(hash_in_use(node, type_name)), timeout_s)
    known = _known(node, type_name, type_hash)
    return _ask_all(node, _conversation(node, type_name, type_hash), timeout_s) if known is None else known


def fetch_interface(node: NodeCore, type_name: str, type_hash: str = "", *, timeout_s: float = TIMEOUT_S) -> type[Any]:
    """The class of what `find_interface` finds."""
    return message_class(type_name, find_interface(node, type_name, type_hash, timeout_s=timeout_s).catalogue)


async def fetch_interface_async(
    node: NodeCore, type_name: str, type_hash: str = "", *, timeout_s: float = TIMEOUT_S
) -> type[Any]:
    """The same for coroutines."""
    if not type_hash and type_name not in default_catalogue():
        for _ in range(round(timeout_s / _LOOK_S)):
            if hash_in_use(node, type_name):
                break
            await asyncio.sleep(_LOOK_S)
    known = _known(node, type_name, type_hash)
    if known is None:
        known = await _ask_all_async(node, _conversation(node, type_name, type_hash), timeout_s)
    return message_class(type_name, known.catalogue)


def _known(node: NodeCore, type_name: str, type_hash: str) -> FoundInterface | None:
    """What needs no question. An action that a node told is known if the nodes that have it now mean the same."""
    root = root_of(type_name)
    if not type_hash and type_name not in default_catalogue():
        type_hash = hash_in_use(node, type_name)
        if not type_hash:
            return None
    catalogue = catalogue_of(f"{root}_SendGoal" if root == type_name and type_hash else type_name, type_hash)
    if catalogue is None or (root and catalogue is not default_catalogue() and not _fits(node, type_name, catalogue)):
        return None
    return FoundInterface(type_name, catalogue)


def _fits(node: NodeCore, type_name: str, catalogue: Catalogue) -> bool:
    """Whether it has the action as one of its users has it: one goal may have two results."""
    root = root_of(type_name)
    if root not in catalogue:
        return False
    ours = {part: type_hash(root + part, catalogue) for part in ACTION_PARTS}
    users = action_users(node, type_name, ours[part_of(type_name)])
    return not users or any(user.hashes == ours for user in users)


# -- conversations -----------------------------------------------------------------------------------------------------


def _conversation(node: NodeCore, type_name: str, wanted_hash: str) -> _Conversation[FoundInterface]:
    root = root_of(type_name)
    if root:
        return _about_action(type_name, root, wanted_hash, action_users(node, type_name, wanted_hash))
    wanted_hash = wanted_hash or hash_in_use(node, type_name)
    return _about_type(type_name, wanted_hash, users_of(node, type_name, wanted_hash))


def _about_type(type_name: str, wanted_hash: str, users: list[str]) -> _Conversation[FoundInterface]:
    """A message or a service: each user is asked until one tells what has the hash."""
    problems = []
    for user in users:
        try:
            response = yield _Question(user, type_name, wanted_hash)
            return FoundInterface(type_name, learn(type_name, wanted_hash, response), user)
        except MetarosError as error:
            problems.append(_problem(user, error))
    raise _unknown(type_name, wanted_hash, problems)


def _about_action(
    type_name: str, root: str, wanted_hash: str, users: list[ActionUser]
) -> _Conversation[FoundInterface]:
    """An action by the parts that are in the graph; its own text, where the node has it, for constants and defaults."""
    problems = []
    for user in users:
        try:
            responses: dict[str, Any] = {}
            for part in ACTION_PARTS:
                responses[part] = yield _Question(user.node, root + part, user.hashes[part])
            catalogue = learn_action(root, user.hashes, responses)
        except MetarosError as error:
            problems.append(_problem(user.node, error))
            continue
        try:
            whole = type_hash(root, catalogue)
            response = yield _Question(user.node, root, whole)
            catalogue = learn(root, whole, response)
            remember_action(root, catalogue)
        except MetarosError:
            pass  # before ROS 2 Kilted nodes knew of the parts alone
        return FoundInterface(type_name, catalogue, user.node)
    raise _unknown(type_name, wanted_hash, problems)


def _problem(user: str, error: MetarosError) -> str:
    if isinstance(error, TypeHashError):
        _log.warning("%s is not believed: %s", user, error)
    return f"{user}: {error}"


def _unknown(type_name: str, wanted_hash: str, problems: list[str]) -> UnknownTypeError:
    asked = "\n".join(problems) or "no node that uses it is in the graph to be asked"
    which = f"{type_name} with the hash {wanted_hash}" if wanted_hash else type_name
    return UnknownTypeError(f"{which} is not in the catalogue\n{asked}")


# -- asking ------------------------------------------------------------------------------------------------------------


def _ask_all(node: NodeCore, talk: _Conversation[T], timeout_s: float) -> T:
    step: Callable[[], _Question] = partial(next, talk)
    while True:
        try:
            question = step()
        except StopIteration as end:
            return end.value  # type: ignore[no-any-return]
        try:
            with _client(node, question) as client:
                client.wait_for_service(timeout_s)
                step = partial(talk.send, client.call(_request(question), timeout_s))
        except MetarosError as error:
            step = partial(talk.throw, error)


async def _ask_all_async(node: NodeCore, talk: _Conversation[T], timeout_s: float) -> T:
    step: Callable[[], _Question] = partial(next, talk)
    while True:
        try:
            question = step()
        except StopIteration as end:
            return end.value  # type: ignore[no-any-return]
        try:
            with _client(node, question) as client:
                for _ in range(round(timeout_s / _LOOK_S)):
                    if client.service_is_ready():
                        break
                    await asyncio.sleep(_LOOK_S)  # its token comes a moment after that of the topic
                step = partial(talk.send, await client.call_async(_request(question), timeout_s))
        except MetarosError as error:
            step = partial(talk.throw, error)


def _client(node: NodeCore, question: _Question) -> Client:
    from metaros.interfaces.type_description_interfaces.srv import GetTypeDescription

    return make_client(node, GetTypeDescription, f"{question.node}/{SERVICE.name}")


def _request(question: _Question) -> Any:
    request = message_class(f"{SERVICE.type_name}_Request")
    return request(type_name=question.type_name, type_hash=question.type_hash, include_type_sources=True)
