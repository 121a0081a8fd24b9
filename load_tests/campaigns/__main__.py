"""`make campaign`: break the real programs for minutes and count what was lost; the number is to be 0.

make campaign                                    everything below, one after the other
make campaign ARGS="kills --cycles 100 --seed 7"  one of them, with its own options
"""

from __future__ import annotations

import importlib
import itertools
import sys

__all__ = ["CAMPAIGNS", "main"]

CAMPAIGNS = {
    "kills": "1,000 times SIGKILL or SIGSTOP of robot, gateway or both, on SQLite",
    "postgres": "200 times the same on PostgreSQL, its own kill -9 included",
    "partitions": "networks that cut, lose, flap, crawl and swallow, 50 cycles each",
    "disks": "full disks on the robot and on the gateway, 20 times each",
    "history": "200 times kill -9 of a gateway that compacts, purges and exports",
    "simulator": "50,000 seeded worlds of the link's two halves",
    "transforms": "10,000 random trees of frames: what tf2_ros says of them against plain 4x4 matrices",
    "twin": "100 worlds in which people edit twins a thousand times while everything breaks",
    "functions": "10,000 events for a function under 20 kill -9 of gateway and workers, on SQLite and PostgreSQL",
    "replicas": "30 times kill -9 of one of three gateways on one PostgreSQL, with robots and a viewer",
    "fuzz": "every decoder of foreign bytes, a minute each, guided by coverage where atheris is installed",
    "api": "every operation of the REST API as everybody, by schemathesis with all that it can do",
    "examples": "ten rounds of the property tests, with examples drawn at random",
    "steady": "the plain suite ten times, three of them beside two busy processes",
    "recovery": "how long until `metaros agent` and `metaros gateway` are back after kill -9",
}


def main(argv: list[str]) -> int:
    """Run the named campaigns, all without names; exit code 2 for what there is not, 1 when a promise was broken."""
    names = list(itertools.takewhile(lambda word: not word.startswith("-"), argv))
    options = argv[len(names) :]
    unknown = [name for name in names if name not in CAMPAIGNS]
    if unknown:
        print(f"unknown campaign {', '.join(unknown)}; there are: {', '.join(CAMPAIGNS)}", file=sys.stderr)
        return 2
    if options and len(names) != 1:
        print(
            'options need the one campaign that they are for: make campaign ARGS="kills --cycles 100"', file=sys.stderr
        )
        return 2
    codes = {}
    for name in names or CAMPAIGNS:
        print(f"\n{name}: {CAMPAIGNS[name]}\n", flush=True)
        codes[name] = importlib.import_module(f"load_tests.campaigns.{name}").main(options)
    failed = [name for name, code in codes.items() if code]
    print(f"\nfailed: {', '.join(failed)}" if failed else "\nall promises kept", flush=True)
    return int(bool(failed))


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
