"""The graph of a remote robot over its gateway: what `--robot ID` selects instead of this machine's.

The commands of `metaros topic`, `service`, `action`, `param`, `lifecycle` and `graph` ask for a graph, a node to call
services with, a listener. Here are the same four by REST and WebSocket, so that a command says the same of either.
"""
