"""Functions on the robot: a package as the gateway runs it, called for messages of local topics, link or no link.

`document` is its `function.yaml`, `judge` decides which messages count, `backlog` keeps them on the disk, `runner`
calls the handler, `actions` does what it asks for, `results` tells the agent, `bundle` makes what is signed.
"""
