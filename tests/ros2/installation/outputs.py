"""What the `ros2` command prints, read with care: what is not understood is left out, never guessed."""

from __future__ import annotations

import ast
import math
import re
from typing import Any

import yaml

from tests.ros2.participant import Fields, GoalRun, Seen

__all__ = ["endpoints", "goal_run", "messages", "names", "parameter", "refusal", "response", "state"]

KINDS = {"PUBLISHER": "MP", "SUBSCRIPTION": "MS"}
WORDS = {"nan": math.nan, "inf": math.inf, "True": True, "False": False, "None": None}
_LABELLED = re.compile(r"^(?:Boolean|Integer|Double|String) value is: (.*)$|^\w+ values are: (.*)$", re.MULTILINE)
_BLOCK = re.compile(r"^(Feedback|Result):\s*\n((?:.+\n)+)", re.MULTILINE)


def messages(text: str) -> list[Fields]:
    """Of `ros2 topic echo`: YAML, each message with `---` behind it; what is still being written is not there yet."""
    found = []
    for document in re.split(r"^---\s*$", text, flags=re.MULTILINE)[:-1]:
        try:
            read = yaml.safe_load(_without_notes(document))
        except yaml.YAMLError:
            continue
        if isinstance(read, dict):
            found.append(read)
    return found


def _without_notes(document: str) -> str:
    """`echo` puts warnings among the messages, about lost ones for example."""
    lines = document.splitlines()
    notes = ("WARNING", "[WARN", "[INFO", "A message was lost", "\ttotal count", "[ERROR")
    return "\n".join(line for line in lines if not line.startswith(notes))


def response(text: str) -> Fields:
    """Of `ros2 service call`: the `repr` of a message after `response:`."""
    _, mark, rest = text.partition("response:\n")
    if not mark:
        raise ValueError(f"no response in {text!r}")
    expression = rest.strip().split("\n\n")[0]
    read = _plain(ast.parse(expression, mode="eval").body)
    if not isinstance(read, dict):
        raise ValueError(f"no message in {expression!r}")
    return read


def _plain(node: ast.expr) -> Any:
    """`pkg.srv.X_Response(a=1, b=[…], c=array('B', […]))` as plain values."""
    match node:
        case ast.Constant():
            return node.value
        case ast.Name() if node.id in WORDS:
            return WORDS[node.id]
        case ast.UnaryOp(op=ast.USub()):
            return -_plain(node.operand)
        case ast.List() | ast.Tuple():
            return [_plain(item) for item in node.elts]
        case ast.Call(args=[]):
            return {keyword.arg: _plain(keyword.value) for keyword in node.keywords}
        case ast.Call():  # array('B', […]) or array([…], dtype=uint8); without elements no list is there
            lists = [_plain(argument) for argument in node.args if isinstance(argument, ast.List)]
            return lists[0] if lists else []
    raise ValueError(f"not understood: {ast.unparse(node)}")


def goal_run(text: str) -> GoalRun:
    """Of `ros2 action send_goal --feedback` for Fibonacci."""
    if "Goal was rejected" in text:
        return GoalRun("REJECTED")
    parts: dict[str, list[list[int]]] = {"Feedback": [], "Result": []}
    for kind, block in _BLOCK.findall(text):
        read = yaml.safe_load(block.lstrip(" "))  # only its first line is indented
        if isinstance(read, dict) and isinstance(read.get("sequence"), list):
            parts[kind].append(read["sequence"])
    status = re.search(r"Goal finished with status: (\w+)", text)
    if status is None:
        raise ValueError(f"no end of a goal in {text!r}")
    return GoalRun(status.group(1), parts["Result"][-1] if parts["Result"] else [], parts["Feedback"])


def parameter(text: str) -> Any:
    """Of `ros2 param get`; None where it is not set."""
    found = _LABELLED.search(text)
    if found is None:
        return None
    value = found.group(1) if found.group(1) is not None else found.group(2)
    return value if text.startswith("String") else yaml.safe_load(value)


def refusal(text: str) -> str | None:
    """Of `ros2 param set`, what it prints and what it complains of together: None where it was obeyed."""
    if "Set parameter successful" in text:
        return None
    failed = re.search(r"Setting parameter failed:? ?(.*)", text)
    return (failed.group(1) if failed else text.strip()) or "no reason"


def names(text: str) -> list[str]:
    """Of `ros2 param list` and `ros2 node list`: one a line."""
    lines = [line.strip() for line in text.splitlines()]
    return [line for line in lines if line and " " not in line and not line.endswith(":")]


def state(text: str) -> str:
    """Of `ros2 lifecycle get`: `unconfigured [1]`."""
    found = re.search(r"^(?:\S+: )?(\w+) \[\d+\]", text, re.MULTILINE)
    return found.group(1) if found else ""


def endpoints(text: str) -> list[Seen]:
    """Of `ros2 topic info -v`: blocks of `key: value`."""
    found = []
    for block in re.split(r"^(?=Node name:)", text, flags=re.MULTILINE)[1:]:
        rows = dict(re.findall(r"^\s*([A-Za-z ()]+?): *(\S.*)$", block, re.MULTILINE))
        history = re.search(r"\((\d+)\)", rows.get("History (Depth)", ""))
        kind = KINDS.get(rows.get("Endpoint type", ""))
        if kind is None:
            continue
        found.append(
            Seen(
                kind=kind,
                node=f"{rows.get('Node namespace', '/').rstrip('/')}/{rows.get('Node name', '')}",
                type_name=rows.get("Topic type", ""),
                type_hash=rows.get("Topic type hash", ""),
                reliability=rows.get("Reliability", "").lower(),
                durability=rows.get("Durability", "").lower(),
                depth=int(history.group(1)) if history else 0,
            )
        )
    return found
