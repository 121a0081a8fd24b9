"""River's HalfSpaceTrees, timed: reads a number of samples a line, prints the microseconds each took.

A program of its own: it runs in an environment that has river, which nothing of ours has.
"""

from __future__ import annotations

import random
import sys
import time

TREES, HEIGHT, WINDOW = 10, 8, 250


def main() -> None:
    """Score and learn as many samples as each line says, until there are no more lines."""
    from river import anomaly

    trees = anomaly.HalfSpaceTrees(n_trees=TREES, height=HEIGHT, window_size=WINDOW, seed=1)
    rng = random.Random(1)
    for line in sys.stdin:
        samples = [{"value": min(max(rng.gauss(0.5, 0.1), 0.0), 1.0)} for _ in range(int(line))]
        started = time.process_time()
        for sample in samples:
            trees.score_one(sample)
            trees.learn_one(sample)
        print((time.process_time() - started) / len(samples) * 1e6, flush=True)


if __name__ == "__main__":
    main()
