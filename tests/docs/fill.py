"""`python -m tests.docs.fill PAGE…`: writes what the commands of pages print below those that have no sample yet.

Look at what it wrote: `…` for what differs from run to run, and for what nobody wants to read.
"""

from __future__ import annotations

import os
import sys
import tempfile
from pathlib import Path

import zenoh

from tests.docs.console import Command, World, commands_of, environment
from tests.support.ports import free_port

ROOT = Path(__file__).resolve().parents[2]
MOST_LINES, MOST_CHARS = 16, 116


def fill(page: Path, endpoint: str) -> None:
    """Run the page's commands, and complete it."""
    lines = page.read_text().splitlines()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        os.environ.update(environment(endpoint, folder))
        (folder / "examples").symlink_to(ROOT / "examples")
        os.chdir(folder)
        world = World(endpoint, folder)
        with world.page():
            world.run(Command(0, "metaros sim --robots 1 &"))
            added = 0
            for command in commands_of(page.read_text()):
                printed = world.run(command).rstrip().splitlines()
                if command.sample or not printed:
                    continue
                cut = [line if len(line) <= MOST_CHARS else f"{line[:MOST_CHARS]}…" for line in printed[:MOST_LINES]]
                cut += ["…"] if len(printed) > MOST_LINES else []
                lines[command.line + added : command.line + added] = [line.rstrip() for line in cut]
                added += len(cut)
    page.write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    address = f"tcp/127.0.0.1:{free_port()}"
    config = zenoh.Config()
    config.insert_json5("mode", '"router"')
    config.insert_json5("listen/endpoints", f'["{address}"]')
    config.insert_json5("scouting/multicast/enabled", "false")
    with zenoh.open(config):
        for argument in [str(Path(name).resolve()) for name in sys.argv[1:]]:
            fill(Path(argument), address)
