"""Progress bars: on a terminal, and in a notebook as a widget where there are widgets."""

from __future__ import annotations

import importlib.util
import sys
from typing import Any

from tqdm.std import tqdm


def progress_bar(*, shown: bool, total: int, desc: str, unit: str, **options: Any) -> Any:
    """A bar, to be closed or used in a `with`.

    Arguments:
        shown: whether it is asked for. It is then shown on stderr where that is a terminal, and in
            notebooks.
        total: of what is to be done.
        desc, unit: what is done, and one of it.
        options: others of tqdm's.
    """
    kind: Any = tqdm
    hidden = None if shown else True  # None: where stderr is no terminal
    if shown and _in_a_notebook():
        hidden = False
        # Not tqdm.auto: it asks for widgets wherever IPython is, and warns where there are none.
        if importlib.util.find_spec("ipywidgets"):
            from tqdm.notebook import tqdm as kind
    return kind(total=total, desc=desc, unit=unit, leave=False, disable=hidden, **options)


def _in_a_notebook() -> bool:
    """Whether this process is the kernel of a notebook."""
    ipython = sys.modules.get("IPython")
    shell = ipython.get_ipython() if ipython else None
    # By name, as ipykernel need not be there; services on the net have shells of their own.
    return any(kind.__name__ == "ZMQInteractiveShell" for kind in type(shell).__mro__)
