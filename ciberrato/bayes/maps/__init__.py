"""Maps in which ranges can be computed: occupancy grids and line segments."""

import pkgutil

__all__ = [module.name for module in pkgutil.iter_modules(__path__)]
