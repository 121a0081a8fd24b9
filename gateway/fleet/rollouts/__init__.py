"""Rollouts: a version brought to robots in waves."""
