"""Machine code for models of a few fields, made from their formula: a tenth to a thirtieth of the time of torch's.

`native` switches it. A model is recorded at one pixel (`pixel`, by `recording`) as a `program`, which `lowering` makes
a loop of; `machine` compiles it, `kernel` runs it over arrays, `operator` makes an operator of torch of it.
"""

from torchbrdf.kernels.choice import by_kernel, native

__all__ = ["by_kernel", "native"]
