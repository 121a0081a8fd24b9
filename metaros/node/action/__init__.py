"""Actions: goals that take a while, with feedback, a result, and a way to stop them."""

from metaros.node.action.client import ActionClient
from metaros.node.action.client_goal import ActionResult, ClientGoal
from metaros.node.action.goal import CancelCode, GoalState
from metaros.node.action.server import ActionServer
from metaros.node.action.server_goal import ServerGoal

__all__ = ["ActionClient", "ActionResult", "ActionServer", "CancelCode", "ClientGoal", "GoalState", "ServerGoal"]
