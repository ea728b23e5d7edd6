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
range. Values of a path are kept less their least, so that sums near the least one fit a byte too.
`table` holds penalties, W bytes each: of the rows P1 and P2 across an edge, both elsewhere, then
of the columns; the flag of a step is 1 where there is no edge. Offsets are counted in entries.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from stereo_refine_ros.matching.vector_twins import LANES_PER_ITEM, LEFT_PLANES, PLANES, SPAN

_I1, _I8, _I32, _I64 = (ir.IntType(bits) for bits in (1, 8, 32, 64))
_Index = types.intp


class _Vectors:
    """The vectors of one step: an IRBuilder with the arguments of the intrinsic at hand."""

    def __init__(self, context: Any, builder: Any, signature: Any, args: Any) -> None:
        self.context, self.builder, self.signature, self.args = context, builder, signature, args
        self.width = signature.args[0].count * LANES_PER_ITEM
        self.bytes = ir.VectorType(_I8, self.width)
        self.words = ir.VectorType(_I32, self.width // 4)
        self.pairs = ir.VectorType(ir.IntType(16), self.width // 2)

    def array(self, position: int) -> Any:
        kind = self.context.make_array(self.signature.args[position])
        return kind(self.context, self.builder, self.args[position]).data

    def opaque(self, value: Any) -> Any:
        """Hide from LLVM where a value comes from, where what it makes of that costs time."""
        return self.builder.asm(
            ir.FunctionType(value.type, [value.type]), '', '=r,0', [value], False)

    def planes(self, position: int, size: Any, index: Any) -> list[Any]:
        """Load from every plane, from places that x86 sums up while it loads."""
        build = self.builder
        first = self.opaque(build.gep(self.array(position), [index]))
        fourth = build.gep(first, [build.mul(size, self.index(3))])
        ways = [(fourth, k - 3) if k in (3, 5, 7) else (first, k) for k in range(PLANES)]
        return [self.load(base, build.mul(size, self.index(by))) for base, by in ways]

    def load(self, pointer: Any, index: Any) -> Any:
        return self.builder.load(self._place(pointer, index), align=1)

    def store(self, vector: Any, pointer: Any, index: Any) -> None:
        self.builder.store(vector, self._place(pointer, index), align=1)

    def _place(self, pointer: Any, index: Any) -> Any:
        return self.builder.bitcast(self.builder.gep(pointer, [index]), self.bytes.as_pointer())

    def word(self, position: int, index: Any) -> Any:
        """Load four equal bytes into all lanes, which x86 does while it computes."""
        return self.splat(self.builder.load(self.builder.gep(self.array(position), [index])), 4)

    def splat(self, scalar: Any, lanes_each: int = 1) -> Any:
        count = self.width // lanes_each
        none = ir.Constant(ir.VectorType(scalar.type, count), ir.Undefined)
        first = self.builder.insert_element(none, scalar, ir.Constant(_I32, 0))
        return self._shuffle(first, [0] * count)

    def _shuffle(self, a: Any, order: list[int], b: Any = None) -> Any:
        places = ir.Constant(ir.VectorType(_I32, len(order)), order)
        return self.builder.shuffle_vector(a, b or ir.Constant(a.type, ir.Undefined), places)

    def constant(self, value: int) -> Any:
        return ir.Constant(self.bytes, [value] * self.width)

    def index(self, value: int) -> Any:
        return ir.Constant(_I64, value)

    def call(self, name: str, result: Any, *args: Any) -> Any:
        """Call one of LLVM's functions, which end in the type that they are for."""
        kind = args[0].type
        module = self.builder.module
        name = f'llvm.{name}.v{kind.count}i{kind.element.width}'
        signature = ir.FunctionType(result, [arg.type for arg in args])
        function = module.globals.get(name) or ir.Function(module, signature, name)
        return self.builder.call(function, list(args))

    def least_of(self, a: Any, b: Any) -> Any:
        return self.call('umin', a.type, a, b)

    def add(self, a: Any, b: Any) -> Any:
        return self.call('uadd.sat', a.type, a, b)

    def difference(self, a: Any, b: Any) -> Any:
        return self.builder.sub(self.call('umax', a.type, a, b), self.least_of(a, b))

    def least(self, a: Any) -> Any:
        """Return the least lane."""
        return self.call('vector.reduce.umin', a.type.element, a)

    def shifted(self, a: Any, by: int) -> Any:
        """Move the lanes by one, 255 moving in."""
        count = self.width
        order = [(lane - by) % count for lane in range(count)]
        turned = self._shuffle(a, order)
        wall = [0] * count
        wall[0 if by > 0 else -1] = 255
        return self.builder.or_(turned, ir.Constant(self.bytes, wall))

    def penalties(self, table: int, axis: int, flags: int, at: int) -> tuple[Any, Any]:
        """Load P1 and P2 of an axis (0: rows, 1: columns) by the flag of a step."""
        build = self.builder
        flag = build.zext(build.load(build.gep(self.array(flags), [self.args[at]])), _I64)
        small = build.add(build.mul(flag, self.index(2 * self.width)),
                          self.index(4 * self.width * axis))
        large = build.add(small, self.index(self.width))
        return self.load(self.array(table), small), self.load(self.array(table), large)

    def advance(self, values: Any, beside: Any, penalties: tuple[Any, Any], cost: Any) -> Any:
        """Take a path one pixel on: C + min(L, L(d +- 1) + P1, P2), less the least of that."""
        small, large = penalties
        best = self.least_of(self.least_of(values, self.add(beside, small)), large)
        after = self.add(cost, best)
        return self.builder.sub(after, self.splat(self.opaque(self.least(after))))

    def resized(self, number: Any, bits: int) -> Any:
        by = bits - number.type.width
        change = self.builder.zext if by > 0 else self.builder.trunc
        return change(number, ir.IntType(bits)) if by else number

    def near(self, lane: Any) -> Any:
        """Mark the lanes that are at most 2 from one (int64)."""
        build = self.builder
        kind = ir.IntType(self.width)
        here = marks = build.shl(ir.Constant(kind, 1), self.resized(lane, self.width))
        for by in (ir.Constant(kind, 1), ir.Constant(kind, 2)):
            marks = build.or_(marks, build.or_(build.shl(here, by), build.lshr(here, by)))
        return build.bitcast(marks, ir.VectorType(_I1, self.width))

    def least_lane(self, a: Any) -> Any:
        """Return the first lane that holds the least value, as int64."""
        build, lanes = self.builder, ir.Constant(self.bytes, list(range(self.width)))
        keys = []
        for half in (0, 8):  # as x86 interleaves: within 16 bytes
            order = [at for k in range(self.width) if k & 8 == half for at in (self.width + k, k)]
            keys.append(build.bitcast(self._shuffle(a, order, lanes), self.pairs))
        return build.zext(build.trunc(self.least(self.least_of(*keys)), _I8), _I64)


@intrinsic  # noqa: E302
def match_column(typing, lanes, here, right, size, mask, outside, slope_limit, census_limit, at,
                 partner, seat, cost, to, column, begin, end, table, flags, flag_at, kept,
                 keep_at):
    """
    Compare a pixel with its partners, and take the path along its column on to it.

    The cost is min(slopes, limit) + min(census bits, limit). `right` holds PLANES planes of
    `size` bytes; `here` LEFT_PLANES of SPAN numbers, uint32 of four equal bytes. Lanes where
    `outside` is not 0, from `seat` on, cost what stands there; lanes whose `mask` is 255 become
    255. The path's values are copied to kept[keep_at].
    """
    signature = types.void(lanes, here, right, _Index, mask, outside, *[_Index] * 5, cost,
                           _Index, column, _Index, _Index, table, flags, _Index, kept, _Index)

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        v = _Vectors(context, builder, signature, args)
        fresh = _cost(v, builder, args)
        v.store(fresh, v.array(11), args[12])
        penalties = v.penalties(16, 1, 17, 18)
        values = _advance_column(v, v.array(13), args[14], args[15], penalties, fresh)
        v.store(values, v.array(19), args[20])
        return context.get_dummy_value()
    return signature, generate


def _cost(v: _Vectors, builder: Any, args: Any) -> Any:
    here = [v.word(1, builder.add(args[8], v.index(k * SPAN))) for k in range(LEFT_PLANES)]
    there = v.planes(2, v.opaque(args[3]), args[9])
    slope = v.add(*(v.difference(builder.bitcast(here[k], v.bytes), there[k]) for k in range(2)))
    bits = v.constant(0)
    for k in range(2, PLANES):
        differ = builder.xor(here[k], builder.bitcast(there[k], v.words))
        differ = differ if k < 5 else builder.and_(differ, here[k + 3])
        bits = builder.add(bits, v.call('ctpop', v.bytes, builder.bitcast(differ, v.bytes)))
    limits = [v.splat(builder.trunc(args[k], _I8)) for k in (6, 7)]
    cost = builder.add(v.least_of(slope, limits[0]), v.least_of(bits, limits[1]))
    veil = v.load(v.array(5), args[10])
    cost = builder.select(builder.icmp_unsigned('==', veil, v.constant(0)), cost, veil)
    return builder.or_(cost, v.load(v.array(4), v.index(0)))


@intrinsic
def step_both(typing, lanes, row, row_from, row_to, column, column_from, column_to, table,
              along_flags, down_flags, flag_at, cost, at, total, to, offset):
    """
    Take the path along a row and the one down its column a pixel on; both are added to `total`.

    The state of a row holds, `offset` entries behind the values, the lesser of both neighbours
    of each: so that the next step loads what one step stored.
    """
    signature = types.void(lanes, row, _Index, _Index, column, _Index, _Index, table,
                           along_flags, down_flags, _Index, cost, _Index, total, _Index, _Index)

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        v = _Vectors(context, builder, signature, args)
        fresh = v.load(v.array(11), args[12])
        along = _advance_row(v, v.array(1), args[2], args[3], args[15],
                             v.penalties(7, 0, 8, 10), fresh)
        down = _advance_column(v, v.array(4), args[5], args[6], v.penalties(7, 1, 9, 10), fresh)
        sums = v.array(13)
        v.store(v.add(v.load(sums, args[14]), v.add(along, down)), sums, args[14])
        return context.get_dummy_value()
    return signature, generate


@intrinsic
def step_column(typing, lanes, column, begin, end, table, flags, flag_at, cost, at, kept, to):
    """Take the path along a column a pixel on; its values are copied to kept[to]."""
    signature = types.void(lanes, column, _Index, _Index, table, flags, _Index, cost, _Index,
                           kept, _Index)

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        v = _Vectors(context, builder, signature, args)
        values = _advance_column(v, v.array(1), args[2], args[3], v.penalties(4, 1, 5, 6),
                                 v.load(v.array(7), args[8]))
        v.store(values, v.array(9), args[10])
        return context.get_dummy_value()
    return signature, generate


@intrinsic
def step_last(typing, lanes, row, begin, end, table, flags, flag_at, cost, at, total, back,
              sums, to, offset):
    """
    Take the last path along a row a pixel on, add it to the total, and find the winner.

    The sums go to `sums`, whose bytes beside them are looked at too. Returns, a byte each from
    the lowest bits: the winning lane, nothing, the least sum of the lanes farther than 2 from it,
    the winner's cost; then the sums of the lanes before the winner, at it, and after it.
    """
    signature = types.int64(lanes, row, _Index, _Index, table, flags, _Index, cost, _Index, total,
                            _Index, sums, _Index, _Index)

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        v = _Vectors(context, builder, signature, args)
        cost, sums = v.array(7), v.array(11)
        along = _advance_row(v, v.array(1), args[2], args[3], args[13],
                             v.penalties(4, 0, 5, 6), v.load(cost, args[8]))
        total = v.add(v.load(v.array(9), args[10]), along)
        v.store(total, sums, args[12])
        lane = v.least_lane(total)
        second = v.least(builder.select(v.near(lane), v.constant(255), total))
        before = builder.gep(sums, [builder.add(args[12], builder.sub(lane, v.index(1)))])
        four = builder.load(builder.bitcast(before, _I32.as_pointer()), align=1)
        around = builder.and_(four, ir.Constant(_I32, 0xFFFFFF))
        paid = builder.load(builder.gep(cost, [builder.add(args[8], lane)]))
        found = lane
        for part, bits in ((second, 16), (paid, 24), (around, 32)):
            found = builder.or_(found, builder.shl(v.resized(part, 64), v.index(bits)))
        return found
    return signature, generate


def _advance_row(v: _Vectors, state: Any, begin: Any, end: Any, offset: Any, penalties: Any,
                 fresh: Any) -> Any:
    add = v.builder.add
    after = v.advance(v.load(state, begin), v.load(state, add(begin, offset)), penalties, fresh)
    v.store(after, state, end)
    v.store(v.least_of(v.shifted(after, 1), v.shifted(after, -1)), state, add(end, offset))
    return after


def _advance_column(v: _Vectors, state: Any, begin: Any, end: Any, penalties: Any,
                    fresh: Any) -> Any:
    before, behind = v.builder.sub(begin, v.index(1)), v.builder.add(begin, v.index(1))
    beside = v.least_of(v.load(state, before), v.load(state, behind))
    after = v.advance(v.load(state, begin), beside, penalties, fresh)
    v.store(after, state, end)
    return after
