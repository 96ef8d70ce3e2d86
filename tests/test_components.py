"""Components and their registries."""

from __future__ import annotations

import subprocess
import sys

import pytest

from pcjax.components import Registry, quantities
from pcjax.model.bodies.base import BODIES, Body
from pcjax.model.bodies.circle import Circle
from pcjax.model.bodies.stick import Stick
from pcjax.model.drives.base import DRIVES
from pcjax.model.presets import HANDS


def test_every_kind_is_there_whatever_was_imported() -> None:
    code = (
        "from pcjax.model.drives.base import DRIVES; from pcjax.model.bodies.base import BODIES\n"
        "assert {'wrist', 'arm'} <= set(DRIVES.kinds()), DRIVES.kinds()\n"
        "assert DRIVES['arm'].__name__ == 'PlanarArm'\n"
        "assert {'circle', 'stick'} <= set(BODIES.kinds()), BODIES.kinds()\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr


def test_declared_names_are_unique_and_every_parameter_says_what_it_is() -> None:
    for registry in (BODIES, DRIVES, HANDS):
        for kind in registry.kinds():
            declared = quantities(registry[kind]).values()
            keys = [what.file_key for what in declared if what.key]
            assert len(set(keys)) == len(keys) > 0
            assert all(what.help for what in declared)


def test_a_kind_is_taken_once_and_unknown_ones_are_refused() -> None:
    registry: Registry[Body] = Registry("body", "pcjax.nobody")
    registry.register("thing")(Circle)
    registry.register("thing")(Circle)
    with pytest.raises(ValueError, match="the body thing is taken, by Circle"):
        registry.register("thing")(Stick)
    with pytest.raises(ValueError, match="there is no body thnig: did you mean thing"):
        registry["thnig"]
    with pytest.raises(ValueError, match="a Stick, which no file can name"):
        registry.kind_of(Stick(1.0))


def test_lengths_scale_and_angles_are_degrees_in_files() -> None:
    stick = Stick(50.0, 0.5).scaled(0.1)
    assert (float(stick.half_length), float(stick.orientation)) == (5.0, 0.5)
    assert stick.as_table() == {"radius": 5.0, "orientation_deg": pytest.approx(28.64788976)}
