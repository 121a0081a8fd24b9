"""A goal of a remote robot, from sending to result, over its gateway; Ctrl-C cancels it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import typer

from metaros.cli.remote.robot import RemoteRobot
from metaros.cli.shared.gateway_http import events
from metaros.cli.shared.goal_view import show_accepted, show_part, show_status
from metaros.errors import PeerError, RefusedError

if TYPE_CHECKING:
    from metaros.cli.shared.output import Output

__all__ = ["follow_goal"]

ENDS = ("result", "end")


def follow_goal(
    robot: RemoteRobot, out: Output, name: str, kind: Any, goal: Any, *, feedback: bool, timeout_s: float
) -> None:
    """Send it and print its updates until it has ended; exits with 1 unless it succeeds."""
    show_part(out, "Sending goal", goal)
    goal_id = _send(robot, name, kind, goal, timeout_s=timeout_s)
    path, interrupted = robot.path("goals", goal_id), False
    try:  # from here on there is a goal to cancel
        show_accepted(out, goal_id)
        ended = _follow(robot, path, lambda value: show_part(out, "Feedback", value), kind if feedback else None)
    except KeyboardInterrupt:
        interrupted = True
        out.note("cancelling the goal …")
        robot.http.post(f"{path}/cancel", {})
        ended = _follow(robot, path, lambda _: None, None)
    _show_end(out, ended, kind)
    if ended["status"] != "succeeded":
        raise typer.Exit(130 if interrupted else 1)


def _send(robot: RemoteRobot, name: str, kind: Any, goal: Any, *, timeout_s: float) -> str:
    """Its id, once the server has taken it; PeerError when it does not."""
    from metaros.idl.json import to_json

    body = {"type": kind.__metaros_name__, "goal": to_json(goal), "timeout_s": timeout_s}
    try:
        return str(robot.http.post(robot.path("actions", name), body)["goal"])
    except RefusedError as error:
        if error.reason == "goal_rejected":
            raise PeerError("the server rejected the goal\nits log may say why") from error
        raise


def _show_end(out: Output, ended: Mapping[str, Any], kind: Any) -> None:
    from metaros.idl.json import from_json

    status = str(ended["status"]).upper()
    if out.json:
        out.object_line({"status": status, "result": ended["result"]})
        return
    show_part(out, "Result", from_json(kind.Result, ended["result"] or {}))
    show_status(out, status)
    if ended["message"]:
        out.note(str(ended["message"]))


def _follow(robot: RemoteRobot, path: str, on_feedback: Any, kind: Any) -> Mapping[str, Any]:
    """The goal's end; feedback before it goes to `on_feedback`, as messages of `kind`, if that is given."""
    from metaros.idl.json import from_json

    for name, data in _events(robot, path):
        if name == "feedback" and kind is not None:
            on_feedback(from_json(kind.Feedback, data["feedback"] or {}))
        elif name in ENDS:
            break
    found: Mapping[str, Any] = robot.http.get(path)
    return found


def _events(robot: RemoteRobot, path: str) -> Iterator[tuple[str, Any]]:
    with robot.http.open("GET", f"{path}/feedback") as answer:
        yield from events(answer)
