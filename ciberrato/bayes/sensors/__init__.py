"""Sensor models: log p(reading | state), one file each, natural logarithms, -inf where impossible."""
