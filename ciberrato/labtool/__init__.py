"""The program ciberrato-lab: make, draw and check labs."""

__all__ = ["cli", "making", "maze", "picture"]
