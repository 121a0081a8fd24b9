"""A lifecycle node that adapts: it reads a robot's scan, does with less while the scan is slow, and says why.

metaros sim --fault sim_1:lidar_slow@10 --fault sim_1:clear@20     # beside: metaros router
python examples/lifecycle.py [TOPIC]
metaros lifecycle get /guard; metaros topic echo /guard/health
"""

from __future__ import annotations

import sys

import metaros
from metaros.interfaces.sensor_msgs.msg import LaserScan
from metaros.interfaces.std_msgs.msg import Float64
from metaros.node.lifecycle import HealthRule, TopicRate

TOPIC = sys.argv[1] if len(sys.argv) > 1 else "/sim_1/scan"


class Guard(metaros.LifecycleNode):
    """Publishes how fast a robot may drive: by the nearest obstacle, and crawling while the lidar is slow."""

    def on_configure(self) -> None:
        self.limit_m_s = 1.0
        self.speed = self.create_lifecycle_publisher(Float64, "~/max_speed")
        self.scan = self.create_subscription(LaserScan, TOPIC, self.on_scan)

    def on_scan(self, scan: LaserScan) -> None:
        self.speed.publish(Float64(data=min(self.limit_m_s, float(scan.ranges.min()) / 2)))

    def on_degrade(self, reason: str) -> None:
        self.limit_m_s = 0.2

    def on_recover(self, reason: str) -> None:
        self.limit_m_s = 1.0

    def on_cleanup(self) -> None:
        self.speed.close()
        self.scan.close()


with Guard("guard") as guard:
    guard.watch_health(HealthRule("lidar", TopicRate(TOPIC, below_hz=5), for_s=1.0, clear_for_s=2.0))
    guard.trigger("configure")
    guard.trigger("activate")
    metaros.spin(guard)
