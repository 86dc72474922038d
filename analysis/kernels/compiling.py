"""From the plain function of a kernel to object code, by Numba.

What is compiled is a loop over rows, as NumPy calls it: with the addresses of the first row of every argument and result, and
their strides. Compilers also compute what is not chosen then; the loop forgets what the processor noted of that.
"""

from __future__ import annotations

from types import FunctionType
from typing import Any

import llvmlite.binding as llvm
import llvmlite.ir as ir
import numba
import numba.np.arrayobj
import numpy as np
from numba import types
from numba.core import cgutils
from numba.core.errors import NumbaTypeError
from numba.extending import intrinsic

from analysis.kernels.kernel import Kernel, Part, scratch
from analysis.kernels.machine_code import ENTRY

_MOST_ROOM = 4096  # numbers, which any thread's stack has
_HOW: dict[str, Any] = {"error_model": "numpy", "no_cpython_wrapper": True, "no_cfunc_wrapper": True}

# Compiled functions of Numba's are called with room for a result and for an error; here there is neither.
_LOOP = """
declare i32 @"{native}"(ptr, ptr, ptr, ptr, ptr, ptr)
define void @{entry}(ptr %arguments, ptr %sizes, ptr %strides, ptr %unused) {{
  %result = alloca ptr
  %error = alloca ptr
  %status = call i32 @"{native}"(ptr %result, ptr %error, ptr %arguments, ptr %sizes, ptr %strides, ptr %unused)
  ret void
}}
"""


def object_code(kernel: Kernel, sizes: tuple[int, ...]) -> bytes:
    """The code of a kernel, compiled for these sizes."""
    loop = _loop(kernel, sizes)
    address = types.CPointer(types.intp)
    compiled = numba.njit(types.void(address, address, address, types.voidptr), **_HOW)(loop)
    (made,) = compiled.overloads.values()
    target = made.library.codegen._tm
    module = llvm.parse_assembly(str(made.library._final_module))
    module.link_in(llvm.parse_assembly(_LOOP.format(native=made.fndesc.llvm_func_name, entry=ENTRY)))
    _hide_all_but_the_entry(module)
    passes = llvm.create_pass_builder(target, llvm.create_pipeline_tuning_options(speed_level=2))
    passes.getModulePassManager().run(module, passes)
    code: bytes = target.emit_object(module)
    return code


def _hide_all_but_the_entry(module: Any) -> None:
    """What is inlined is left out then, and with it what it would need of Numba where it runs."""
    for function in module.functions:
        if not function.is_declaration and function.name != ENTRY:
            function.linkage = "internal"
    for variable in module.global_variables:
        if not variable.is_declaration:
            variable.linkage = "internal"


def _loop(kernel: Kernel, sizes: tuple[int, ...]) -> Any:
    constants = dict(zip(kernel.sizes, sizes, strict=True))
    order = list(dict.fromkeys(name for core in kernel.cores for name in core))
    rows = []
    for place, (letter, core) in enumerate(zip(kernel.types, kernel.cores, strict=True)):
        shape = "".join(f"{constants.get(name, f'sizes[{order.index(name) + 1}]')}, " for name in core)
        row = f"array(pointer(arguments[{place}] + row * strides[{place}]), ({shape or '1, '}), {_KINDS[letter]})"
        rows.append(f"{row}[0]" if place < kernel.arguments and not core else row)
    text = f"""
def loop(arguments, sizes, strides, unused):
    for row in range(sizes[0]):
        plain({", ".join(rows)})
    forget()
"""
    known: dict[str, Any] = {
        "plain": numba.njit(**_HOW)(_bound(kernel.plain(*sizes))),
        "array": numba.carray,
        "pointer": _pointer,
        "forget": _forget,
        "np": np,
    }
    exec(text, known)
    return known["loop"]


_KINDS = {"d": "np.float64", "?": "np.bool_", "l": "np.int64", "L": "np.uint64", "B": "np.uint8"}


def _bound(plain: Any) -> FunctionType:
    """A function with the parts that it calls compiled."""
    known = plain.__globals__
    parts = {name: _part(known[name]) for name in plain.__code__.co_names if isinstance(known.get(name), Part)}
    bound = FunctionType(plain.__code__, {**known, **parts}, plain.__name__, plain.__defaults__, plain.__closure__)
    bound.__qualname__, bound.__module__ = plain.__qualname__, plain.__module__
    return bound


def _part(part: Part) -> Any:
    return _room if part is scratch else numba.njit(**_HOW)(_bound(part.plain))


@intrinsic  # type: ignore[untyped-decorator]
def _pointer(_: Any, address: Any) -> Any:
    def generate(context: Any, builder: Any, _: Any, given: Any) -> Any:
        return builder.inttoptr(given[0], context.get_value_type(types.voidptr))

    return types.voidptr(address), generate


@intrinsic  # type: ignore[untyped-decorator]
def _forget(_: Any) -> Any:
    def generate(context: Any, builder: Any, *_: Any) -> Any:
        word = ir.IntType(32)
        forget = cgutils.get_or_insert_function(builder.module, ir.FunctionType(word, [word]), "feclearexcept")
        builder.call(forget, [ir.Constant(word, -1)])
        return context.get_dummy_value()

    return types.void(), generate


@intrinsic(prefer_literal=True)  # type: ignore[untyped-decorator]
def _room(_: Any, rows: Any, columns: Any) -> Any:
    """On the stack of the kernel: memory of its own would take as long as the work of a small one."""
    if not (isinstance(rows, types.IntegerLiteral) and isinstance(columns, types.IntegerLiteral)):
        raise NumbaTypeError("scratch takes sizes that are constants of the kernel: axes in capitals, or numbers")
    shape = rows.literal_value, columns.literal_value
    if shape[0] * shape[1] > _MOST_ROOM:
        raise NumbaTypeError(f"scratch has room for {_MOST_ROOM} numbers, and not for {shape[0]} x {shape[1]}")
    array = types.Array(types.float64, 2, "C")

    def generate(context: Any, builder: Any, *_: Any) -> Any:
        constants = [context.get_constant(types.intp, size) for size in shape]
        width = context.get_constant(types.intp, 8)
        room = context.make_array(array)(context, builder)
        numba.np.arrayobj.populate_array(
            room,
            data=cgutils.alloca_once(builder, context.get_value_type(types.float64), size=max(1, shape[0] * shape[1])),
            shape=constants,
            strides=[builder.mul(constants[1], width), width],
            itemsize=width,
            meminfo=None,
        )
        return room._getvalue()

    return array(rows, columns), generate
