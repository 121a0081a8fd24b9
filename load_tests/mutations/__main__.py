"""Does a suite find the faults of the list? Each in turn is put into a tree, and the tests nearest to it are run.

    python -m load_tests.mutations --tree DIR --out FILE.json [--only m01,m07] [--tests-of FILE.json] [--timeout-s N]
        [--marks "not integration"] [--chunk N] [--most-files N]

Nobody may work in the tree meanwhile; its `.venv` runs the tests. A failure counts once the same test passes without
the fault. FILE is written after each mutation; a run that was stopped goes on where it was.
"""

from __future__ import annotations

import argparse
import json
import signal
import sys
from pathlib import Path
from typing import Any

from load_tests.mutations.closeness import by_closeness
from load_tests.mutations.faults import Mutation, TreeError, read_mutations
from load_tests.mutations.trial import Trial

__all__ = ["main"]


def main(argv: list[str] | None = None) -> int:
    """Exit code 0 when every mutation that was tried is found, 1 when one is not, 2 when one could not be tried."""
    parser = argparse.ArgumentParser(prog="python -m load_tests.mutations", description=__doc__.partition("\n")[0])
    parser.add_argument("--tree", type=Path, required=True, help="the tree to put the faults into")
    parser.add_argument("--out", type=Path, required=True, help="what was found, as JSON")
    parser.add_argument("--only", default="", help="ids with commas between them; default: all")
    parser.add_argument("--tests-of", type=Path, help="JSON: the test files of each id, the nearest first; see select")
    parser.add_argument("--timeout-s", type=float, default=1800.0, help="of one call of pytest")
    parser.add_argument("--marks", default="", help="which tests, as pytest's -m")
    parser.add_argument("--chunk", type=int, default=6, help="test files of one call of pytest")
    parser.add_argument("--most-files", type=int, default=0, help="at most so many test files a mutation; 0: all")
    options = parser.parse_args(argv)
    signal.signal(signal.SIGTERM, _interrupt)  # so that the file is put back then, too
    wanted = set(filter(None, options.only.split(",")))
    faults = [fault for fault in read_mutations() if not wanted or fault.id in wanted]
    if unknown := wanted - {fault.id for fault in faults}:
        parser.error(f"no mutation {', '.join(sorted(unknown))}")
    tests_of = json.loads(options.tests_of.read_text()) if options.tests_of else {}
    results: dict[str, dict[str, Any]] = json.loads(options.out.read_text()) if options.out.exists() else {}
    tree, troubles = options.tree.resolve(), 0
    trial = Trial(tree, timeout_s=options.timeout_s, marks=options.marks, chunk=options.chunk)
    for fault in faults:
        if fault.id in results:
            continue
        files = _files(fault, tests_of, tree)
        try:
            results[fault.id] = trial.run(fault, files[: options.most_files or None])
        except TreeError as error:
            print(f"{fault.id}  not tried: {error}", file=sys.stderr, flush=True)
            troubles += 1
            continue
        _keep(options.out, results)
        result = results[fault.id]
        said = f"found by {result['by']}" if result["found"] else f"NOT FOUND by {result['tests_run']} tests"
        print(f"{fault.id}  {fault.file}: {said}, {result['seconds']:.0f} s", flush=True)
    lost = [fault.id for fault in faults if fault.id in results and not results[fault.id]["found"]]
    tried = sum(fault.id in results for fault in faults)
    print(f"{tried - len(lost)} of {tried} found" + (f"; not {', '.join(lost)}" if lost else ""))
    return 2 if troubles else 1 if lost else 0


def _files(fault: Mutation, tests_of: dict[str, list[str]], tree: Path) -> list[str]:
    """The test files of a mutation that this tree has; by closeness where nobody says, or none of those is left."""
    files = [file for file in tests_of.get(fault.id, ()) if (tree / file).is_file()]
    return files or by_closeness(fault.file, tree)


def _keep(path: Path, results: dict[str, dict[str, Any]]) -> None:
    draft = path.with_name(f"{path.name}.draft")
    draft.write_text(json.dumps(results, indent=1) + "\n")
    draft.replace(path)


def _interrupt(*_: object) -> None:
    raise KeyboardInterrupt


if __name__ == "__main__":
    sys.exit(main())
