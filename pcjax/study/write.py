"""Components as the tables of a study file."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping
from typing import Any

from pcjax.model.hand import HandDesign


def hand_table(hand: HandDesign) -> dict[str, Any]:
    """A hand as its table: any two chains; limbs without thickness are not said to have none."""
    thickness = float(hand.thickness)
    return {
        "palm_length": float(hand.palm_length),
        "lengths": [[float(x) for x in row] for row in hand.lengths],
        "angles_deg": [[round(math.degrees(float(x)), 9) for x in row] for row in hand.angles],
    } | ({"thickness": thickness} if thickness else {})


def text_of(tables: Mapping[str, Mapping[str, Any]]) -> str:
    """Tables as TOML."""
    return "\n\n".join(_table(name, table) for name, table in tables.items()) + "\n"


def _table(name: str, table: Mapping[str, Any]) -> str:
    lines = [f"{_key(key)} = {_text(value)}" for key, value in table.items()]
    return "\n".join([f"[{name}]", *lines])


def _key(name: str) -> str:
    return name if re.fullmatch(r"[\w-]+", name, re.ASCII) else json.dumps(name)


def _text(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list):
        return f"[{', '.join(map(_text, value))}]"
    return json.dumps(value, ensure_ascii=False) if isinstance(value, str) else repr(value)
