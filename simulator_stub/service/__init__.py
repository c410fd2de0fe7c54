"""The shell around the simulation: clients, transports, pace, runs."""
