"""Robots' ROS graphs: nodes, types, goals, and what clients serve in them."""
