"""The architecture: imports go down only, without cycles, and importing configures nothing."""

from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Container
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

import pcjax

PACKAGE = Path(pcjax.__file__).parent

LAYERS = (
    ("__init__", "__main__", "cli"),
    ("paper",),
    ("view",),
    ("sweep",),
    ("spatial",),
    ("study",),
    ("design",),
    ("results",),
    ("quality",),
    ("simulate",),
    ("physics",),
    ("model",),
    (
        "geometry",
        "components",
        "checks",
        "units",
        "words",
        "progress",
        "compiling",
        "importing",
        "showing",
    ),
)
"""Top to bottom: the modules and folders directly under pcjax/. A module may import from its own
layer and from those below. A new one fails the tests until it has its place here."""

RANK = {name: rank for rank, layer in enumerate(LAYERS) for name in layer}


def module_name(path: Path, package: Path = PACKAGE) -> str:
    """`pcjax/model/hand.py` -> "pcjax.model.hand"; a package is its folder's name."""
    parts = path.relative_to(package.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


MODULES = {module_name(path): path for path in sorted(PACKAGE.rglob("*.py"))}


def place(module: str) -> str:
    """The name in the table that a module stands under."""
    parts = module.split(".")
    return parts[1] if len(parts) > 1 else "__init__"


def internal_imports(
    source: str, module: str, known: Container[str], *, is_package: bool = False
) -> set[str]:
    """The modules of the package that a source text imports, inside functions as well.

    `from pcjax.model import hand` counts as `pcjax.model.hand` if there is such a module, and as
    `pcjax.model` if `hand` is a name defined there.
    """
    found = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ""
            if node.level:
                parts = module.split(".")
                up = node.level - is_package
                base = ".".join(parts[: len(parts) - up] + ([base] if base else []))
            for alias in node.names:
                inner = f"{base}.{alias.name}"
                found.add(inner if inner in known else base)
    top = module.split(".")[0]
    return {name for name in found if name.split(".")[0] == top}


def imports_of(module: str) -> set[str]:
    path = MODULES[module]
    return internal_imports(
        path.read_text(encoding="utf-8"), module, MODULES, is_package=path.name == "__init__.py"
    )


def test_the_reader_of_imports_sees_every_kind():
    known = {"pcjax", "pcjax.cli", "pcjax.paper", "pcjax.model", "pcjax.model.hand"}
    source = """
import math
import pcjax.cli as command_line
from pcjax import paper, evaluate
def late():
    from pcjax.geometry import Vec
    class Inner:
        from . import hand
        from ..physics import step
"""
    assert internal_imports(source, "pcjax.model.scenario", known) == {
        "pcjax.cli",
        "pcjax.paper",
        "pcjax",
        "pcjax.geometry",
        "pcjax.model.hand",
        "pcjax.physics",
    }
    # In a package's own file one dot is the package itself.
    assert internal_imports(
        "from .hand import HandDesign", "pcjax.model", known, is_package=True
    ) == {"pcjax.model.hand"}


def test_the_package_was_found():
    assert {"pcjax", "pcjax.cli", "pcjax.model.hand", "pcjax.geometry"} <= set(MODULES)
    assert len(RANK) == sum(len(layer) for layer in LAYERS), "a name stands in two layers"


@pytest.mark.parametrize("module", MODULES)
def test_every_module_has_a_layer(module: str):
    assert place(module) in RANK, f"{module} has no place in LAYERS"


@pytest.mark.parametrize("module", MODULES)
def test_imports_go_down_only(module: str):
    for imported in imports_of(module):
        # A name that is not a module here would slip through the table.
        assert imported in MODULES, f"{module} imports {imported}, which is not a module"
        assert RANK[place(imported)] >= RANK[place(module)], (
            f"{module} imports {imported} from a layer above its own"
        )


def test_no_import_cycles():
    graph = {module: imports_of(module) - {module} for module in MODULES}
    try:
        tuple(TopologicalSorter(graph).static_order())
    except CycleError as error:
        pytest.fail("import cycle: " + " -> ".join(error.args[1]))


def test_importing_leaves_the_configuration_of_jax_alone():
    # Every module, the command line's too: only running a command may configure the process.
    modules = [module for module in MODULES if not module.endswith("__main__")]
    code = f"""
import importlib, jax
before = dict(jax.config.values)
import pcjax
for module in {modules!r}:
    importlib.import_module(module)
after = dict(jax.config.values)
changed = [name for name in before.keys() | after.keys() if before.get(name) != after.get(name)]
assert before, "jax lists no configuration"
assert not changed, f"importing pcjax changes {{changed}}"
"""
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=120, check=False
    )
    assert done.returncode == 0, done.stderr
