"""What the packages may import, how long a file may be, and where an epsilon may live."""

import ast
import importlib
import inspect
import subprocess
import sys
from pathlib import Path

import pytest

import torchbrdf

ROOT = Path(__file__).parents[1]
LIBRARY = sorted((ROOT / "torchbrdf").rglob("*.py"))
PIPELINE = sorted((ROOT / "inverse").rglob("*.py"))
TESTS = sorted((ROOT / "tests").rglob("*.py"))
LONGEST = 500
# Rooms of the pipeline in the order of their imports: each may use those before it.
ROOMS = ("shapes", "scene", "transport", "files", "fitting", "planning")
SMALLEST_UNNAMED = 1e-5
TOLERANCE_ARGUMENTS = {"rtol", "atol", "xtol", "ftol", "gtol", "tol"}
# Folder of tests for each package whose folders it mirrors.
MIRRORS = {"torchbrdf": "library", "inverse": "pipeline"}


def named(path: Path) -> str:
    return str(path.relative_to(ROOT))


def imports(path: Path) -> list[tuple[str, list[str]]]:
    """(module, names) of every import in a file; `import a.b` has no names."""
    found = []
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found += [(alias.name, []) for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            found.append(("." * node.level + (node.module or ""), [alias.name for alias in node.names]))
    return found


def tiny_literals(source: str) -> list[tuple[int, float]]:
    """(line, value) of small floats inside expressions of functions.

    A constant with a name is fine: at module or class level, a default, a tolerance argument.
    """
    found = []

    def visit(node: ast.AST, inside: bool) -> None:
        if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef, ast.Lambda)):
            body = node.body if isinstance(node.body, list) else [node.body]
            for child in body:
                visit(child, True)
            return
        if isinstance(node, ast.keyword) and node.arg in TOLERANCE_ARGUMENTS:
            return
        if inside and isinstance(node, ast.Constant) and isinstance(node.value, float):
            if 0 < node.value <= SMALLEST_UNNAMED:
                found.append((node.lineno, node.value))
            return
        for child in ast.iter_child_nodes(node):
            visit(child, inside)

    visit(ast.parse(source), False)
    return found


def uses(path: Path) -> set[str]:
    """Attributes read from the name `torchbrdf` in a file: `torchbrdf.X`."""
    return {
        node.attr
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == "torchbrdf"
    }


def test_there_is_something_to_check():
    assert len(LIBRARY) > 5


@pytest.mark.parametrize("path", LIBRARY, ids=named)
def test_library_imports_neither_pipeline_nor_tests(path):
    for module, _ in imports(path):
        assert module.split(".")[0] not in {"inverse", "tests", "helpers", "conftest"}


@pytest.mark.parametrize("path", LIBRARY, ids=named)
def test_library_needs_torch_and_numpy_alone(path):
    for module, _ in imports(path):
        top = module.split(".")[0]
        assert top in {"torchbrdf", "torch", "numpy"} or top in sys.stdlib_module_names


@pytest.mark.parametrize("path", PIPELINE, ids=named)
def test_pipeline_imports_public_names_only(path):
    public = set(torchbrdf.__all__)
    for module, names in imports(path):
        if module.split(".")[0] != "torchbrdf":
            continue
        assert module == "torchbrdf", f"{module} is not the public package"
        assert set(names) <= public
    assert uses(path) <= public


@pytest.mark.parametrize("path", [p for p in PIPELINE if p.parent.name in ROOMS], ids=named)
def test_rooms_import_to_the_left_and_through_doors(path):
    room = path.parent.name
    for module, _ in imports(path):
        if module.split(".")[0] != "inverse" or module.startswith(f"inverse.{room}."):
            continue
        _, other, *inside = module.split(".")
        assert not inside, f"{module}: what other rooms may use is in the room's __init__"
        assert ROOMS.index(other) < ROOMS.index(room)
        assert not {other, room} >= {"files", "transport"}


@pytest.mark.parametrize("package", sorted({p.parent for p in LIBRARY + PIPELINE}), ids=named)
def test_no_module_is_hidden_by_a_public_name(package):
    """`import package.name` must give the module, so that nothing the package exports may bear its name."""
    modules = {p.stem if p.is_file() else p.name for p in package.iterdir() if p.suffix == ".py" or p.is_dir()}
    door = importlib.import_module(".".join(package.relative_to(ROOT).parts))
    exported = {name for name in vars(door) if not inspect.ismodule(getattr(door, name))}
    assert not modules & exported


# Each takes as long to import as what imports it, and most programs never use it.
DEFERRED = ("torch._dynamo", "torch._inductor", "sympy", "scipy", "kornia", "skimage", "matplotlib", "llvmlite")


def test_heavy_packages_are_imported_where_they_are_used():
    """Time is not measured: the machine's mood would be."""
    report = "import sys, torch; before = {*sys.modules}; import inverse; print(*({*sys.modules} - before))"
    imported = subprocess.run([sys.executable, "-c", report], cwd=ROOT, capture_output=True, text=True, check=True)
    modules = set(imported.stdout.split())
    assert "torchbrdf" in modules
    assert not modules & set(DEFERRED)


def test_few_files_lie_at_the_top_of_the_pipeline():
    assert len([p for p in (ROOT / "inverse").glob("*.py") if not p.name.startswith("__")]) <= 5


@pytest.mark.parametrize("path", LIBRARY + PIPELINE, ids=named)
def test_modules_have_a_test_file_of_their_name(path):
    """Doors (`__init__`, `__main__`) have none: what they export is tested where it is defined."""
    package, *folders, name = path.relative_to(ROOT).with_suffix("").parts
    if name.startswith("__"):
        return
    test = ROOT.joinpath("tests", MIRRORS[package], *folders, f"test_{name.removeprefix('_')}.py")
    assert test.is_file(), f"{named(test)} is missing"
    assert "def test_" in test.read_text(), f"{named(test)} tests nothing"


@pytest.mark.parametrize("path", LIBRARY + PIPELINE + TESTS, ids=named)
def test_files_are_short(path):
    assert len(path.read_text().splitlines()) < LONGEST


@pytest.mark.parametrize("path", [p for p in LIBRARY + PIPELINE if p.name != "_numerics.py"], ids=named)
def test_epsilons_have_names_or_live_in_numerics(path):
    assert tiny_literals(path.read_text()) == []


def test_public_names_exist_once_and_sorted():
    assert torchbrdf.__all__ == sorted(set(torchbrdf.__all__))
    assert all(hasattr(torchbrdf, name) for name in torchbrdf.__all__)


def test_tiny_literals_finds_what_it_should():
    assert tiny_literals("def f(x):\n    return x / (x + 1e-8)") == [(2, 1e-8)]
    assert tiny_literals("g = lambda x: x.clamp(min=1e-12)") == [(1, 1e-12)]
    assert tiny_literals("class A:\n    def f(self, x):\n        eps = 1e-7\n        return x + eps") == [(3, 1e-7)]
    assert tiny_literals("EPS = 1e-8\ndef f(x, rtol=1e-9):\n    return g(x, atol=1e-10) + 0.33") == []
