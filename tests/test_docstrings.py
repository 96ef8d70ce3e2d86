"""Every example in a docstring runs, and prints what it says."""

from __future__ import annotations

import doctest
import importlib
import inspect
import pkgutil
from pathlib import Path

import pytest

import pcjax

EXAMPLES = [
    test
    for found in pkgutil.walk_packages(pcjax.__path__, "pcjax.")
    if not found.name.endswith("__main__")
    for test in doctest.DocTestFinder(exclude_empty=True).find(
        importlib.import_module(found.name), found.name
    )
    if test.examples
]

WITH_EXAMPLES = (
    "Circle",
    "ContactLaw",
    "Differences",
    "Estimate",
    "Evaluation",
    "HandDesign",
    "PlanarArm",
    "Scenario",
    "Stick",
    "Surrogate",
    "Task",
    "WristTilt",
    "box_hand",
    "design_space",
    "differentiable_score",
    "does",
    "eoen",
    "evaluate",
    "load_study",
    "optimize",
    "step",
    "trajectory",
    "two_joint_hand",
)


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda example: example.name)
def test_example(example: doctest.DocTest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)  # some examples write files
    runner = doctest.DocTestRunner(verbose=False)
    report: list[str] = []
    runner.run(example, out=report.append)
    assert runner.failures == 0, "".join(report)


@pytest.mark.parametrize("name", WITH_EXAMPLES)
def test_has_an_example(name: str) -> None:
    assert ">>>" in (inspect.getdoc(getattr(pcjax, name)) or "")


@pytest.mark.parametrize("name", pcjax.__all__)
def test_has_a_docstring(name: str) -> None:
    """One of its own: a dataclass without gets its signature."""
    text = inspect.getdoc(getattr(pcjax, name)) or ""
    assert len(text) > 20
    assert not text.startswith(f"{name}(")
