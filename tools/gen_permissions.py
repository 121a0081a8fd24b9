"""Write `docs/reference/permissions.md` from the permission table and the routes, sockets and RPCs that name its rows.

python tools/gen_permissions.py           write
python tools/gen_permissions.py --check   exit 1 if the page differs from what would be written
"""

from __future__ import annotations

import sys
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(REPOSITORY))

from gateway.api import ROUTERS  # noqa: E402
from gateway.api.authorization import PATH_PERMISSIONS, RPC_PERMISSIONS, routes_of  # noqa: E402
from gateway.identity.permissions import PERMISSIONS, Permission  # noqa: E402

PAGE = REPOSITORY / "docs" / "reference" / "permissions.md"
MARK = "<!-- From here on written by tools/gen_permissions.py: do not edit. -->\n"
HEAD = """
| permission | least role | of one robot | changes something | |
|---|---|---|---|---|
"""


def render() -> str:
    """The whole page: its prose as it is, and the two tables."""
    prose = PAGE.read_text().partition(MARK)[0]
    rows = [
        f"| `{row.name}` | {_who(row)} | {_yes(row.robots)} | {_yes(row.mutates)} | {row.meaning} |\n"
        for row in PERMISSIONS
    ]
    operations = [
        f"| {'WebSocket' if method == 'SOCKET' else method} `{path}` | `{declared[0].name}` | {_who(declared[0])} |\n"
        for method, path, declared in routes_of(ROUTERS)
    ]
    operations += [f"| GET `{path}` | `{name}` | {_named(name)} |\n" for path, name in PATH_PERMISSIONS.items()]
    operations += [f"| gRPC `{path}` | `{name}` | {_named(name)} |\n" for path, name in RPC_PERMISSIONS.items()]
    head = "\n## Which operation needs which\n\n| operation | permission | least role |\n|---|---|---|\n"
    return prose + MARK + HEAD + "".join(rows) + head + "".join(operations)


def _who(row: Permission) -> str:
    return row.least.word if row.who == "people" else f"*{row.who}*"


def _named(name: str) -> str:
    return _who(next(row for row in PERMISSIONS if row.name == name))


def _yes(flag: bool) -> str:
    return "yes" if flag else ""


def main() -> None:
    """Write or check the page."""
    text = render()
    if "--check" not in sys.argv[1:]:
        PAGE.write_text(text)
    elif PAGE.read_text() != text:
        sys.exit(f"{PAGE.relative_to(REPOSITORY)} is not up to date: run python tools/gen_permissions.py")


if __name__ == "__main__":
    main()
