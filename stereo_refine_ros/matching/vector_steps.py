# Copyright 2026 stereo_refine_ros contributors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""
Vector steps: what a scanline matcher does to all disparities of one pixel at once.

Generic LLVM vectors, so the compiler picks the instructions of the processor it runs on. How many
disparities there are is part of a type: `lanes` is a tuple of LANES_PER_ITEM disparities an item,
so kernels need no factory and lie in numba's cache like any other. Every step has a plain twin
in `vector_twins`, which takes its place where numba is switched off.

Costs and path values are uint8; sums saturate at 255, which also marks a disparity outside the
range. Offsets are counted in entries.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

LANES_PER_ITEM = 16
# Features of a pixel: two gradients and six bytes of censuses.
PLANES = 8

_I8, _I16, _I32, _I64 = (ir.IntType(bits) for bits in (8, 16, 32, 64))
_Index = types.intp


class _Vectors:
    """The vectors of one step: an IRBuilder with the arguments of the intrinsic at hand."""

    def __init__(self, context: Any, builder: Any, signature: Any, args: Any) -> None:
        self.context, self.builder, self.signature, self.args = context, builder, signature, args
        self.width = signature.args[0].count * LANES_PER_ITEM
        self.bytes = ir.VectorType(_I8, self.width)
        self.words = ir.VectorType(_I16, self.width)

    def array(self, position: int) -> Any:
        kind = self.signature.args[position]
        return self.context.make_array(kind)(
            self.context, self.builder, self.args[position]).data

    def planes(self, position: int, size: Any, index: Any) -> list[Any]:
        """Point to one entry of every plane."""
        places = [self.builder.gep(self.array(position), [index])]
        for _ in range(PLANES - 1):
            places.append(self.builder.gep(places[-1], [size]))
        return places

    def byte(self, position: int) -> Any:
        return self.splat(self.builder.trunc(self.args[position], _I8))

    def load(self, pointer: Any, index: Any, kind: Any = None) -> Any:
        kind = kind or self.bytes
        place = self.builder.bitcast(self.builder.gep(pointer, [index]), kind.as_pointer())
        return self.builder.load(place, align=1)

    def store(self, vector: Any, pointer: Any, index: Any) -> None:
        place = self.builder.bitcast(
            self.builder.gep(pointer, [index]), vector.type.as_pointer())
        self.builder.store(vector, place, align=1)

    def splat(self, scalar: Any) -> Any:
        kind = ir.VectorType(scalar.type, self.width)
        none = ir.Constant(kind, ir.Undefined)
        first = self.builder.insert_element(none, scalar, ir.Constant(_I32, 0))
        zeros = ir.Constant(ir.VectorType(_I32, self.width), [0] * self.width)
        return self.builder.shuffle_vector(first, none, zeros)

    def constant(self, value: int, kind: Any = _I8) -> Any:
        return ir.Constant(ir.VectorType(kind, self.width), [value] * self.width)

    def index(self, value: int) -> Any:
        return ir.Constant(_I64, value)

    def call(self, name: str, result: Any, *args: Any) -> Any:
        module = self.builder.module
        function = module.globals.get(name) or ir.Function(
            module, ir.FunctionType(result, [arg.type for arg in args]), name)
        return self.builder.call(function, list(args))

    def _pairwise(self, name: str, a: Any, b: Any) -> Any:
        suffix = f'v{a.type.count}i{a.type.element.width}'
        return self.call(f'llvm.{name}.{suffix}', a.type, a, b)

    def least_of(self, a: Any, b: Any) -> Any:
        return self._pairwise('umin', a, b)

    def add(self, a: Any, b: Any) -> Any:
        return self._pairwise('uadd.sat', a, b)

    def difference(self, a: Any, b: Any) -> Any:
        return self.builder.sub(self._pairwise('umax', a, b), self._pairwise('umin', a, b))

    def bit_count(self, a: Any) -> Any:
        return self.call(f'llvm.ctpop.v{a.type.count}i8', a.type, a)

    def least(self, a: Any) -> Any:
        """Return the least lane, as int64."""
        suffix = f'v{a.type.count}i{a.type.element.width}'
        value = self.call(f'llvm.vector.reduce.umin.{suffix}', a.type.element, a)
        return self.builder.zext(value, _I64)

    def shifted(self, a: Any, by: int) -> Any:
        """Move the lanes by one, 255 moving in."""
        count = self.width
        order = [count, *range(count - 1)] if by > 0 else [*range(1, count), count]
        return self.builder.shuffle_vector(
            a, self.constant(255), ir.Constant(ir.VectorType(_I32, count), order))

    def widened(self, a: Any) -> Any:
        return self.builder.zext(a, self.words)

    def advance(self, values: Any, beside: Any, least: int, small: int, large: int,
                cost: Any) -> Any:
        """
        Take a path one pixel on: C + min(L, L(d +- 1) + P1, min L + P2) - min L.

        `least`, `small` and `large` are the positions of min L, P1 and P2 among the arguments.
        """
        best = self.least_of(values, self.add(beside, self.byte(small)))
        floor = self.byte(least)
        best = self.least_of(best, self.add(floor, self.byte(large)))
        return self.add(cost, self.builder.sub(best, floor))

    def near(self, lane: Any) -> Any:
        """Mark the lanes that are at most 2 from one (int64)."""
        build = self.builder
        kind = ir.IntType(self.width)
        place = lane if self.width == 64 else (
            build.zext(lane, kind) if self.width > 64 else build.trunc(lane, kind))
        here = build.shl(ir.Constant(kind, 1), place)
        marks = here
        for step in (1, 2):
            by = ir.Constant(kind, step)
            marks = build.or_(marks, build.or_(build.shl(here, by), build.lshr(here, by)))
        return build.bitcast(marks, ir.VectorType(ir.IntType(1), self.width))

    def first_equal(self, a: Any, value: Any) -> Any:
        """Return the first lane that holds a value (int64), as int64."""
        build = self.builder
        same = build.icmp_unsigned(
            '==', a, self.splat(build.trunc(value, a.type.element)))
        mask = build.bitcast(same, ir.IntType(self.width))
        name = f'llvm.cttz.i{self.width}'
        module = build.module
        kind = ir.FunctionType(mask.type, [mask.type, ir.IntType(1)])
        function = module.globals.get(name) or ir.Function(module, kind, name)
        place = build.call(function, [mask, ir.Constant(ir.IntType(1), 1)])
        if self.width < 64:
            return build.zext(place, _I64)
        return place if self.width == 64 else build.trunc(place, _I64)
