"""Results as notebooks show them: their table and their picture."""

from __future__ import annotations

import base64
import html
from typing import Any, ClassVar

from pcjax.importing import named


class Shown:
    """What a notebook shows as its table, which is how it prints, with its picture below.

    The picture is drawn by a function of a layer above, which is why it is known by its name alone
    and imported when it is asked for.
    """

    drawn_by: ClassVar[str]
    """The function, as "view.plots.plot_evaluation"."""

    def _repr_html_(self) -> str:
        table = f"<pre>{html.escape(repr(self))}</pre>"
        try:
            picture = f'<img src="data:image/png;base64,{self._png()}" style="max-width: 100%"/>'
        except Exception as error:
            # The table is still worth seeing, and what failed is said below it.
            picture = f"<p>no picture: {html.escape(f'{type(error).__name__}: {error}')}</p>"
        return table + picture

    def _png(self) -> str:
        figure: Any = named(self.drawn_by)(self)
        return base64.b64encode(figure._repr_png_()).decode("ascii")
