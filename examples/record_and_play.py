"""Record topics, look at the recording, cut a piece, play it back: all in one program.

    metaros router &            # or `metaros up`
    python examples/record_and_play.py [FOLDER]

It brings its own talker, so it needs nobody else.
"""

from __future__ import annotations

import sys
import tempfile
import threading
from pathlib import Path

import metaros
from metaros.interfaces.geometry_msgs.msg import Point
from metaros.record import Player, Recorder, open_bag, rewrite


def record(context: metaros.Context, folder: Path) -> None:
    """Publish 100 points on /position and record them, with whatever else begins with /po."""
    with metaros.Node("walker", context=context) as walker:
        position = walker.create_publisher(Point, "position", 100)
        with Recorder(context, folder, topics=["/po*"]) as recorder:
            for step in range(100):
                position.publish(Point(x=0.1 * step))
                recorder.ended.wait(0.005)
        print(f"recorded {recorder.report().written} messages into {folder}, missing: {recorder.report().missing}")


def look(folder: Path) -> None:
    """The topics, and where the walker was."""
    bag = open_bag(folder)
    for topic in bag.topics:
        print(f"{topic.name} [{topic.type_name}]: {topic.messages} messages")
    places = [message.decode().x for message in bag.messages(["/position"])]
    print(f"it walked from x = {places[0]:.1f} to x = {places[-1]:.1f}")


def play(context: metaros.Context, recording: Path) -> None:
    """Play it at double speed, under another name, and hear it."""
    heard = threading.Event()
    with metaros.Node("listener", context=context) as listener:

        def on_point(point: Point) -> None:
            if not heard.is_set():
                print(f"heard again: x = {point.x:.1f}")
                heard.set()

        listener.create_subscription(Point, "again", on_point, dedicated=True)
        with Player(context, recording, rate=2.0, remap={"/position": "/again"}) as player:
            report = player.play()
            heard.wait(5.0)
    print(f"played {report.messages} messages")


def main() -> None:
    """All of it."""
    with tempfile.TemporaryDirectory() as scratch, metaros.Context() as context:
        folder = Path(sys.argv[1] if len(sys.argv) > 1 else scratch) / "walk"
        record(context, folder)
        look(folder)
        piece = rewrite(open_bag(folder), folder.with_suffix(".mcap"), start_s=0.1, duration_s=0.2)
        print(f"cut {piece.messages} messages into {piece.path.name}")
        play(context, piece.path)


if __name__ == "__main__":
    main()
