"""A goal of a robot elsewhere, from sending to result, by its gateway; Ctrl-C cancels it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import typer

from metaros.cli.afar.place import RobotPlace
from metaros.cli.gateway_http import events
from metaros.errors import PeerError, RefusedError

if TYPE_CHECKING:
    from metaros.cli.output import Output

__all__ = ["follow_goal"]

ENDS = ("result", "end")


def follow_goal(
    place: RobotPlace, out: Output, name: str, kind: Any, goal: Any, *, feedback: bool, timeout_s: float
) -> None:
    """Send it and print what is told of it until it has ended; exits with 1 unless it succeeds."""
    from metaros.cli.action_goal import show_part

    show_part(out, "Sending goal", goal)
    goal_id = _send(place, name, kind, goal, timeout_s=timeout_s)
    path, interrupted = place.path("goals", goal_id), False
    try:  # from here on there is a goal to cancel
        if out.json:
            out.object_line({"goal_id": goal_id, "accepted": True})
        else:
            out.line(f"Goal accepted with ID: {goal_id}\n")
        ended = _follow(place, path, lambda value: show_part(out, "Feedback", value), kind if feedback else None)
    except KeyboardInterrupt:
        interrupted = True
        out.note("cancelling the goal …")
        place.http.post(f"{path}/cancel", {})
        ended = _follow(place, path, lambda _: None, None)
    _show_end(out, ended, kind)
    if ended["status"] != "succeeded":
        raise typer.Exit(130 if interrupted else 1)


def _send(place: RobotPlace, name: str, kind: Any, goal: Any, *, timeout_s: float) -> str:
    """Its id, once the server has taken it; PeerError when it does not."""
    from metaros.idl.json import to_json

    body = {"type": kind.__metaros_name__, "goal": to_json(goal), "timeout_s": timeout_s}
    try:
        return str(place.http.post(place.path("actions", name), body)["goal"])
    except RefusedError as error:
        if error.reason == "goal_rejected":
            raise PeerError("the server rejected the goal\nits log may say why") from error
        raise


def _show_end(out: Output, ended: Mapping[str, Any], kind: Any) -> None:
    from metaros.cli.action_goal import show_part
    from metaros.idl.json import from_json

    status = str(ended["status"]).upper()
    if out.json:
        out.object_line({"status": status, "result": ended["result"]})
        return
    show_part(out, "Result", from_json(kind.Result, ended["result"] or {}))
    out.line(f"Goal finished with status: {out.style(status, '32' if status == 'SUCCEEDED' else '31')}")
    if ended["message"]:
        out.note(str(ended["message"]))


def _follow(place: RobotPlace, path: str, heard: Any, kind: Any) -> Mapping[str, Any]:
    """The goal's end; feedback that came before it is given to `heard`, as messages of `kind`, if that is wanted."""
    from metaros.idl.json import from_json

    for name, data in _told(place, path):
        if name == "feedback" and kind is not None:
            heard(from_json(kind.Feedback, data["feedback"] or {}))
        elif name in ENDS:
            break
    found: Mapping[str, Any] = place.http.get(path)
    return found


def _told(place: RobotPlace, path: str) -> Iterator[tuple[str, Any]]:
    with place.http.open("GET", f"{path}/feedback") as answer:
        yield from events(answer)
