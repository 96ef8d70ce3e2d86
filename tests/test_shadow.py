"""A Shadow hand, as gymnasium-robotics has it: a hand file of someone else's."""

import math

import numpy as np
import pytest

from experiments.shadow import OBJECTS, POSTURES, TILT, angles_of, hand_file, shadow_hand
from pcjax import spatial
from pcjax.model.contact import ContactLaw
from pcjax.model.spatial.frozen import frozen
from pcjax.physics.state import INVALID, PASSED
from pcjax.simulate.backends.mujoco import MuJoCo, run_trials

mujoco = pytest.importorskip("mujoco")
pytest.importorskip("mujoco.batch")
pytestmark = pytest.mark.skipif(
    hand_file() is None, reason="the Shadow hand is in gymnasium-robotics, which is not installed"
)


@pytest.mark.parametrize("posture", POSTURES)
def test_its_geoms_are_where_mujoco_has_them(posture: str):
    hand = shadow_hand(posture)
    model = mujoco.MjModel.from_xml_path(str(hand_file()))
    data = mujoco.MjData(model)
    for joint, angle in angles_of(posture).items():
        data.joint(joint).qpos = angle
    mujoco.mj_forward(model, data)
    palm = data.body("robot0:palm")
    origin, axes = palm.xpos, palm.xmat.reshape(3, 3)
    geoms = frozen(hand).geoms
    # Three boxes of the palm, and three links of each finger; no wrist and no forearm.
    assert len(geoms) == 18
    assert all(geom.parts[0].startswith("robot0:C_") for geom in geoms)
    for geom in geoms:
        there = data.geom(geom.parts[0])
        assert geom.place == pytest.approx((there.xpos - origin) @ axes, abs=1e-12)
        assert geom.axes == pytest.approx(axes.T @ there.xmat.reshape(3, 3), abs=1e-12)
        size = model.geom(geom.parts[0]).size[: len(geom.solid.size)]
        assert geom.solid.size == pytest.approx(size, abs=0)


def test_joints_reach_their_finger_alone():
    before = shadow_hand("open")
    after = before.having(posture={"robot0:FFJ2": math.radians(40)})
    moved = {
        old.parts[0]
        for old, new in zip(frozen(before).geoms, frozen(after).geoms, strict=True)
        if not np.allclose(old.place, new.place, atol=1e-9)
    }
    assert moved == {f"robot0:C_ff{link}" for link in ("proximal", "middle", "distal")}


@pytest.mark.parametrize("body", OBJECTS)
def test_trials_go_right(body: str):
    law = ContactLaw(friction=0.5)
    escaped = []
    for posture in ("open", "half closed, palm arched"):
        scenario = spatial.Scenario(shadow_hand(posture), OBJECTS[body], TILT, law)
        scenario.check()
        engine = MuJoCo.suited([scenario])
        assert engine.dt == 0.002
        _, status = run_trials(scenario, np.arange(12), max_steps=10_000, seed=0, dt=engine.dt)
        assert not (status == INVALID).any()
        escaped.append(int((status == PASSED).sum()))
    # The draws are the same, and the second hand is the more closed: 7 or more escape from the
    # first, 3 or fewer from the second.
    assert escaped[0] > escaped[1]