@intrinsic  # noqa: E302
def match_column(typing, lanes, left, right, size, mask, outside, slope_limit, census_limit, at,
                 partner, seat, cost, to, column, begin, least, small, large, end, kept, keep_at):
    """
    Compare a pixel with its partners, and take the path along its column on to it.

    The cost is min(slopes, limit) + min(census bits, limit). `left` and `right` hold PLANES
    planes of `size` bytes: two gradients, then bytes of a census. Lanes where `outside` is not
    0, from `seat` on, cost what stands there; lanes whose `mask` is 255 become 255. Returns the
    least value of the path; its values are copied to kept[keep_at].
    """
    signature = types.int64(lanes, left, right, _Index, mask, outside, *[_Index] * 5, cost,
                            _Index, column, *[_Index] * 5, kept, _Index)

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        v = _Vectors(context, builder, signature, args)
        fresh = _cost(v, builder, args)
        v.store(fresh, v.array(11), args[12])
        values = _advance_column(v, builder, v.array(13), args[14], args[18], (15, 16, 17), fresh)
        v.store(values, v.array(19), args[20])
        return v.least(values)
    return signature, generate


def _cost(v: _Vectors, builder: Any, args: Any) -> Any:
    here = [v.splat(builder.load(place)) for place in v.planes(1, args[3], args[8])]
    there = [v.load(place, v.index(0)) for place in v.planes(2, args[3], args[9])]
    slope = v.add(v.difference(here[0], there[0]), v.difference(here[1], there[1]))
    bits = None
    for a, b in zip(here[2:], there[2:], strict=True):
        part = v.bit_count(builder.xor(a, b))
        bits = part if bits is None else builder.add(bits, part)
    cost = builder.add(v.least_of(slope, v.byte(6)), v.least_of(bits, v.byte(7)))
    veil = v.load(v.array(5), args[10])
    cost = builder.select(builder.icmp_unsigned('==', veil, v.constant(0)), cost, veil)
    return builder.or_(cost, v.load(v.array(4), v.index(0)))


