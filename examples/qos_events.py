"""A heart that promises ten beats a second, somebody who watches it, and a careless second heart that does not fit."""

from __future__ import annotations

import metaros
from metaros.interfaces.std_msgs.msg import String

BEAT = metaros.QoSProfile(depth=1, deadline_ns=200_000_000)  # a beat at least every 0.2 s

with metaros.Node("watchdog") as watchdog, metaros.Node("body") as body:
    log = watchdog.get_logger()
    events = metaros.SubscriptionEvents(
        matched=lambda event: log.info(f"{event.node} is here: {event.current} match"),
        incompatible_qos=lambda event: log.warn(f"{event.node} does not fit: {', '.join(event.policies)}"),
        deadline_missed=lambda event: log.error(f"{event.node} missed {event.total} beats"),
    )
    watchdog.create_subscription(String, "heartbeat", lambda beat: None, BEAT, events=events)

    promises = metaros.PublisherEvents(deadline_missed=lambda event: print("I know that I am late:", event.total))
    heart = body.create_publisher(String, "heartbeat", BEAT, events=promises)
    careless = body.create_publisher(String, "heartbeat", 1)  # promises nothing: both ends are told
    beats = 0

    @body.timer(0.1)
    def beat() -> None:
        global beats
        beats += 1
        if beats <= 10:  # then the heart stops
            heart.publish(String(data=str(beats)))

    metaros.spin([watchdog, body])
