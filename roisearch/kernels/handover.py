"""Handing a kernel many arrays and numbers as one argument.

numba unpacks every array at every call from Python: forty of them cost five times what a record costs when they are
arguments, and seventeen times when they are the fields of a named tuple (1.4 and 5.2 microseconds against 0.3). That
would be a tenth of a decision by the paper's settings, which takes about fifty. So what is fixed is packed once, into a
record whose address is handed over:

    LAYOUT = Layout(legal=(np.uint8, 1), depth=np.int64)
    opened = LAYOUT.opener()

    parcel = LAYOUT.pack(legal=legal, depth=64)
    kernel(parcel.address)           # in it: given = opened(address); array(given.legal); given.depth

An array is in the record as its address and its shape, and `array` makes it again, where it lies, without a copy. For
that it uses numba's own way to make an array, which numba does not promise to keep: pyproject.toml bounds numba.

Where a call takes milliseconds, as those of `roisearch.planners.lookahead`, named tuples are plainer and cost nothing.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numba
import numpy as np
from numba.core import types
from numba.extending import intrinsic
from numba.np import arrayobj
from numpy.typing import DTypeLike, NDArray

_numba: Any = arrayobj
_intrinsic: Any = intrinsic


class Parcel:
    """What was packed; it must be kept as long as its address is used. A copy of it is packed anew.

    Attributes:
        address: of the record.
    """

    def __init__(self, layout: Layout, things: dict[str, Any]) -> None:
        self._layout, self._things = layout, things
        self._record = layout.record_of(things)
        self.address: int = self._record.ctypes.data

    def __reduce__(self) -> tuple[type[Parcel], tuple[Layout, dict[str, Any]]]:
        return Parcel, (self._layout, self._things)


class Layout:
    """The names and types of what is handed over.

    Args:
        kinds: the type of a number; or of an array the type and how many dimensions.
    """

    def __init__(self, **kinds: DTypeLike | tuple[DTypeLike, int]) -> None:
        self._arrays = {name: kind for name, kind in kinds.items() if isinstance(kind, tuple)}
        fields = [(name, _field(kind)) for name, kind in kinds.items()]
        self.dtype: np.dtype[Any] = np.dtype(fields, align=True)

    def pack(self, **things: Any) -> Parcel:
        """Pack an array or a number for every name; raises ValueError like `record_of`."""
        return Parcel(self, things)

    def record_of(self, things: dict[str, Any]) -> NDArray[Any]:
        """The record, structured [1], in which an array is its address and its shape.

        Raises:
            ValueError: when a name is missing or unknown, or an array is not of its type, of its number of
                dimensions and C-contiguous.
        """
        assert self.dtype.names is not None
        if set(things) != set(self.dtype.names):
            raise ValueError(f"missing or unknown: {sorted(set(things) ^ set(self.dtype.names))}")
        record = np.zeros(1, self.dtype)
        for name, thing in things.items():
            if name not in self._arrays:
                record[name] = thing
                continue
            dtype, dimensions = self._arrays[name]
            if thing.dtype != dtype or thing.ndim != dimensions or not thing.flags.c_contiguous:
                raise ValueError(
                    f"{name} must be {np.dtype(dtype)}, C-contiguous and of {dimensions} dimensions, "
                    f"not {thing.dtype} of shape {thing.shape}"
                )
            record[name] = (thing.ctypes.data, *thing.shape)
        return record

    def opener(self) -> Callable[[int], Any]:
        """A function, in kernels only, from the address of a parcel to its record."""

        def opened(context: Any, address: Any) -> Any:
            kind = numba.from_dtype(self.dtype)

            def generate(target: Any, builder: Any, signature: Any, arguments: Any) -> Any:
                return builder.inttoptr(arguments[0], target.get_value_type(kind))

            return kind(types.intp), generate

        made: Callable[[int], Any] = _intrinsic(opened)
        return made


def _field(kind: Any) -> np.dtype[Any]:
    """How an array or a number is kept in the record."""
    return _reference(*kind) if isinstance(kind, tuple) else np.dtype(kind)


def _reference(dtype: DTypeLike, dimensions: int) -> np.dtype[Any]:
    """How an array is kept in the record: its address, in a field named after its type, and its shape."""
    return np.dtype([(np.dtype(dtype).name, np.intp), *((f"size{i}", np.intp) for i in range(dimensions))])


def _array(context: Any, reference: Any) -> Any:
    """The array that a field of a record refers to; in kernels only."""
    names = list(reference.fields)
    kind = types.Array(numba.from_dtype(np.dtype(names[0])), len(names) - 1, "C")

    def generate(target: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        words = builder.bitcast(arguments[0], target.get_value_type(types.intp).as_pointer())
        address, *shape = [
            builder.load(builder.gep(words, [target.get_constant(types.intp, i)])) for i in range(len(names))
        ]
        element = target.get_data_type(kind.dtype)
        size = target.get_constant(types.intp, target.get_abi_sizeof(element))
        strides = [size]
        for length in reversed(shape[1:]):
            strides.insert(0, builder.mul(strides[0], length))
        made = _numba.make_array(kind)(target, builder)
        data = builder.inttoptr(address, element.as_pointer())
        _numba.populate_array(made, data=data, shape=shape, strides=strides, itemsize=size, meminfo=None)
        return made._getvalue()

    return kind(reference), generate


array: Callable[[Any], Any] = _intrinsic(_array)
