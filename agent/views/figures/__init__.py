"""Figures of labs, sensors, beliefs and runs. matplotlib is loaded only when one is drawn."""

from agent.views.figures.beliefs import belief_panels
from agent.views.figures.canvas import save_figure

__all__ = ["belief_panels", "save_figure"]
