"""Components and their registries."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from pcjax.components import Registry, quantities
from pcjax.model.bodies.base import BODIES, Body
from pcjax.model.bodies.circle import Circle
from pcjax.model.bodies.stick import Stick
from pcjax.model.drives.base import DRIVES
from pcjax.model.presets import HANDS
from pcjax.simulate.engine import ENGINES


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
    for registry in (BODIES, DRIVES, ENGINES, HANDS):
        for kind in registry.kinds():
            declared = quantities(registry[kind]).values()
            keys = [what.file_key for what in declared if what.key]
            assert len(set(keys)) == len(keys)
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


def test_a_package_offers_its_class_by_an_entry_point(tmp_path: Path) -> None:
    (tmp_path / "own_things.py").write_text(
        "import pcjax\n"
        "from pcjax.components import quantity\n"
        "class Puck(pcjax.Body):\n"
        "    radius: float = quantity('length', 'of the puck', low=0, above=True, key='radius')\n"
        "    gloss: float = quantity('1', 'how much it shines', default=0.5, key='gloss',\n"
        "        flag='gloss')\n"
        "    noun = 'puck of radius'\n"
        "    @property\n"
        "    def width(self):\n"
        "        return 2 * self.radius\n"
        "from pcjax.simulate.stepping import FixedSteps\n"
        "class Beats(FixedSteps):\n"
        "    steps: float = quantity('1', 'in a period', default=500, key='beats', static=True)\n"
        "    def steps_wanted(self, period):\n"
        "        return self.steps\n"
    )
    package = tmp_path / "own_things-1.0.dist-info"
    package.mkdir()
    (package / "METADATA").write_text("Metadata-Version: 2.1\nName: own-things\nVersion: 1.0\n")
    points = "[pcjax.bodies]\npuck = own_things:Puck\nbroken = own_things:Nothing\n"
    points += "[pcjax.engines]\nbeats = own_things:Beats\n"
    (package / "entry_points.txt").write_text(points)
    (tmp_path / "own.toml").write_text(
        '[body]\nkind = "puck"\nradius = 20\ngloss = 0.25\n[hand]\npreset = "box"\n'
        '[run]\nengine = "beats"\nbeats = 400\n'
    )
    path = os.pathsep.join([str(tmp_path), *filter(None, [os.environ.get("PYTHONPATH")])])

    def command(*words: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [sys.executable, "-m", "pcjax", *words],
            capture_output=True,
            text=True,
            timeout=120,
            cwd=tmp_path,
            env={**os.environ, "PYTHONPATH": path},
        )

    flags = ["--body", "puck", "--radius", "21", "--gloss", "0.5"]
    done = command("inspect", "own.toml", *flags)
    assert done.returncode == 0, done.stderr
    assert "puck of radius 21" in done.stdout
    assert "beats (beats = 400) engine (dt = 0.025 s)" in done.stdout
    refused = command("inspect", "--body", "broken")
    assert refused.returncode == 2
    assert "own_things:Nothing" in refused.stderr
    assert "Traceback" not in refused.stderr
    assert len(refused.stderr.splitlines()) == 1
