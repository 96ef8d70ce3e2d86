"""Maps as tables of numbers between commas, one line for each hand."""

from __future__ import annotations

import io
import math
from pathlib import Path

import numpy as np
import pandas as pd

from pcjax.importing import xr
from pcjax.results.checking import check_variables
from pcjax.results.files import read_plain
from pcjax.results.netcdf import message_of
from pcjax.results.schema import dataset_of, place_of

_COLUMNS = ("score", "se", "gap", "full_cage", "possible")


def map_as_csv(data: xr.Dataset) -> str:
    """A map's hands, the second parameter slowest; the finer grid and attributes are left out."""
    score = data.score.isel(index=0, drop=True)
    statistics = {
        name: score.sel(statistic=of, drop=True) for name, of in (("score", "value"), ("se", "se"))
    }
    rest = {name: data[name] for name in _COLUMNS[2:]}
    table = xr.Dataset(statistics | rest).to_dataframe(dim_order=list(place_of(data)))
    return table[list(_COLUMNS)].to_csv()


def load_map_csv(path: Path) -> xr.Dataset:
    """Reads what `map_as_csv` gives: a map that does not say how it was made, nor has intervals.

    Raises:
        ValueError: there is none, or it is no such table; in one line.
    """
    kept = read_plain(path)
    try:
        table = pd.read_csv(io.BytesIO(kept))
        if tuple(table.columns[2:]) != _COLUMNS:
            raise ValueError(f"its columns after two parameters are not {', '.join(_COLUMNS)}")
        place = [str(name) for name in table.columns[:2]]
        whole = math.prod(table[name].nunique() for name in place)
        if len(table) != whole or table.duplicated(place).any():
            raise ValueError("it has not one line for each hand of a grid")
        grid = xr.Dataset.from_dataframe(table.set_index(place))
        rows = np.stack([grid.score.values, grid.se.values], axis=-1)
        rows = np.concatenate([rows, np.full_like(rows, np.nan)], axis=-1)
        data = dataset_of(
            "map",
            {"score": rows[..., None, :], **{name: grid[name].values for name in _COLUMNS[2:]}},
            {**{name: grid[name].values.astype(float) for name in place}, "index": ["score"]},
            {"score_name": "score", "hands": int(np.isfinite(grid.score).sum())},
            place=place,
        )
        check_variables(data)
        if data.attrs["hands"] == 0:
            raise ValueError("no hand has a score")
    except Exception as error:  # of every kind, where pandas meets what is no table
        raise ValueError(f"{path} is no map that can be read: {message_of(error)}") from None
    return data
