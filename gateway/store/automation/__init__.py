"""Tables of events, rules, functions and the queue between them."""
