"""Runs and beliefs to look at: tables, screens, overlays and figures. Nothing here is in the agent's way."""
