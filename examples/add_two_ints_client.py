"""Ask /add_two_ints: once blocking, then many times at once. Start add_two_ints_server.py first."""

from __future__ import annotations

import argparse
import asyncio

import metaros
from metaros.interfaces.example_interfaces.srv import AddTwoInts

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("a", type=int, nargs="?", default=2)
parser.add_argument("b", type=int, nargs="?", default=3)
numbers = parser.parse_args()

with metaros.Node("add_two_ints_client") as node:
    client = node.create_client(AddTwoInts, "add_two_ints")
    if not client.wait_for_service(timeout_s=10):
        raise SystemExit("no server of /add_two_ints: start examples/add_two_ints_server.py")

    # A script may block: replies do not need anybody to spin.
    answer = client.call(AddTwoInts.Request(a=numbers.a, b=numbers.b), timeout_s=5)
    print(f"{numbers.a} + {numbers.b} = {answer.sum}")

    async def ask_all() -> list[int]:
        calls = [client.call_async(AddTwoInts.Request(a=number, b=number), timeout_s=5) for number in range(100)]
        return [answer.sum for answer in await asyncio.gather(*calls)]

    print(f"100 at once: {asyncio.run(ask_all())[-3:]} are the last three")