@intrinsic
def step_both(typing, lanes, row, row_from, row_least, row_small, row_large, row_to,
              column, column_from, column_least, column_small, column_large, column_to,
              cost, at, total, to, offset):
    """
    Take the path along a row and the one down its column a pixel on; their sum goes to `total`.

    The state of a row holds, `offset` entries behind the values, the lesser of both neighbours
    of each: so that the next step loads what one step stored. Returns the least value of the
    row's path, and that of the column's path times 256.
    """
    signature = types.int64(lanes, row, *[_Index] * 5, column, *[_Index] * 5, cost, _Index,
                            total, _Index, _Index)

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        v = _Vectors(context, builder, signature, args)
        fresh = v.load(v.array(13), args[14])
        along = _advance_row(v, builder, v.array(1), args[2], args[6], args[17], (3, 4, 5), fresh)
        down = _advance_column(v, builder, v.array(7), args[8], args[12], (9, 10, 11), fresh)
        v.store(builder.add(v.widened(along), v.widened(down)), v.array(15), args[16])
        return builder.or_(v.least(along), builder.shl(v.least(down), v.index(8)))
    return signature, generate


@intrinsic
def step_column(typing, lanes, column, begin, least, small, large, end, cost, at, kept, to):
    """
    Take the path along a column a pixel on.

    Returns its least value; its values are copied to kept[to].
    """
    signature = types.int64(lanes, column, *[_Index] * 5, cost, _Index, kept, _Index)

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        v = _Vectors(context, builder, signature, args)
        fresh = v.load(v.array(7), args[8])
        values = _advance_column(v, builder, v.array(1), args[2], args[6], (3, 4, 5), fresh)
        v.store(values, v.array(9), args[10])
        return v.least(values)
    return signature, generate


@intrinsic
def step_last(typing, lanes, row, begin, least, small, large, end, cost, at, total, to, up, back,
              offset):
    """
    Take the last path along a row a pixel on, complete the total, and find its winner.

    `up` is added at `back`. Returns, from the lowest bits: the least value of the path (8 bits),
    the winning lane (16), its total (16), and the least total of the lanes farther than 2 from
    it (16).
    """
    signature = types.int64(lanes, row, *[_Index] * 5, cost, _Index, total, _Index, up, _Index,
                            _Index)

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        v = _Vectors(context, builder, signature, args)
        fresh = v.load(v.array(7), args[8])
        along = _advance_row(v, builder, v.array(1), args[2], args[6], args[13], (3, 4, 5), fresh)
        total = builder.add(v.load(v.array(9), args[10], v.words), v.widened(along))
        total = builder.add(total, v.widened(v.load(v.array(11), args[12])))
        v.store(total, v.array(9), args[10])
        most = v.least(total)
        lane = v.first_equal(total, most)
        second = v.least(builder.select(v.near(lane), v.constant(65535, _I16), total))
        found = builder.or_(v.least(along), builder.shl(lane, v.index(8)))
        found = builder.or_(found, builder.shl(most, v.index(24)))
        return builder.or_(found, builder.shl(second, v.index(40)))
    return signature, generate


def _advance_row(v: _Vectors, builder: Any, state: Any, begin: Any, end: Any, offset: Any,
                 positions: tuple[int, int, int], fresh: Any) -> Any:
    values = v.load(state, begin)
    beside = v.load(state, builder.add(begin, offset))
    after = v.advance(values, beside, *positions, fresh)
    v.store(after, state, end)
    v.store(v.least_of(v.shifted(after, 1), v.shifted(after, -1)), state,
            builder.add(end, offset))
    return after


def _advance_column(v: _Vectors, builder: Any, state: Any, begin: Any, end: Any,
                    positions: tuple[int, int, int], fresh: Any) -> Any:
    one = v.index(1)
    beside = v.least_of(v.load(state, builder.sub(begin, one)),
                        v.load(state, builder.add(begin, one)))
    after = v.advance(v.load(state, begin), beside, *positions, fresh)
    v.store(after, state, end)
    return after
