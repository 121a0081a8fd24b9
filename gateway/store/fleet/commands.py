"""Commands in the database. Every function runs inside a transaction of the caller's.

A change names the states from which it may happen and says whether it did: several gateways may be at work on one
command, and the end that is stored first is its end for ever.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from gateway.domain.errors import IdempotencyConflictError
from gateway.domain.fleet.command import OPEN, Command
from gateway.errors import TooManyError, UnknownRobotError
from gateway.store.engine import Row, StoreEngine, placeholders, slices
from metaros.limits import LIMITS

__all__ = [
    "add_command",
    "change_command",
    "command_states",
    "get_command",
    "list_commands",
    "open_commands",
    "overdue_commands",
    "purge_commands",
    "same_command",
    "waiting_robots",
]

_NAMES = (
    "command, robots.id, kind, request, wire, issuer, issued_by, idempotency, digest, durable, state, timeout_ms,"
    " expires_ns, issued_ns, delivered_ns, running_ns, ended_ns, code, message, result"
)
_SELECT = f"SELECT {_NAMES} FROM commands JOIN robots ON robots.robot = commands.robot"
_INSERT = f"INSERT INTO commands ({_NAMES.replace('robots.id', 'robot')}) VALUES ({placeholders(20)})"
_CHANGEABLE = frozenset(
    {"state", "delivered_ns", "running_ns", "ended_ns", "code", "message", "result", "wire"},
)


def add_command(engine: StoreEngine, command: Command, *, most_open: int) -> Command:
    """Store a new command; what is returned is the one that was stored under the same idempotency key before.

    Raises:
        UnknownRobotError: no robot of that id ever connected.
        IdempotencyConflictError: the key was used for another request.
        TooManyError: the robot has `most_open` durable ones that are not over.
    """
    robots = engine.fetch("SELECT robot FROM robots WHERE id = ?" + engine.for_update, command.robot)
    if not robots:
        raise UnknownRobotError.of(command.robot)
    if command.idempotency is not None and (known := same_command(engine, command)) is not None:
        return known
    if command.durable:
        sql = "SELECT count(*) FROM commands WHERE robot = ? AND ended_ns = 0 AND durable = 1"
        if int(engine.fetch(sql, robots[0][0])[0][0]) >= most_open:
            raise TooManyError(f"robot {command.robot} has {most_open} durable commands that are not over")
    stored = engine.execute(
        f"{_INSERT} ON CONFLICT (issuer, idempotency) DO NOTHING",
        command.id,
        robots[0][0],
        *_values(command),
    )
    if not stored and (known := same_command(engine, command)) is not None:  # another gateway was faster
        return known
    return command


def get_command(engine: StoreEngine, command_id: str) -> Command | None:
    """One command."""
    rows = engine.fetch(f"{_SELECT} WHERE command = ?", command_id)
    return _command(rows[0]) if rows else None


def command_states(engine: StoreEngine, command_ids: Sequence[str]) -> dict[str, str]:
    """The states of these commands; without those that are gone."""
    found: dict[str, str] = {}
    for some in slices(command_ids):
        sql = f"SELECT command, state FROM commands WHERE command IN ({placeholders(len(some))})"
        found |= {row[0]: row[1] for row in engine.fetch(sql, *some)}
    return found


def list_commands(
    engine: StoreEngine,
    *,
    robot: str = "",
    state: str = "",
    issuer: str = "",
    before: str = "",
    limit: int,
    most_bytes: int = LIMITS.command_page_bytes,
) -> list[Command]:
    """The newest, newest first; `issuer` is a name or an id; `before` the id after which to go on.

    Fewer than `limit` where their texts would be more than `most_bytes`, but one at least.
    """
    conditions, values = ["1 = 1"], list[Any]()
    for condition, value in (("robots.id = ?", robot), ("state = ?", state), ("command < ?", before)):
        if value:
            conditions.append(condition)
            values.append(value)
    if issuer:
        conditions.append("(issued_by = ? OR issuer = ?)")
        values += [issuer, issuer]
    tables = f"FROM commands JOIN robots ON robots.robot = commands.robot WHERE {' AND '.join(conditions)}"
    sizes = f"SELECT length(request) + length(wire) + length(result) {tables} ORDER BY command DESC LIMIT ?"
    room, fitting = most_bytes, 0
    for (size_bytes,) in engine.fetch(sizes, *values, limit):
        room -= size_bytes
        if fitting and room < 0:
            break
        fitting += 1
    rows = engine.fetch(f"SELECT {_NAMES} {tables} ORDER BY command DESC LIMIT ?", *values, fitting)
    return [_command(row) for row in rows]


def waiting_robots(engine: StoreEngine) -> list[str]:
    """The robots that have durable commands which are not over."""
    sql = (
        "SELECT id FROM robots WHERE robot IN (SELECT DISTINCT robot FROM commands WHERE ended_ns = 0 AND durable = 1)"
    )
    return [str(row[0]) for row in engine.fetch(sql)]


def open_commands(engine: StoreEngine, robot: str, *, limit: int) -> list[Command]:
    """A robot's durable commands that are not over, oldest first."""
    sql = f"{_SELECT} WHERE robots.id = ? AND ended_ns = 0 AND durable = 1 ORDER BY command LIMIT ?"
    return [_command(row) for row in engine.fetch(sql, robot, limit)]


