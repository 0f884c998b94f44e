"""LLVM's text to machine code, by llvmlite: the one place that imports it, and only once a kernel is wanted."""

import ctypes
import importlib
from collections.abc import Callable
from functools import cache
from typing import Any

_OLDEST_LLVM = (20, 0, 0)  # of llvmlite 0.45


Loop = Callable[..., int]


@cache
def is_installed() -> bool:
    """Whether a compiler is that reads what `lowering` writes."""
    try:
        llvm = importlib.import_module("llvmlite.binding")
    except ImportError:
        return False
    return tuple(llvm.llvm_version_info) >= _OLDEST_LLVM


def compiled(text: str, arrays: int) -> Loop:
    """The function `evaluate` that a text defines: of the addresses of its arrays and the number of pixels.

    It runs without Python's lock, so that threads do not wait for each other.
    """
    llvm = importlib.import_module("llvmlite.binding")
    engine = llvm.create_mcjit_compiler(_optimised(text), _processor())
    engine.finalize_object()
    kind = ctypes.CFUNCTYPE(ctypes.c_int32, *(ctypes.c_void_p,) * arrays, ctypes.c_int64)
    loop = kind(engine.get_function_address("evaluate"))
    loop.engine = engine  # owns the code and must outlive it  # pyright: ignore[reportAttributeAccessIssue]
    return loop


def assembly_of(text: str) -> str:
    """What a text is compiled to, to be read."""
    return _processor().emit_assembly(_optimised(text))


def _optimised(text: str) -> Any:
    llvm, processor = importlib.import_module("llvmlite.binding"), _processor()
    module = llvm.parse_assembly(text)
    module.triple, module.data_layout = processor.triple, str(processor.target_data)
    options = llvm.create_pipeline_tuning_options(speed_level=3)
    options.loop_vectorization = True
    passes = llvm.create_pass_builder(processor, options)
    passes.getModulePassManager().run(module, passes)
    return module


def _processor() -> Any:
    """The processor this runs on, with all its instructions; a new one each time, since an engine keeps it."""
    llvm = importlib.import_module("llvmlite.binding")
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    features = llvm.get_host_cpu_features().flatten()
    target = llvm.Target.from_default_triple()
    return target.create_target_machine(cpu=llvm.get_host_cpu_name(), features=features, opt=3, jit=True)
