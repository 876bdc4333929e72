"""Wide numbers: LANES float64 side by side, so that one kernel steps as many vehicles at once by the vector unit.

A kernel is written once, for numbers. Called with float64 it is compiled for one vehicle; called with wide numbers, or
arrays of them (`as_wide`), for LANES: each operation becomes one on vectors, whatever a compiler's loops would have
made of it. Nothing goes from lane to lane. A kernel that is to be used so keeps three rules:

- what depends on a comparison of numbers is chosen by `where`, both sides being worked out; an `if` asks `anywhere`
  whether any lane wants what it guards, and what it guards then leaves the others' numbers alone;
- `&` and `|` join comparisons, not `and` and `or`;
- scratch is made by `room`.

Kernels import all of it from firmware/core/maths/wide, which has the functions, too. As plain Python (GLIDER_JIT=0) a
wide number is a float and LANES is 1.
"""

import math
import operator

import numpy as np
from llvmlite import ir
from numba.core import cgutils, types
from numba.core.typeconv import Conversion
from numba.extending import intrinsic, lower_builtin, lower_cast, models, overload, register_model, type_callable
from numba.np import arrayobj

from glider.firmware.core.jit import CACHE_DIR

LANES = 4 if CACHE_DIR is not None else 1


class WideType(types.Type):
    """LANES float64. A float64 or an integer where one is wanted stands for the same number in every lane."""

    def __init__(self):
        super().__init__(name=f"wide{LANES}")

    def can_convert_from(self, typingctx, other):
        """Numbers become wide ones, where no kernel of plain ones fits them better."""
        return Conversion.safe if isinstance(other, (types.Float, types.Integer)) else None

    def unify(self, typingctx, other):
        """A name that holds now a wide number, now a plain one, holds wide ones."""
        return self if isinstance(other, (types.Float, types.Integer)) else None


class MaskType(types.Type):
    """A truth value a lane: what a comparison of wide numbers is."""

    def __init__(self):
        super().__init__(name=f"mask{LANES}")

    def can_convert_from(self, typingctx, other):
        """A plain truth value holds in every lane."""
        return Conversion.safe if isinstance(other, types.Boolean) else None

    def unify(self, typingctx, other):
        """As of wide numbers."""
        return self if isinstance(other, types.Boolean) else None


WIDE, MASK = WideType(), MaskType()
_VECTOR, _TRUTHS = ir.VectorType(ir.DoubleType(), LANES), ir.VectorType(ir.IntType(1), LANES)
_NUMBERS = (types.Float, types.Integer)


@register_model(WideType)
class _WideModel(models.PrimitiveModel):
    def __init__(self, manager, kind):
        super().__init__(manager, kind, _VECTOR)


@register_model(MaskType)
class _MaskModel(models.PrimitiveModel):
    def __init__(self, manager, kind):
        super().__init__(manager, kind, _TRUTHS)


def _splat(builder, value, vector=_VECTOR):
    first = builder.insert_element(ir.Constant(vector, ir.Undefined), value, ir.Constant(ir.IntType(32), 0))
    return builder.shuffle_vector(
        first, ir.Constant(vector, ir.Undefined), ir.Constant(ir.VectorType(ir.IntType(32), LANES), [0] * LANES)
    )


@lower_cast(types.Float, WideType)
@lower_cast(types.Integer, WideType)
def _number_to_wide(context, builder, fromty, toty, value):
    return _splat(builder, context.cast(builder, value, fromty, types.float64))


@lower_cast(types.Boolean, MaskType)
def _truth_to_mask(context, builder, fromty, toty, value):
    return _splat(builder, context.cast(builder, value, fromty, types.boolean), _TRUTHS)


def is_wide(*kinds):
    """Whether these types are wide numbers and plain ones, and one of them is wide."""
    return WIDE in kinds and all(kind == WIDE or isinstance(kind, _NUMBERS) for kind in kinds)


