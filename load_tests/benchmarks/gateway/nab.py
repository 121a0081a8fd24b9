"""What the detectors find on NAB's development series without a category at a time, and on made-up families.

    python -m load_tests nab

The same as `make bench-anomaly`; on any folder of such files: `make bench-anomaly DIR=folder`.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from load_tests.anomaly import nab_bench

__all__ = ["main"]


def main(argv: Sequence[str] = ()) -> int:
    """Score and print; exit code 2 where the development series are not there."""
    argparse.ArgumentParser(prog="python -m load_tests nab", description=__doc__).parse_args(argv)
    return nab_bench.main(["--cross-validate"])
