# mypy: disallow-untyped-defs=False, disallow-untyped-calls=False, disallow-untyped-decorators=False
# mypy: disallow-incomplete-defs=False
# mypy: disable-error-code="no-any-return,misc"
# The types are those of numba and LLVM.
"""Eight numbers at once in numba's machine code: what its loops are not made into by themselves.

A vector has `LANES` numbers of single or double precision, or `MANY` of single precision. The functions work
inside functions compiled by numba only. The compiler makes of them what the processor has: one operation with
AVX-512, two with AVX2.

Imported by `ciberrato.bayes.loops` and its siblings only.
"""

from __future__ import annotations

from typing import Any

import numba
import numpy as np
from llvmlite import ir
from numba.core import types
from numba.extending import intrinsic as numbas_intrinsic
from numba.extending import models, register_model

LANES, MANY = 8, 16
intrinsic: Any = numbas_intrinsic


class Vector(types.Type):
    """Numba's type of some numbers."""

    def __init__(self, dtype, lanes=LANES) -> None:
        self.dtype, self.lanes = dtype, lanes
        super().__init__(name=f"Vector({dtype}, {lanes})")


@register_model(Vector)
class _VectorModel(models.PrimitiveModel):
    def __init__(self, manager, kind) -> None:
        super().__init__(manager, kind, _llvm(kind.dtype, kind.lanes))


def _llvm(dtype, lanes=LANES):
    return ir.VectorType(ir.DoubleType() if dtype == types.float64 else ir.FloatType(), lanes)


