"""Functions on the robot: a package as the gateway runs it, called for messages of local topics, link or no link.

`manifest` is its `function.yaml`, `evaluator` decides which messages count, `backlog` keeps them on the disk, `runner`
calls the handler, `actions` does what it asks for, `results` reports to the agent, `bundle` makes what is signed.
"""
