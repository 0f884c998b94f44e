"""What a graph takes for a constant: computed while it is traced, once, and not written out again."""

from functools import lru_cache

import torch

from torchbrdf._constants import constant

calls = []


@constant
@lru_cache(maxsize=64)
def binomial(n, k):
    """Recursive and remembered, what a tracer would unroll."""
    calls.append((n, k))
    return 1 if k in (0, n) else binomial(n - 1, k - 1) + binomial(n - 1, k)


def test_same_values_and_the_cache_stays():
    calls.clear()
    assert [binomial(4, 2), binomial(n=4, k=2), binomial(4, 2)] == [6, 6, 6]
    assert calls.count((4, 2)) == 2  # by place and by name
    assert binomial.__doc__.startswith("Recursive")


def test_compiled_graph_holds_the_result_alone():
    graphs = []

    def keep(graph, _):
        graphs.append([node.target for node in graph.graph.nodes if node.op.startswith("call")])
        return graph.forward

    torch.compiler.reset()
    got = torch.compile(lambda x: x * binomial(6, 3), fullgraph=True, backend=keep)(torch.tensor(1.5))
    assert float(got) == 30.0
    assert len(graphs[0]) == 1
