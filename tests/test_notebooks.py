"""The notebooks run from top to bottom, and what is committed is a clean run with pictures."""

from __future__ import annotations

import base64
import html
import importlib.util
import re
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import nbformat
import pytest
from IPython.core.formatters import DisplayFormatter
from nbclient import NotebookClient

import pcjax
from pcjax.paper.pictures import plot_figure
from pcjax.progress import progress_bar
from pcjax.results.reading import load_dataset
from tests.shown import QUICK

NOTEBOOKS = sorted((Path(__file__).parents[1] / "notebooks").glob("*.ipynb"))


def test_notebooks_are_there():
    names = ["fig12", "optimise_fingertip", "quickstart", "why_the_peak"]
    assert [path.stem for path in NOTEBOOKS] == names


@pytest.fixture
def quick_kernels(programs_for_all: None, monkeypatch: pytest.MonkeyPatch) -> None:
    """Notebooks' programs run for a moment, and are shared. They hold what users write, optax too,
    which may leave promotions to JAX."""
    monkeypatch.setenv("JAX_NUMPY_DTYPE_PROMOTION", "standard")
    for name, value in QUICK.items():
        monkeypatch.setenv(name, value)


@pytest.mark.usefixtures("quick_kernels")
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_runs_from_top_to_bottom(
    path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PCJAX_TRIALS", "50")
    monkeypatch.setenv("PCJAX_MAX_STEPS", "20000")
    notebook = nbformat.read(path, as_version=4)
    # Raises CellExecutionError, with the cell and its traceback, if a cell fails.
    NotebookClient(
        notebook,
        timeout=600,
        kernel_name="python3",
        resources={"metadata": {"path": str(tmp_path)}},
    ).execute()
    assert pictures(notebook) == pictures(nbformat.read(path, as_version=4))
    assert list(tmp_path.iterdir()) == [], "a notebook leaves no files behind"


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_committed_version_is_a_clean_run(path: Path) -> None:
    notebook = nbformat.read(path, as_version=4)
    nbformat.validate(notebook)
    code = [cell for cell in notebook.cells if cell.cell_type == "code"]
    assert [cell.execution_count for cell in code] == list(range(1, len(code) + 1))
    assert pictures(notebook) >= 4
    for cell in code:
        for output in cell.outputs:
            assert output.output_type != "error"
            assert output.get("name") != "stderr", output.text
    assert path.stat().st_size < 400_000


def pictures(notebook: nbformat.NotebookNode) -> int:
    """How many pictures the outputs hold."""
    outputs = [o for cell in notebook.cells if cell.cell_type == "code" for o in cell.outputs]
    return sum("image/png" in output.get("data", {}) for output in outputs)


@pytest.mark.usefixtures("quick_kernels")
def test_progress_is_shown_in_a_notebook_if_asked_for(tmp_path: Path) -> None:
    run = "import pcjax; pcjax.evaluate(trials=64, max_steps=20_000, progress={})"
    notebook = nbformat.v4.new_notebook(
        cells=[nbformat.v4.new_code_cell(run.format(asked)) for asked in (True, False)]
    )
    NotebookClient(notebook, timeout=300, resources={"metadata": {"path": str(tmp_path)}}).execute()
    shown, silent = (
        "".join(output.text for output in cell.outputs if output.get("name") == "stderr")
        for cell in notebook.cells
    )
    assert "trials" in shown
    assert "128" in shown
    assert "Warning" not in shown
    assert silent == ""


@pytest.mark.parametrize("there", [True, False])
def test_bars_are_widgets_where_there_are_some(
    there: bool, monkeypatch: pytest.MonkeyPatch, recwarn: pytest.WarningsRecorder
) -> None:
    shell = type("Shell", (type("ZMQInteractiveShell", (), {}),), {})()
    monkeypatch.setitem(sys.modules, "IPython", SimpleNamespace(get_ipython=lambda: shell))
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: there or None)
    made: list[Any] = []
    monkeypatch.setattr("tqdm.notebook.tqdm", lambda **said: made.append(said))
    bar = progress_bar(shown=True, total=3, desc="trials", unit="trial")
    assert bool(made) is there
    assert there or not bar.disable
    assert not recwarn.list


def test_a_result_shows_its_table_and_its_picture() -> None:
    result = pcjax.evaluate(trials=20, max_steps=20_000, direction="does")
    shown, _ = DisplayFormatter().format(result)
    assert shown["text/plain"] == repr(result)
    table, picture = re.fullmatch(
        r'<pre>(.*)</pre><img src="data:image/png;base64,([^"]+)".*/>', shown["text/html"], re.S
    ).groups()  # pyright: ignore
    assert html.unescape(table) == repr(result)
    assert base64.b64decode(picture).startswith(b"\x89PNG")


def test_a_picture_that_cannot_be_drawn_does_not_take_the_table_away(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    result = pcjax.evaluate(trials=20, max_steps=20_000, direction="does")

    def fails(_: pcjax.Evaluation) -> None:
        raise OSError("no <fonts>")

    monkeypatch.setattr("pcjax.view.plots.plot_evaluation", fails)
    told = result._repr_html_()
    assert told.startswith(f"<pre>{html.escape(repr(result))}</pre>")
    assert told.endswith("<p>no picture: OSError: no &lt;fonts&gt;</p>")


def test_a_picture_is_shown_without_set_up() -> None:
    data = load_dataset(NOTEBOOKS[0].parents[1] / "experiments" / "results" / "fig12.nc")
    shown, _ = DisplayFormatter().format(plot_figure(data))
    assert shown["image/png"].startswith(b"\x89PNG")
