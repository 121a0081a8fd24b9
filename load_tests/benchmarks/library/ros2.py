"""Programs written for rclpy beside native nodes, and how long such a program takes to its first message.

    python -m load_tests ros2 [--rounds 5] [--seconds 1.0] [--sizes 64,65536,1048576]

`rclpy` is `publisher.publish(message)` to `rclpy.spin(node)` with message classes of rosidl's shape; `shared` is
the same by the native node and its executor. Both flat out, reliable and keep-all, between two processes over
loopback, as in the benchmark `pubsub`. The start is a whole program: `import rclpy`, a node with a publisher and a
subscription, spun
until its own first message has come, beside `python -c "import numpy"`; the wall's clock, of processes that end.
"""

from __future__ import annotations

import argparse
import os
import statistics
import subprocess
import sys
import time
from collections.abc import Sequence

from load_tests.benchmarks.library.pubsub import Row, run
from load_tests.figures import note
from metaros.wire.router import open_router
from tests.support.ports import free_port

__all__ = ["main", "starts"]

PATHS = ("shared", "rclpy")
SIZES = (64, 65536, 1048576)
FIRST_MESSAGE = """
import metaros.ros2
metaros.ros2.install()
import rclpy
from std_msgs.msg import String
rclpy.init()
node = rclpy.create_node("first")
heard = []
node.create_subscription(String, "first", heard.append, 10)
publisher = node.create_publisher(String, "first", 10)
publisher.publish(String(data="hello"))
while not heard:
    rclpy.spin_once(node)
assert heard[0].data == "hello"
import os
os._exit(0)
"""
IMPORT_NUMPY = "import numpy"


def starts(rounds: int) -> dict[str, list[float]]:
    """Seconds of each program, a value a round; the first round compiles modules and is left out."""
    programs = {"import numpy": IMPORT_NUMPY, "first message": FIRST_MESSAGE}
    found: dict[str, list[float]] = {name: [] for name in programs}
    with open_router(free_port()) as router:
        kept = {
            name: value for name, value in os.environ.items() if not name.startswith(("METAROS_", "PYTHON", "ROS_"))
        }
        environ = {**kept, "METAROS_ZENOH_PORT": router.endpoint.rpartition(":")[2]}
        for number in range(rounds + 1):
            for name, code in programs.items():
                began_s = time.perf_counter()
                subprocess.run([sys.executable, "-c", code], env=environ, check=True)
                if number:
                    found[name].append(time.perf_counter() - began_s)
    return found


def _print_flow(size: int, results: dict[Row, list[dict[str, float]]]) -> None:
    rates = {path: [figure["rate"] for figure in results[Row(size, path, False)]] for path in PATHS}
    cost = {
        path: statistics.median(
            figure["cpu_us"] + figure["sender_cpu_us"] for figure in results[Row(size, path, False)]
        )
        for path in PATHS
    }
    native, face = (statistics.median(rates[path]) for path in PATHS)
    times = [one / other for one, other in zip(rates["shared"], rates["rclpy"], strict=True)]
    print(f"{size:>8}{native:>14,.0f}{face:>14,.0f}{statistics.median(times):>12.2f}", end="")
    print(f"{cost['shared']:>14.1f}{cost['rclpy']:>14.1f}{cost['rclpy'] / cost['shared']:>10.2f}")
    note(f"{size} B, native ÷ rclpy", times)


def main(argv: Sequence[str] = ()) -> int:
    """Print both tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--rounds", type=int, default=5, help="interleaved rounds")
    parser.add_argument("--seconds", type=float, default=1.0, help="measured time a round and row")
    parser.add_argument("--sizes", default=",".join(map(str, SIZES)), help="payload sizes in bytes")
    options = parser.parse_args(list(argv))
    sizes = [int(size) for size in options.sizes.split(",")]
    results = run(
        [Row(size, path, False) for size in sizes for path in PATHS], rounds=options.rounds, seconds=options.seconds
    )
    columns = f"{'native ÷':>12}{'native µs':>14}{'rclpy µs':>14}{'÷ native':>10}"
    print(f"{'bytes':>8}{'native recv/s':>14}{'rclpy recv/s':>14}{columns}")
    for size in sizes:
        _print_flow(size, results)
    found = starts(options.rounds)
    numpy, first = (statistics.median(found[name]) * 1e3 for name in ("import numpy", "first message"))
    print(f"\nimport numpy {numpy:.0f} ms   import rclpy, first message {first:.0f} ms   {first / numpy:.2f} times")
    note("rclpy, first message", [value * 1e3 for value in found["first message"]])
    note(
        "rclpy, first message, of import numpy",
        [one / other for one, other in zip(found["first message"], found["import numpy"], strict=True)],
    )
    print(f"\nmedians of {options.rounds} interleaved rounds on {os.cpu_count()} cores; µs: both processes, a message")
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
