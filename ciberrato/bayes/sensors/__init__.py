"""Sensor models: log p(reading | state), one file each, natural logarithms, -inf where impossible."""

import pkgutil

__all__ = [module.name for module in pkgutil.iter_modules(__path__)]
