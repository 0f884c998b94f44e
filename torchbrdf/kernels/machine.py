"""LLVM's text to machine code, by llvmlite: the one place that imports it, and only once a kernel is wanted."""

import ctypes
import importlib
import importlib.util
from collections.abc import Callable, Sequence
from functools import cache
from typing import Any, NamedTuple


class Compiled(NamedTuple):
    """A function of the processor.

    Attributes:
        call: with the addresses of its arrays and the number of pixels; without Python's lock, so that threads do not
            wait for each other.
        assembly: what it was compiled to.
        engine: owner of the code.
    """

    call: Callable[..., int]
    assembly: str
    engine: Any


def is_installed() -> bool:
    """Whether the compiler is."""
    return importlib.util.find_spec("llvmlite") is not None


@cache
def _target() -> tuple[Any, Any]:
    llvm = importlib.import_module("llvmlite.binding")
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    target = llvm.Target.from_default_triple()
    features = llvm.get_host_cpu_features().flatten()
    return llvm, target.create_target_machine(cpu=llvm.get_host_cpu_name(), features=features, opt=3, jit=True)


def compiled(text: str, arrays: int) -> Compiled:
    """The function `evaluate` of arrays and a number of pixels that a text defines."""
    llvm, machine = _target()
    module = llvm.parse_assembly(text)
    module.triple, module.data_layout = machine.triple, str(machine.target_data)
    options = llvm.create_pipeline_tuning_options(speed_level=3)
    options.loop_vectorization = options.slp_vectorization = True
    passes = llvm.create_pass_builder(machine, options)
    passes.getModulePassManager().run(module, passes)
    assembly = machine.emit_assembly(module)
    engine = llvm.create_mcjit_compiler(module, _target.__wrapped__()[1])
    engine.finalize_object()
    kind = ctypes.CFUNCTYPE(ctypes.c_int32, *(ctypes.c_void_p,) * arrays, ctypes.c_int64)
    return Compiled(kind(engine.get_function_address("evaluate")), assembly, engine)
