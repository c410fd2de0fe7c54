"""CiberRato: what is true of the CiberRato world, whoever asks."""

__version__ = "0.1.0"
