"""What commands share: options, output for people and programs, live lists, a connection to the graph."""
