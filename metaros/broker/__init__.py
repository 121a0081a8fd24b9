"""A hub for ZeroMQ publishers and subscribers, bridged both ways to ROS topics. Needs the extra `zmq`."""

from __future__ import annotations

from metaros.broker.broker import Broker, BrokerOptions
from metaros.broker.hub import HubOptions, endpoint
from metaros.broker.report import BrokerReport, Direction, TopicRow
from metaros.broker.type_inference import TypeTable

__all__ = ["Broker", "BrokerOptions", "BrokerReport", "Direction", "HubOptions", "TopicRow", "TypeTable", "endpoint"]
