"""What is shown of an action's goal between sending and result, for local and remote robots alike."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from metaros.cli.shared.output import Output

__all__ = ["show_accepted", "show_part", "show_status"]


def show_accepted(out: Output, goal_id: str) -> None:
    """The server has taken the goal."""
    if out.json:
        out.object_line({"goal_id": goal_id, "accepted": True})
    else:
        out.line(f"Goal accepted with ID: {goal_id}\n")


def show_part(out: Output, title: str, message: Any) -> None:
    """A goal, feedback or result under its title; machines get feedback here, and the rest in the lines around it."""
    from metaros.cli.shared.render import message_yaml, plain

    if out.json:
        if title == "Feedback":
            out.object_line({"feedback": plain(message)})
        return
    body = message_yaml(message).replace("\n", "\n    ")
    out.line(f"{out.style(f'{title}:', '1')}\n    {body or '(no fields)'}\n")


def show_status(out: Output, status: str) -> None:
    """How the goal ended, for people: `status` is its name, as SUCCEEDED."""
    out.line(f"Goal finished with status: {out.style(status, '32' if status == 'SUCCEEDED' else '31')}")
