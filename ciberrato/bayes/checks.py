"""Checks of the arguments of all functions of this package, and their error messages.

Each check reads its array once or twice, whatever the number of states. Messages name what is wrong, where,
and what would do instead.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ciberrato.bayes.arraytypes import BoolArray, FloatArray, IntArray


def floats(values: ArrayLike) -> FloatArray:
    """Return values as an array of doubles; of single precision if they are an array of that."""
    if isinstance(values, np.ndarray) and values.dtype == np.float32:
        return values
    return np.asarray(values, dtype=float)


def where(wrong: BoolArray) -> str:
    """Return the index of the first True, as in "3" or "(3, 0)", and how many more there are."""
    index = tuple(int(i) for i in np.argwhere(wrong)[0])
    more = int(np.count_nonzero(wrong)) - 1
    name = str(index[0]) if len(index) == 1 else str(index)
    return f"{name} (and {more} more)" if more else name


def belief_array(
    belief: ArrayLike,
    *,
    what: str = "belief",
    shape: tuple[int, ...] | None = None,
    massless: bool = False,
    single: bool = False,
) -> FloatArray:
    """Return a belief as an array of floats, or say why it is none.

    Parameters
    ----------
    belief : array_like
        Any shape; need not sum to 1.
    what : str
        Name for the message.
    shape : tuple of int, optional
        Required shape.
    massless : bool
        Whether all entries may be zero, as after a prediction that lost everything.
    single : bool
        Whether an array of single precision stays one.

    Returns
    -------
    FloatArray

    Raises
    ------
    ValueError
        If an entry is nan, infinite or negative, none is positive, there is no cell, or the shape is wrong.
    """
    values = floats(belief) if single else np.asarray(belief, dtype=float)
    if shape is not None and values.shape != shape:
        raise ValueError(f"the {what} has shape {values.shape}, and must have {shape}")
    if not values.size:
        raise ValueError(f"the {what} has no cells (shape {values.shape})")
    belief_bounds(values, what=what, massless=massless)
    return values


def belief_bounds(values: FloatArray, *, what: str = "belief", massless: bool = False) -> tuple[float, float]:
    """Return the least and the greatest entry of a belief; ValueError as `belief_array`."""
    lowest = float(np.minimum.reduce(values, axis=None, initial=np.inf))
    greatest = float(np.maximum.reduce(values, axis=None, initial=-np.inf))
    # nan fails each comparison; the product bounds the sum.
    if not (lowest >= 0.0 and greatest * values.size < math.inf):
        wrong = ~((values >= 0.0) & (values < np.inf))
        if not wrong.any():
            raise ValueError(f"the {what} sums to infinity: divide it by its greatest entry first")
        raise ValueError(
            f"a {what} must be finite and not negative: cell {where(wrong)} is {values[wrong].flat[0]}"
        )
    if greatest <= 0.0 and not massless:
        raise ValueError(f"the {what} is zero in every cell: it has no mass to speak of")
    return lowest, greatest


def log_likelihood_array(log_likelihood: ArrayLike, shape: tuple[int, ...]) -> FloatArray:
    """Return log likelihoods as an array of floats (of 32 bits if they are); ValueError if the shape differs.

    The caller checks their values by `refuse_log_likelihood`, once their maximum is known.
    """
    values: FloatArray = np.asarray(log_likelihood)
    if values.dtype != np.float32:
        values = np.asarray(values, dtype=float)
    if values.shape != shape:
        raise ValueError(f"the log likelihood has shape {values.shape}, the belief {shape}")
    return values


def refuse_log_likelihood(values: FloatArray) -> None:
    """Raise the ValueError that says where a log likelihood is nan or +inf."""
    wrong = ~(values < np.inf)
    raise ValueError(
        f"a log likelihood must be below infinity and not nan: state {where(wrong)} has "
        f"{values[wrong].flat[0]}; -inf is impossible, 0 in all states says nothing"
    )


def range_array(
    reading: ArrayLike, *, beams: int | None = None, signed: bool = False, what: str = "beam"
) -> FloatArray:
    """Return ranges as an array, by the rule of all sensors.

    nan is no reading (the beam is skipped), +inf nothing within range.

    Parameters
    ----------
    reading : array_like
        Reading, of any shape if the number of beams is left out.
    beams : int, optional
        Required number of beams, in one dimension.
    signed : bool
        Whether readings below zero are readings, too: only -inf is refused then.
    what : str
        Name of one entry, for the message.

    Raises
    ------
    ValueError
        If a range is negative or -inf, or there are more or fewer than beams.
    """
    values: FloatArray = np.asarray(reading, dtype=float)
    if beams is not None and values.shape != (beams,):
        raise ValueError(
            f"the reading has shape {values.shape}, and the map {beams} {what}s: need ({beams},)"
        )
    if values.size and values.min() >= 0.0:
        return values
    wrong = values == -np.inf if signed else values < 0.0
    if wrong.any():
        least = "finite" if signed else "0 or more"
        hint = "" if signed else "; for readings that may be negative set signed=True where the sensor has it"
        raise ValueError(
            f"{what} {where(wrong)} reads {values[wrong].flat[0]}: readings are {least}, nan where there is "
            f"none, inf where nothing is within range{hint if what == 'beam' else ''}"
        )
    return values


def map_array(values: ArrayLike, *, what: str = "map", signed: bool = True) -> FloatArray:
    """Return expected readings as an array; ValueError that names the cell (and beam) if one is nan.

    Unless `signed`, one below zero is refused as well.
    """
    result: FloatArray = np.asarray(values, dtype=float)
    wrong = np.isnan(result)
    if wrong.any():
        refuse_map(wrong, what=what)
    if not signed:
        refuse_negative_map(result)
    return result


def refuse_map(wrong: BoolArray, *, what: str = "map") -> None:
    """Raise the ValueError that says where a map holds nan."""
    raise ValueError(
        f"the {what} is nan at {where(wrong)} of shape {wrong.shape}: cells where no reading can be taken "
        "belong out of the belief (mass 0), not into the map"
    )


def refuse_negative_map(mean: FloatArray) -> None:
    """Raise ValueError where readings below zero are expected of a sensor that has none; nan passes."""
    if mean.size and mean.min() < 0.0:
        wrong = mean < 0.0
        raise ValueError(
            f"the map is {mean[wrong].flat[0]} at {where(wrong)} of shape {mean.shape}: expected readings "
            "are 0 or more; for readings that may be negative set signed=True, for angles take AngleSensor"
        )


def finite_array(values: ArrayLike, *, what: str) -> FloatArray:
    """Return an array of finite numbers; ValueError that names the first which is not."""
    result: FloatArray = np.asarray(values, dtype=float)
    # A sum that is finite has only finite terms; one that is not may have overflowed.
    if not math.isfinite(result.sum()) and not np.isfinite(result).all():
        wrong = ~np.isfinite(result)
        place = f" at {where(wrong)}" if result.ndim else ""
        raise ValueError(f"{what} must be finite, not {result[wrong].flat[0]}{place}")
    return result


def positive(value: Any, *, what: str) -> None:
    """Raise ValueError unless a number, or all of an array, is positive and finite."""
    values = np.asarray(value, dtype=float)
    if not (values > 0.0).all() or not (values < np.inf).all():
        raise ValueError(f"{what} must be positive and finite, not {value}")


def whole(value: Any, *, what: str, least: int | None = None) -> int:
    """Return a whole number as int: those of numpy and floats without a fraction count, 1.9 and True do not.

    Parameters
    ----------
    value : object
        The number.
    what : str
        Name for the message.
    least : int, optional
        Smaller ones are refused.

    Raises
    ------
    ValueError
        If it is no whole number, or too small.
    """
    number: int | None = None
    if not isinstance(value, bool | np.bool_):
        if isinstance(value, float | np.floating):
            number = int(value) if float(value).is_integer() else None
        else:
            try:
                number = operator.index(value)
            except TypeError:
                number = None
    if number is None or (least is not None and number < least):
        bound = "" if least is None else f" of {least} or more"
        raise ValueError(f"{what} must be a whole number{bound}, not {value!r}")
    return number


def whole_array(values: ArrayLike, *, what: str) -> IntArray:
    """Return an array of whole numbers as integers, by the rule of `whole`."""
    array = np.asarray(values)
    if array.dtype.kind in "iu" or not array.size:
        return array.astype(np.intp)
    if array.dtype.kind != "f":
        raise ValueError(f"{what} must be whole numbers, not {array.flat[0]!r}")
    wrong = ~((np.abs(array) < 2.0**53) & (array == np.rint(array)))
    if wrong.any():
        raise ValueError(f"{what} must be whole numbers, not {array[wrong].flat[0]}")
    return array.astype(np.intp)


def transition_array(matrix: Any, *, states: int | None = None, what: str = "transition matrix") -> Any:
    """Return a transition matrix, dense as floats or sparse as it is, or say why it is none.

    Parameters
    ----------
    matrix : array_like or scipy sparse matrix
        Rows are states before; entries 0 or more, row sums at most 1 (what is missing is lost).
    states : int, optional
        Required number of states.
    what : str
        Name for the message.

    Raises
    ------
    ValueError
        If it is not square, has another size, a negative entry or nan, or a row above 1.
    """
    if hasattr(matrix, "tocsr"):
        result = matrix if matrix.format in ("csr", "csc") else matrix.tocsr()
        result = result if result.dtype == float else result.astype(float)
    else:
        result = np.asarray(matrix, dtype=float)
    shape = result.shape
    if len(shape) != 2 or shape[0] != shape[1] or (states is not None and shape[0] != states):
        wanted = "square" if states is None else f"({states}, {states}), one row and column for every state"
        raise ValueError(f"the {what} has shape {shape}, and must be {wanted}")
    least = float(result.min())
    sums = np.asarray(result.sum(axis=1)).ravel()
    if not least >= 0.0:
        raise ValueError(f"the {what} has an entry of {least}: probabilities are 0 or more")
    if not (sums <= 1.0 + 1e-9).all():
        row = int(np.argmax(~(sums <= 1.0 + 1e-9)))
        hint = "; its columns do: rows are states before, transpose it" if _columns_sum_to_one(result) else ""
        raise ValueError(f"row {row} of the {what} sums to {sums[row]:g}, above 1{hint}")
    return result


def _columns_sum_to_one(matrix: Any) -> bool:
    return bool(np.allclose(np.asarray(matrix.sum(axis=0)).ravel(), 1.0, atol=1e-9))


def same_length(**arrays: Sequence[Any] | np.ndarray[Any, Any]) -> None:
    """Raise ValueError unless all have the same length; keywords are their names."""
    lengths = {name: len(values) for name, values in arrays.items()}
    if len(set(lengths.values())) > 1:
        told = ", ".join(f"{count} {name}" for name, count in lengths.items())
        raise ValueError(f"lengths must agree, one for each reading: {told}")
