"""The robot's ROS graph as the gateway's clients use it: what is in it, goals for its actions, what clients offer."""