def overdue_commands(
    engine: StoreEngine, *, now_ns: int, silence_ns: int, immediate_ns: int, limit: int
) -> list[Command]:
    """What is to be ended by time.

    Durable ones that never left and are past their expiry; durable ones that left, `silence_ns` after it; immediate
    ones whose gateway ended while they ran, `immediate_ns` after their own time.
    """
    sql = (
        f"{_SELECT} WHERE ended_ns = 0 AND ((durable = 1 AND state = 'issued' AND expires_ns <= ?)"
        " OR (durable = 1 AND expires_ns <= ?)"
        " OR (durable = 0 AND issued_ns + timeout_ms * 1000000 <= ?)) ORDER BY command LIMIT ?"
    )
    found = engine.fetch(sql, now_ns, now_ns - silence_ns, now_ns - immediate_ns, limit)
    return [_command(row) for row in found]


def change_command(engine: StoreEngine, command_id: str, *, within: Sequence[str] = OPEN, **values: Any) -> bool:
    """Set some columns where the state is one of `within`; False when it is not, or the command is gone."""
    if unknown := values.keys() - _CHANGEABLE:
        raise ValueError(f"no columns to change: {sorted(unknown)}")
    settings = ", ".join(f"{name} = ?" for name in values)
    sql = f"UPDATE commands SET {settings} WHERE command = ? AND state IN ({placeholders(len(within))})"
    return bool(engine.execute(sql, *values.values(), command_id, *within))


def purge_commands(engine: StoreEngine, *, before_ns: int, most: int, limit: int = 1000) -> int:
    """Delete commands that ended before a time, and the oldest of more than `most`; how many went."""
    sql = "SELECT command FROM commands WHERE ended_ns > 0 AND ended_ns < ? ORDER BY ended_ns LIMIT ?"
    going = [(row[0],) for row in engine.fetch(sql, before_ns, limit)]
    over = int(engine.fetch("SELECT count(*) FROM commands")[0][0]) - len(going) - most
    if over > 0:
        sql = "SELECT command FROM commands WHERE ended_ns >= ? AND ended_ns > 0 ORDER BY ended_ns LIMIT ?"
        going += [(row[0],) for row in engine.fetch(sql, before_ns, min(over, limit))]
    engine.many("DELETE FROM commands WHERE command = ?", going)
    return len(going)


def same_command(engine: StoreEngine, command: Command) -> Command | None:
    """The command under this idempotency key; IdempotencyConflictError where it is another request."""
    rows = engine.fetch(f"{_SELECT} WHERE issuer = ? AND idempotency = ?", command.issuer, command.idempotency)
    if not rows:
        return None
    known = _command(rows[0])
    if known.digest != command.digest:
        raise IdempotencyConflictError("this Idempotency-Key was used for another request: take a new one")
    return known


def _values(command: Command) -> list[Any]:
    """What follows id and robot, in the order of the columns."""
    return [
        command.kind,
        command.request,
        command.wire,
        command.issuer,
        command.issued_by,
        command.idempotency,
        command.digest,
        int(command.durable),
        command.state,
        command.timeout_ms,
        command.expires_ns,
        command.issued_ns,
        command.delivered_ns,
        command.running_ns,
        command.ended_ns,
        command.code,
        command.message,
        command.result,
    ]


def _command(row: Row) -> Command:
    return Command(
        id=row[0],
        robot=row[1],
        kind=row[2],
        request=row[3],
        wire=bytes(row[4]),
        issuer=row[5],
        issued_by=row[6],
        idempotency=row[7],
        digest=row[8],
        durable=bool(row[9]),
        state=row[10],
        timeout_ms=row[11],
        expires_ns=row[12],
        issued_ns=row[13],
        delivered_ns=row[14],
        running_ns=row[15],
        ended_ns=row[16],
        code=row[17],
        message=row[18],
        result=row[19],
    )
