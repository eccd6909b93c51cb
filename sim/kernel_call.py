"""Calling a term's compiled kernel by its address, with its own part of the states and parameters.

A typed list of functions and slices of arrays cost three times what the kernels themselves do: the list is asked for
each, and every slice is counted in and out, by threads that share a pipeline even against each other. Here a kernel is
a number, and a part of a vector is a view that nobody counts: it must not outlive the call, and no kernel keeps it.
"""

from typing import Any

import numpy as np
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic
from numba.np import arrayobj
from numpy.typing import NDArray

from sim.terms.contract import KERNEL, Kernel

_vector = types.Array(types.float64, 1, "C")
_index = types.int64
_SIGNATURE = types.void(
    _index, *KERNEL.args[:2], _vector, _index, _index, _vector, _index, _index, types.float64
)  # fmt: skip

ADDRESSES = types.Array(types.int64, 1, "C")  # of the kernels, in their order


def addresses(kernels: "list[Kernel]") -> NDArray[np.int64]:
    """(N,) where the kernels' machine code lies; good as long as the kernels themselves are kept."""
    compiled = [kernel.get_compile_result(KERNEL) for kernel in kernels]  # type: ignore[attr-defined]
    found = [c.library.get_pointer_to_function(c.fndesc.llvm_func_name) for c in compiled]
    return np.array(found, dtype=np.int64)


@intrinsic
def call(
    typing: Any, address: Any, s: Any, v: Any, x: Any, x_first: Any, x_end: Any, p: Any, p_first: Any, p_end: Any,
    dt: Any,
) -> Any:  # fmt: skip
    """The kernel at `address` with s, v, x[x_first:x_end], p[p_first:p_end] and dt; what it raises is raised."""

    def code(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        place, signals, geometry, states, first, end, numbers, number_first, number_end, step = given

        def part(whole: Any, start: Any, stop: Any) -> Any:
            whole = arrayobj.make_array(_vector)(context, builder, whole)
            view = arrayobj.make_array(_vector)(context, builder)
            arrayobj.populate_array(
                view, data=builder.gep(whole.data, [start]),
                shape=cgutils.pack_array(builder, [builder.sub(stop, start)]), strides=whole.strides,
                itemsize=whole.itemsize, meminfo=None,
            )  # fmt: skip
            return view._getvalue()

        convention = context.call_conv
        function = convention.get_function_type(types.void, KERNEL.args)
        status, _ = convention.call_function(
            builder, builder.inttoptr(place, function.as_pointer()), types.void, KERNEL.args,
            [signals, geometry, part(states, first, end), part(numbers, number_first, number_end), step],
        )  # fmt: skip
        with cgutils.if_unlikely(builder, status.is_error):
            convention.return_status_propagate(builder, status)
        return context.get_dummy_value()

    return _SIGNATURE, code