def _operation(function, count, build, result=WIDE):
    """Make a function of `count` numbers one of wide numbers, too: build(builder, vectors...) -> vector."""
    if count == 1:

        @type_callable(function)
        def one(context):
            return lambda a: result if a == WIDE else None

        signatures = [(WideType,)]
    else:

        @type_callable(function)
        def two(context):
            return lambda a, b: result if is_wide(a, b) else None

        signatures = [(WideType, WideType)]
        signatures += [pair for kind in _NUMBERS for pair in ((WideType, kind), (kind, WideType))]

    def lower(context, builder, sig, args):
        return build(builder, *(context.cast(builder, a, kind, WIDE) for a, kind in zip(args, sig.args, strict=True)))

    for signature in signatures:
        lower_builtin(function, *signature)(lower)


def _called(name):
    """A function of LLVM's own, of as many vectors as it is given."""

    def build(builder, *vectors):
        kind = ir.FunctionType(_VECTOR, [_VECTOR] * len(vectors))
        return builder.call(cgutils.get_or_insert_function(builder.module, kind, f"llvm.{name}.v{LANES}f64"), vectors)

    return build


def _remainder(builder, a, b):
    """a - floor(a / b) b: Python's, but where rounding takes a / b to a whole number."""
    return builder.fsub(a, builder.fmul(_called("floor")(builder, builder.fdiv(a, b)), b))


def _compared(sign):
    ordered = sign != "!="  # as of floats: NaN differs from everything, and compares with nothing
    return lambda builder, a, b: (builder.fcmp_ordered if ordered else builder.fcmp_unordered)(sign, a, b)


def _chosen(sign):
    """min and max as Python has them: the second where it is beyond the first."""
    return lambda builder, a, b: builder.select(builder.fcmp_ordered(sign, b, a), b, a)


for _sign in ("add", "sub", "mul", "truediv"):
    _name = f"f{_sign.removeprefix('true')}"
    _operation(getattr(operator, _sign), 2, lambda builder, a, b, name=_name: getattr(builder, name)(a, b))
    _operation(getattr(operator, f"i{_sign}"), 2, lambda builder, a, b, name=_name: getattr(builder, name)(a, b))
_operation(operator.mod, 2, lambda builder, a, b: _remainder(builder, a, b))
_operation(operator.neg, 1, lambda builder, a: builder.fneg(a))
_operation(abs, 1, _called("fabs"))
_operation(math.sqrt, 1, _called("sqrt"))
_operation(math.copysign, 2, _called("copysign"))
_operation(math.isnan, 1, lambda builder, a: builder.fcmp_unordered("uno", a, a), MASK)
_operation(min, 2, _chosen("<"))
_operation(max, 2, _chosen(">"))
for _name, _sign in {"lt": "<", "le": "<=", "gt": ">", "ge": ">=", "eq": "==", "ne": "!="}.items():
    _operation(getattr(operator, _name), 2, _compared(_sign), MASK)


def _joined(function, build):
    """Make & or | one of masks, too, and of a mask and a truth value."""

    @type_callable(function)
    def masks(context):
        def typer(a, b):
            known = all(isinstance(kind, (MaskType, types.Boolean)) for kind in (a, b))
            return MASK if known and MASK in (a, b) else None

        return typer

    def lower(context, builder, sig, args):
        return build(builder, *(context.cast(builder, a, kind, MASK) for a, kind in zip(args, sig.args, strict=True)))

    for signature in ((MaskType, MaskType), (MaskType, types.Boolean), (types.Boolean, MaskType)):
        lower_builtin(function, *signature)(lower)


_joined(operator.and_, lambda builder, a, b: builder.and_(a, b))
_joined(operator.or_, lambda builder, a, b: builder.or_(a, b))


def where(condition, then, other):
    """`then` where the condition holds, else `other`; both have been worked out."""
    return then if condition else other


@intrinsic
def _select(typingctx, condition, then, other):
    def codegen(context, builder, sig, args):
        a, b = (context.cast(builder, args[n], sig.args[n], WIDE) for n in (1, 2))
        return builder.select(args[0], a, b)

    return WIDE(condition, then, other), codegen


@overload(where)
def _where(condition, then, other):
    if condition == MASK:
        return lambda condition, then, other: _select(condition, then, other)
    return lambda condition, then, other: then if condition else other


def anywhere(condition):
    """Whether a condition holds in any lane."""
    return condition


def everywhere(condition):
    """Whether a condition holds in every lane."""
    return condition