@numba.njit
def zeros(size, dtype):
    """Return zeros that begin with a cache line, so that no vector lies in two of them."""
    room = np.zeros(size + 64 // 4, dtype)
    begin = -room.ctypes.data % 64 // room.itemsize
    return room[begin : begin + size]


def _splat(builder, value):
    one = builder.insert_element(
        ir.Constant(ir.VectorType(value.type, LANES), ir.Undefined), value, ir.Constant(ir.IntType(32), 0)
    )
    return builder.shuffle_vector(one, one, ir.Constant(ir.VectorType(ir.IntType(32), LANES), [0] * LANES))


def _constant(vector, value):
    return ir.Constant(vector, [value] * LANES)


def _pointer(context, builder, kind, array, index, lanes=LANES):
    data = context.make_array(kind)(context, builder, array).data
    address = builder.gep(data, [index])
    return builder.bitcast(address, _llvm(kind.dtype, lanes).as_pointer())


@intrinsic
def load(_, array, index):
    """Return the vector from an index of a flat array on."""

    def code(context, builder, signature, given):
        address = _pointer(context, builder, signature.args[0], *given)
        return builder.load(address, align=array.dtype.bitwidth // 8)

    return Vector(array.dtype)(array, types.uint64), code


@intrinsic
def load_many(_, array, index):
    """Return the vector of `MANY` numbers from an index of a flat array on."""

    def code(context, builder, signature, given):
        address = _pointer(context, builder, signature.args[0], given[0], given[1], MANY)
        return builder.load(address, align=array.dtype.bitwidth // 8)

    return Vector(array.dtype, MANY)(array, types.uint64), code


@intrinsic
def store(_, array, index, vector):
    """Store a vector to an index of a flat array."""

    def code(context, builder, signature, given):
        address = _pointer(context, builder, signature.args[0], given[0], given[1], vector.lanes)
        builder.store(given[2], address, align=array.dtype.bitwidth // 8)
        return context.get_dummy_value()

    return types.void(array, types.uint64, vector), code


@intrinsic
def stream(_, array, index, vector):
    """Store a vector, which must lie in one cache line, past the caches: memory is not read first."""

    def code(context, builder, signature, given):
        address = _pointer(context, builder, signature.args[0], given[0], given[1])
        put = builder.store(given[2], address, align=LANES * array.dtype.bitwidth // 8)
        one = builder.module.add_metadata([ir.Constant(ir.IntType(32), 1)])
        put.set_metadata("nontemporal", one)
        return context.get_dummy_value()

    return types.void(array, types.uint64, vector), code


@intrinsic
def finish(_):
    """Wait until what was streamed is there for other threads."""

    def code(context, builder, signature, given):
        builder.fence("seq_cst")
        return context.get_dummy_value()

    return types.void(), code


@intrinsic
def prefetch(_, array, index):
    """Ask memory for the cache line of an index, which may be beyond the array."""

    def code(context, builder, signature, given):
        data = context.make_array(signature.args[0])(context, builder, given[0]).data
        address = builder.bitcast(builder.gep(data, [given[1]]), ir.IntType(8).as_pointer())
        name, number = "llvm.prefetch.p0i8", ir.IntType(32)
        kind = ir.FunctionType(ir.VoidType(), [ir.IntType(8).as_pointer(), number, number, number])
        function = builder.module.globals.get(name) or ir.Function(builder.module, kind, name)
        builder.call(function, [address, number(0), number(3), number(1)])
        return context.get_dummy_value()

    return types.void(array, types.uint64), code


@intrinsic
def store_in_turn(_, array, index, one, other):
    """Store two vectors to an index of a flat array, a number of the one and of the other in turn."""

    def code(context, builder, signature, given):
        address = _pointer(context, builder, signature.args[0], given[0], given[1], 2 * one.lanes)
        order = [lane + side * one.lanes for lane in range(one.lanes) for side in (0, 1)]
        mask = ir.Constant(ir.VectorType(ir.IntType(32), 2 * one.lanes), order)
        both = builder.shuffle_vector(given[2], given[3], mask)
        builder.store(both, address, align=array.dtype.bitwidth // 8)
        return context.get_dummy_value()

    return types.void(array, types.uint64, one, one), code


@intrinsic
def splat(_, value):
    """Return a vector of equal numbers."""

    def code(context, builder, signature, given):
        return _splat(builder, given[0])

    return Vector(value)(value), code


@intrinsic
def add(_, one, other):
    """Return the sum."""

    def code(context, builder, signature, given):
        return builder.fadd(*given)

    return one(one, one), code


@intrinsic
def subtract(_, one, other):
    """Return the difference."""

    def code(context, builder, signature, given):
        return builder.fsub(*given)

    return one(one, one), code


@intrinsic
def multiply(_, one, other):
    """Return the product."""

    def code(context, builder, signature, given):
        return builder.fmul(*given)

    return one(one, one), code


@intrinsic
def multiply_add(_, one, other, third):
    """Return one * other + third, rounded once where the processor can."""

    def code(context, builder, signature, given):
        kind = given[0].type
        name = f"llvm.fmuladd.v{LANES}f{one.dtype.bitwidth}"
        known = builder.module.globals.get(name)
        function = known or ir.Function(builder.module, ir.FunctionType(kind, [kind] * 3), name)
        return builder.call(function, given)

    return one(one, one, one), code


@intrinsic
def double(_, vector):
    """Return a vector in double precision."""

    def code(context, builder, signature, given):
        return given[0] if vector.dtype == types.float64 else builder.fpext(given[0], _llvm(types.float64))

    return Vector(types.float64)(vector), code


@intrinsic
def as_in(_, vector, array):
    """Return a vector in the precision of an array."""

    def code(context, builder, signature, given):
        kind = _llvm(array.dtype)
        if given[0].type == kind:
            return given[0]
        return (
            builder.fptrunc(given[0], kind) if array.dtype == types.float32 else builder.fpext(given[0], kind)
        )

    return Vector(array.dtype)(vector, array), code


@intrinsic
def greater(_, one, other):
    """Return the greater of each two; the other where one is nan."""

    def code(context, builder, signature, given):
        return builder.select(builder.fcmp_ordered(">", *given), *given)

    return one(one, one), code


@intrinsic
def where_at_least(_, vector, tested, least):
    """Return the vector where what is tested is not below the least, else 0."""

    def code(context, builder, signature, given):
        held = builder.fcmp_ordered(">=", given[1], given[2])
        return builder.select(held, given[0], _constant(given[0].type, 0.0))

    return vector(vector, tested, tested), code


@intrinsic
def times_power_of_two(_, vector, shifted):
    """Return a vector of doubles times 2^n, where shifted is n + 1.5 * 2^52."""

    def code(context, builder, signature, given):
        whole = ir.VectorType(ir.IntType(64), LANES)
        bits = builder.bitcast(given[1], whole)
        bits = builder.shl(builder.add(bits, _constant(whole, 1023)), _constant(whole, 52))
        return builder.fmul(given[0], builder.bitcast(bits, given[0].type))

    return vector(vector, vector), code


def _mask(builder, held):
    return builder.zext(builder.bitcast(held, ir.IntType(LANES)), ir.IntType(64))


@intrinsic
def positive(_, vector):
    """Return which numbers are above 0, as bits of a uint64."""

    def code(context, builder, signature, given):
        return _mask(builder, builder.fcmp_ordered(">", given[0], _constant(given[0].type, 0.0)))

    return types.uint64(vector), code


@intrinsic
def outside(_, vector, least, most):
    """Return which numbers are not between two vectors, or nan, as bits of a uint64."""

    def code(context, builder, signature, given):
        low = builder.fcmp_ordered(">=", given[0], given[1])
        high = builder.fcmp_ordered("<=", given[0], given[2])
        return _mask(builder, builder.not_(builder.and_(low, high)))

    return types.uint64(vector, vector, vector), code


@intrinsic
def count(_, mask):
    """Return how many bits are set."""

    def code(context, builder, signature, given):
        return builder.ctpop(given[0])

    return types.uint64(types.uint64), code


@intrinsic
def total(_, vector):
    """Return the sum of the numbers, the first two first."""

    def code(context, builder, signature, given):
        result = builder.extract_element(given[0], ir.Constant(ir.IntType(32), 0))
        for lane in range(1, LANES):
            result = builder.fadd(
                result, builder.extract_element(given[0], ir.Constant(ir.IntType(32), lane))
            )
        return result

    return vector.dtype(vector), code


@intrinsic
def transpose(_, array, start, stride, out, onto, step):
    """Store `LANES` vectors of an array, a stride apart, to another, a step apart, rows as columns."""

    def code(context, builder, signature, given):
        source, start, stride, target, onto, step = given
        rows = []
        for k in range(LANES):
            at = builder.add(start, builder.mul(stride, ir.Constant(ir.IntType(64), k)))
            address = _pointer(context, builder, signature.args[0], source, at)
            rows.append(builder.load(address, align=array.dtype.bitwidth // 8))
        # Three rounds of exchanges between rows 4, 2 and 1 apart.
        for width in (4, 2, 1):
            # Lane i of the result: of the row itself, or of its partner, where that bit of i says so.
            lower = [i if not i & width else LANES + i - width for i in range(LANES)]
            upper = [i + width if not i & width else LANES + i for i in range(LANES)]
            done = list(rows)
            for k in range(LANES):
                if not k & width:
                    pair = rows[k], rows[k + width]
                    done[k], done[k + width] = (
                        builder.shuffle_vector(
                            *pair, ir.Constant(ir.VectorType(ir.IntType(32), LANES), lanes)
                        )
                        for lanes in (lower, upper)
                    )
            rows = done
        for k in range(LANES):
            at = builder.add(onto, builder.mul(step, ir.Constant(ir.IntType(64), k)))
            address = _pointer(context, builder, signature.args[3], target, at)
            builder.store(rows[k], address, align=array.dtype.bitwidth // 8)
        return context.get_dummy_value()

    number = types.uint64
    return types.void(array, number, number, out, number, number), code
