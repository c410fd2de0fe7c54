"""A run of the agent: link, clock, signals, threads and files around what decides and what filters."""
