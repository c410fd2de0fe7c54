"""Motion models: p(state after | control, state before), one file each.

Each has `predict(belief, control) -> belief`. The result may hold less mass than the belief: what crossed an
edge that loses it. `ciberrato.bayes.filtering.predict` normalizes and reports the loss. Models over poses and
`GaussianShift` have `predict_carried`, too, for motion finer than the cells.
"""

import pkgutil

__all__ = [module.name for module in pkgutil.iter_modules(__path__)]
