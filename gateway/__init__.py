"""The gateway: every robot's link on one side, every viewer and client on the other."""