def _reduced(how):
    @intrinsic
    def reduce(typingctx, condition):
        def codegen(context, builder, sig, args):
            bits = builder.bitcast(args[0], ir.IntType(LANES))
            if how == "any":
                return builder.icmp_unsigned("!=", bits, ir.Constant(bits.type, 0))
            return builder.icmp_unsigned("==", bits, ir.Constant(bits.type, -1))

        return types.boolean(condition), codegen

    return reduce


_any, _all = _reduced("any"), _reduced("all")


@overload(anywhere)
def _anywhere(condition):
    if condition == MASK:
        return lambda condition: _any(condition)
    return lambda condition: condition


@overload(everywhere)
def _everywhere(condition):
    if condition == MASK:
        return lambda condition: _all(condition)
    return lambda condition: condition


def lanes(x):
    """How many numbers x is."""
    return 1


@overload(lanes)
def _lanes(x):
    if x == WIDE:
        return lambda x: LANES
    return lambda x: 1


def lane(x, number):
    """What x is in a lane; a plain number is the same in all."""
    return x


def with_lane(x, number, value):
    """x with this value in a lane; a plain number has but one."""
    return value


@intrinsic
def _extract(typingctx, x, number):
    def codegen(context, builder, sig, args):
        at = context.cast(builder, args[1], sig.args[1], types.int64)
        return builder.extract_element(args[0], at)

    return types.float64(x, number), codegen


@intrinsic
def _insert(typingctx, x, number, value):
    def codegen(context, builder, sig, args):
        at = context.cast(builder, args[1], sig.args[1], types.int64)
        value = context.cast(builder, args[2], sig.args[2], types.float64)
        return builder.insert_element(args[0], value, at)

    return WIDE(x, number, value), codegen


@overload(lane)
def _lane(x, number):
    if x == WIDE:
        return lambda x, number: _extract(x, number)
    return lambda x, number: x


@overload(with_lane)
def _with_lane(x, number, value):
    if x == WIDE:
        return lambda x, number, value: _insert(x, number, value)
    return lambda x, number, value: value


def spread(value, like):
    """A value in all lanes of a number like `like`."""
    return value


@intrinsic
def _as_number(typingctx, value):
    return WIDE(value), lambda context, builder, sig, args: context.cast(builder, args[0], sig.args[0], WIDE)


@overload(spread)
def _spread(value, like):
    if like == WIDE and value != WIDE:
        return lambda value, like: _as_number(value)
    return lambda value, like: value


def as_wide(table):
    """A C-contiguous array of floats (..., LANES) as an array (...) of wide numbers: the same memory."""
    if table.shape[-1] != 1:
        raise ValueError("plain Python has one lane")
    return table[..., 0]


@type_callable(as_wide)
def _as_wide_type(context):
    def made(table):
        if isinstance(table, types.Array) and table.dtype == types.float64 and table.layout == "C" and table.ndim >= 2:
            return types.Array(WIDE, table.ndim - 1, "C", aligned=False)
        return None

    return made


@lower_builtin(as_wide, types.Array)
def _as_wide(context, builder, sig, args):
    (table,) = sig.args
    source = arrayobj.make_array(table)(context, builder, args[0])
    made = arrayobj.make_array(sig.return_type)(context, builder)
    vectors = builder.bitcast(source.data, context.get_data_type(WIDE).as_pointer())
    arrayobj.populate_array(
        made, data=vectors, shape=cgutils.unpack_tuple(builder, source.shape, table.ndim)[:-1],
        strides=cgutils.unpack_tuple(builder, source.strides, table.ndim)[:-1],
        itemsize=context.get_constant(types.intp, 8 * LANES), meminfo=source.meminfo, parent=source.parent,
    )  # fmt: skip
    return arrayobj.impl_ret_borrowed(context, builder, sig.return_type, made._getvalue())


def room(like, shape):
    """An array of zeros of this shape, a tuple, of such numbers as the array `like` holds."""
    return np.zeros(shape)


@overload(room)
def _room(like, shape):
    if like.dtype == WIDE:
        return lambda like, shape: as_wide(np.zeros((*shape, LANES)))
    return lambda like, shape: np.zeros(shape)
