"""Machine code as universal functions of NumPy: LLVM links the code, and NumPy loops over it and broadcasts."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from functools import cache
from typing import Any

import llvmlite.binding as llvm
import numpy as np

from analysis.kernels.kernel import Kernel

ENTRY = "kernel"  # name of the function in the code of each kernel

_OF_LOOPS_AND_A_SIGNATURE = 31  # PyUFunc_FromFuncAndDataAndSignature, in the table of NumPy's C interface
_NO_IDENTITY = -1


def loaded(kernel: Kernel, code: bytes) -> Callable[..., Any]:
    """The universal function of a kernel, from its object code."""
    linker = llvm.create_mcjit_compiler(llvm.parse_assembly(""), _target())
    linker.add_object_file(llvm.ObjectFileRef.from_data(code))
    linker.finalize_object()
    loops = (ctypes.c_void_p * 1)(linker.get_function_address(ENTRY))
    nothing = (ctypes.c_void_p * 1)(None)
    kinds = ctypes.create_string_buffer(bytes(np.dtype(letter).num for letter in kernel.types))
    name, layout = kernel.name.encode(), kernel.layout.replace(" ", "").encode()
    results = len(kernel.types) - kernel.arguments
    _keep_for_ever((linker, _target(), loops, nothing, kinds, name, layout))  # NumPy keeps no reference to any of them
    made: Callable[..., Any] = _maker()(
        loops, nothing, kinds, 1, kernel.arguments, results, _NO_IDENTITY, name, None, 0, layout
    )
    return made


def _keep_for_ever(held: object) -> None:
    # A list of this module would not do: modules may go (pytester takes those away that a test has imported) before the
    # functions that were made by them, and these would run into memory that is no longer theirs.
    ctypes.pythonapi.Py_IncRef(ctypes.py_object(held))


@cache
def _target() -> Any:
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    return llvm.Target.from_default_triple().create_target_machine()


@cache
def _maker() -> Callable[..., Any]:
    import numpy._core._multiarray_umath as umath  # where NumPy's C interface is told, to whoever compiles against it

    table_of = ctypes.pythonapi.PyCapsule_GetPointer
    table_of.restype, table_of.argtypes = ctypes.c_void_p, [ctypes.py_object, ctypes.c_char_p]
    table = ctypes.cast(table_of(umath._UFUNC_API, None), ctypes.POINTER(ctypes.c_void_p))
    pointer, text, number = ctypes.c_void_p, ctypes.c_char_p, ctypes.c_int
    arguments = (pointer, pointer, pointer, number, number, number, number, text, text, number, text)
    address = table[_OF_LOOPS_AND_A_SIGNATURE]
    assert address is not None
    return ctypes.PYFUNCTYPE(ctypes.py_object, *arguments)(address)
