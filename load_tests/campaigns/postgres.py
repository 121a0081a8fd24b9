"""The campaign of kills on PostgreSQL, which is itself killed with `kill -9` and stopped under load.

python -m load_tests.campaigns postgres [--cycles 200] [--leg 50] [--tick-ms 5] [--seed N] [--keep]
"""

from __future__ import annotations

import time
from functools import partial
from pathlib import Path
from random import Random

from load_tests.campaigns.kills import ACTS, break_one, parser, run_legs
from tests.support.robots.checker import Stored, read_rows
from tests.support.robots.load_robot_stack import LoadStack
from tests.support.servers.postgres import PostgresServer, postgres_binaries

__all__ = ["PostgresStack", "main"]


class PostgresStack(LoadStack):
    """A robot, a gateway, and a PostgreSQL of their own."""

    may_end = ("gateway",)  # one that starts while there is no database; a supervisor starts it again

    def __init__(self, folder: Path, *, tick_s: float = 0.005) -> None:
        self.server = PostgresServer(durable=True)
        try:
            self.server.start()
            super().__init__(folder, robot={"tick_s": tick_s}, gateway={"store_url": self.server.url})
        except BaseException:
            self.server.close()
            raise

    def __exit__(self, *exc: object) -> None:
        try:
            super().__exit__(*exc)
        finally:
            self.server.close()

    def stored(self) -> Stored:
        """What the database has."""
        data_dir = self.gateway_config.data_dir
        return read_rows(lambda sql: self.server.ask(sql, self.robot_config.name), "$1", data_dir)


def break_any(stack: LoadStack, rng: Random, act: str) -> None:
    """PostgreSQL, or one of the others."""
    assert isinstance(stack, PostgresStack)
    match act:
        case "kill postgres":
            stack.server.kill()
            time.sleep(rng.uniform(0.0, 0.5))
            stack.server.start()
        case "stop postgres":
            stack.server.freeze(True)
            time.sleep(rng.uniform(0.01, 0.8))
            stack.server.freeze(False)
        case "kill all":
            for name in ("gateway", "robot"):
                stack.kill(name)
            stack.server.kill()
            stack.server.start()
            for name in ("robot", "gateway"):
                stack.start(name)
        case _:
            break_one(stack, rng, act)


def main(argv: list[str] | None = None) -> int:
    """Run the campaign; exit code 1 when a sample was lost, stored twice, or wrong."""
    options = parser(__doc__, cycles=200)
    options.set_defaults(leg=50)
    if postgres_binaries() is None:
        print("PostgreSQL is not installed (Debian: apt install postgresql)")
        return 0
    acts = (*ACTS, ("kill postgres", 6), ("stop postgres", 2), ("kill all", 2))
    chosen = options.parse_args(argv)
    make = partial(PostgresStack, tick_s=chosen.tick_ms / 1e3)
    return run_legs(chosen, make, name="postgres", acts=acts, act_on=break_any)


if __name__ == "__main__":
    raise SystemExit(main())
