"""The whole REST API as everybody, by schemathesis: bounds of the schema, examples, and chains of operations.

make campaign ARGS="api --examples 8 --who scoped"
"""

from __future__ import annotations

import argparse
import asyncio
import tempfile
from pathlib import Path

from tests.security.permissions.test_schemathesis import WHO, tried

__all__ = ["main"]

LEAST = 900  # cases of each asker, however few ids it learns from the answers
REACHED = {"nobody": 4, "anonymous": 15, "viewer": 15, "operator": 18, "admin": 35, "scoped": 18}  # operations


def main(argv: list[str]) -> int:
    """Try it as each asker; 1 when an answer was wrong, or too little was tried."""
    parser = argparse.ArgumentParser(prog="campaign api", description=__doc__)
    parser.add_argument("--examples", type=int, default=8, help="of each operation, beside the schema's bounds")
    parser.add_argument("--who", action="append", choices=sorted(WHO), help="only as these")
    options = parser.parse_args(argv)
    failed = sum(not _right(who, options.examples) for who in options.who or WHO)
    print(f"  {'FAIL' if failed else 'PASS'}: wrong for {failed} askers", flush=True)
    return int(bool(failed))


def _right(who: str, examples: int) -> bool:
    with tempfile.TemporaryDirectory() as folder:
        phases = ("coverage", "fuzzing", "stateful")
        report = asyncio.run(tried(Path(folder), who, examples=examples, phases=phases))
    for line in report.wrong:
        print(f"  {line}", flush=True)
    return not report.wrong and report.cases >= LEAST and len(report.reached) >= REACHED[who]
