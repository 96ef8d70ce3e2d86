"""The page of `pcjax view`: what is dragged, what follows, and who may ask for it."""

from __future__ import annotations

import http.client
import json
import math
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit
from xml.etree import ElementTree

import ezdxf
import numpy as np
import pytest

import pcjax
from pcjax.cli import main
from pcjax.view.web.desk import Desk, doubt_of, problem_of
from pcjax.view.web.dials import dials_of, joints_of, limb_set, pulled, turned
from pcjax.view.web.files import inside, listed, open_study, save_study
from pcjax.view.web.serve import free_port
from tests.browser import Visitor, browser, page_served

BOX = pcjax.Study(pcjax.box_hand(), pcjax.Circle(25.0))

OWN = """
[hand]
palm_length = 400
lengths = [[350, 120, 90], [300, 140, 60]]
angles_deg = [[90, 90, 75], [80, 95, 50]]

[body]
radius = 22
"""


# ---------------------------------------------------------------------------- without a browser


def random_hand(rng: np.random.Generator) -> pcjax.HandDesign:
    counts = rng.integers(1, 5, 2)
    lengths = tuple(tuple(rng.uniform(20, 300, n).tolist()) for n in counts)
    angles = tuple(tuple(rng.uniform(-2, 2, n).tolist()) for n in counts)
    return pcjax.HandDesign(float(rng.uniform(50, 900)), lengths, angles)


def test_a_joint_is_where_it_was_dragged_to_and_all_beyond_moves_along() -> None:
    """200 random hands: to a hundredth of the palm, since angles are rounded to a tenth of a
    degree and lengths to about a thousandth."""
    rng = np.random.default_rng(0)
    for _ in range(200):
        hand = random_hand(rng)
        finger = int(rng.integers(2))
        joint = int(rng.integers(1, len(hand.lengths[finger]) + 1))
        before = joints_of(hand)
        palm = float(hand.palm_length)
        at = before[finger][joint - 1] + rng.uniform(-1, 1, 2) * palm
        new = pulled(hand, finger, joint, *at.tolist(), mirrored=False)
        after = joints_of(new)
        assert np.max(np.abs(after[finger][joint] - at)) < 0.01 * palm
        np.testing.assert_allclose(after[finger][:joint], before[finger][:joint], atol=1e-9 * palm)
        np.testing.assert_array_equal(after[1 - finger], before[1 - finger])
        # Limbs beyond keep their lengths and the angles between them.
        assert new.lengths[finger][joint:] == hand.lengths[finger][joint:]
        assert new.angles[finger][joint:] == hand.angles[finger][joint:]


def test_both_fingers_move_as_mirror_images() -> None:
    hand = pulled(pcjax.box_hand(), 0, 3, -120.0, 380.0, mirrored=True)
    one, other = joints_of(hand)
    np.testing.assert_allclose(one * [-1, 1], other, atol=1e-9)
    assert hand.angles[0] != pcjax.box_hand().angles[0]
    wider = pulled(pcjax.box_hand(), 1, 0, 300.0, 20.0, mirrored=False)
    assert wider.palm_length == 600


def test_a_drag_never_leaves_a_limb_without_length() -> None:
    hand = pcjax.box_hand()
    x, y = joints_of(hand)[0][1]
    assert min(pulled(hand, 0, 2, float(x), float(y), mirrored=False).lengths[0]) > 0
    assert pulled(hand, 0, 0, 100.0, 0.0, mirrored=False).palm_length > 0


@pytest.mark.parametrize("mirrored", [True, False])
def test_every_dial_turns_what_it_names(mirrored: bool) -> None:
    study = pcjax.Study(pcjax.box_hand(thickness=4.0), pcjax.Square(40.0))
    for dial in dials_of(study, mirrored=mirrored):
        assert dial.low < dial.high
        if math.isnan(dial.value):  # no friction
            dial = next(
                d
                for d in dials_of(turned(study, dial.label, 0.2), mirrored=mirrored)
                if d.label == dial.label
            )
        value = dial.value + 2 * dial.step if dial.value < dial.high else dial.value - dial.step
        other = turned(study, dial.label, value)
        found = {d.label: d.value for d in dials_of(other, mirrored=mirrored)}
        assert found[dial.label] == pytest.approx(value)


def test_a_change_can_be_undone_and_done_again() -> None:
    desk = Desk.of(BOX)
    studies = [turned(BOX, "fingertip_angle_deg", value) for value in (12.0, 14.0, 16.0)]
    for study in studies:
        desk.change(study)
    desk.undo()
    desk.undo()
    assert desk.study is studies[0]
    desk.redo()
    assert desk.study is studies[1]
    again = Desk.again(desk.kept())
    again.redo()
    assert again.study is studies[2]
    assert desk.study is studies[1]  # its lists are its own
    desk.change(studies[0])
    desk.redo()
    assert desk.study is studies[0]  # a new change has no way on
    desk.reset()
    assert desk.study is BOX


def test_the_gap_is_what_was_asked_for_where_the_lids_lean() -> None:
    right = math.pi / 2
    chain = ((500.0, 180.0, 80.0),) * 2
    hand = pcjax.HandDesign(500.0, chain, ((right, right - 0.7, 1.0),) * 2)
    study = turned(pcjax.Study(hand, pcjax.Circle(25.0)), "gap_width", 250.0)
    one, other = (joints[2] for joints in joints_of(study.hand))
    assert other[0] - one[0] == pytest.approx(250)
    none = turned(turned(BOX, "friction", 0.2), "friction", None)
    assert none.law == BOX.law
    with pytest.raises(ValueError, match="has to be a number"):
        turned(BOX, "radius", None)


def test_without_nicegui_it_is_said_in_one_line() -> None:
    code = (
        "import sys; sys.modules['nicegui'] = None; sys.argv = ['pcjax', 'view', '--no-browser'];"
        "from pcjax.cli import main; main()"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert done.stderr == "pcjax: the page needs the package nicegui: pip install 'pcjax[view]'\n"


def test_what_is_wrong_with_a_design_is_said() -> None:
    crossed = turned(BOX, "fingertip_length", 400.0)
    crossed = turned(crossed, "fingertip_angle_deg", 80.0)
    assert "cross" in problem_of(crossed)
    assert problem_of(BOX) == ""
    narrow = turned(BOX, "gap_width", 80.0)
    assert problem_of(narrow) == ""
    assert doubt_of(narrow, 0.04).startswith("the gap is 45.27, less than the object's 50")
    assert doubt_of(BOX, 0.04) == ""
    # A search ends on the edge, up to its slack.
    edge = 70.0 + 200.0 * math.sin(math.radians(10.0))
    assert doubt_of(turned(BOX, "gap_width", edge - 4e-5), 0.04) == ""
    assert doubt_of(turned(BOX, "gap_width", edge - 1e-3), 0.04) != ""
    limit = "fingertip_length + 0.5 gap_width <= 190"
    assert doubt_of(BOX, 0.04, [limit]) == f"it breaks the limit {limit}"
    assert doubt_of(BOX, 0.04, ["fingertip_length + 0.5 gap_width <= 200"]) == ""
    one = limb_set(BOX.hand, 0, 2, 3.0, 300.0, mirrored=False)
    assert problem_of(pcjax.Study(one, BOX.body))


def test_files_are_those_of_the_folder(tmp_path: Path) -> None:
    folder = tmp_path / "mine"
    (folder / "deep").mkdir(parents=True)
    (tmp_path / "secret.toml").write_text("[hand]\n")
    (folder / "link.toml").symlink_to(tmp_path / "secret.toml")
    for name in ("../secret.toml", str(tmp_path / "secret.toml"), "link.toml", "deep/../../x.toml"):
        with pytest.raises(ValueError, match="outside of the folder"):
            inside(folder, name)
        with pytest.raises(ValueError, match="outside of the folder"):
            open_study(folder, name)
    with pytest.raises(ValueError, match="outside of the folder"):
        save_study(folder, "../other", BOX)
    assert save_study(folder, "deep/own", BOX) == "deep/own.toml"
    with pytest.raises(ValueError, match="is there already"):
        save_study(folder, "deep/own", BOX)
    assert save_study(folder, "deep/own", BOX, "deep/own.toml") == "deep/own.toml"
    study, doubts = open_study(folder, "deep/own.toml")
    assert (study.body.radius, doubts) == (25, [])
    assert listed(folder, (".toml",)) == ["link.toml", "deep/own.toml"]
    pcjax.export_hand(pcjax.box_hand(palm_length=80.0), folder / "drawn.dxf", units="mm")
    study, _ = open_study(folder, "drawn.dxf")
    assert (study.units, study.hand.palm_length) == ("mm", pytest.approx(80))
    with pytest.raises(ValueError, match="needs a name"):
        inside(folder, " ")


def test_a_port_that_is_taken_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    import socket

    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        one.listen()
        port = one.getsockname()[1]
        with pytest.raises(SystemExit) as end:
            main(["view", "--no-browser", "--port", str(port)])
        assert end.value.code == 2
        assert f"port {port} cannot be had" in capsys.readouterr().err
        assert free_port(None) != port
    with pytest.raises(SystemExit) as end:
        main(["view", "--no-browser", "--port", "70000"])
    assert "between 1 and 65535" in capsys.readouterr().err


# ---------------------------------------------------------------------------- in a browser


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("view")
    (made / "own.toml").write_text(OWN)
    (made / "bad.toml").write_text("[hand]\npalm_lenght = 3\n")
    return made


@pytest.fixture(scope="module")
def chromium() -> Iterator[Any]:
    with browser() as one:
        yield one


@pytest.fixture(scope="module")
def address(chromium: Any, folder: Path) -> Iterator[str]:
    with page_served(folder) as served:
        yield served.address


def close(text: str, one: pcjax.Estimate) -> None:
    """A value and its interval are those of an estimate, but for what another program's rounding
    does to a few of 5,000 trials."""
    told = [float(part) for part in re.findall(r"[0-9][0-9,.]*[0-9]", text.replace(",", ""))]
    assert told == pytest.approx([one.value, one.low, one.high], rel=2e-3)


def keep(visitor: Visitor, name: str, **options: Any) -> None:
    """A picture of the page, for the documentation: `PCJAX_SCREENS=docs pytest tests/test_view.py`
    puts them there."""
    if folder := os.environ.get("PCJAX_SCREENS"):
        visitor.page.wait_for_timeout(500)
        visitor.page.screenshot(path=Path(folder) / f"view-{name}.png", **options)


def test_a_joint_is_dragged_and_the_numbers_follow(
    chromium: Any, address: str, folder: Path
) -> None:
    me = Visitor(chromium, address)
    first = me.told("score")
    known = pcjax.evaluate(BOX.hand, BOX.body).score()["index1"]
    close(first, known)
    me.at("pin").click()
    assert "not certain" in me.until("against", "+0.000")
    me.drag("fingertip-1", 14, 40, hold=True)
    me.until("about", "200 trials")  # while it moves
    assert me.told("score") != first
    me.page.mouse.up()
    second = me.refined()
    assert "better" in me.told("against")
    # The numbers are those of the study, on 5,000 trials.
    me.file("save", "dragged")
    me.notified("saved dragged.toml")
    study = pcjax.load_study(folder / "dragged.toml")
    assert study.hand.lengths[0] == study.hand.lengths[1]
    assert study.hand.lengths[0][-1] > 150
    found = pcjax.evaluate(study.hand, study.body)
    close(second, found.score()["index1"])
    for direction in ("does", "eoen"):
        close(me.told(f"index1-{direction}"), found.indices(direction)["index1"])
    keep(me, "dragged")
    # A reload keeps it all; somebody else sees nothing of it.
    me.page.reload()
    assert me.refined() == second
    assert "better" in me.told("against")
    other = Visitor(chromium, address)
    assert other.told("score") == first
    assert other.told("name") == "a design without a file"
    other.well()
    me.at("undo").click()
    assert me.refined() == first
    me.at("redo").click()
    assert me.refined() == second
    me.at("reset").click()
    assert me.refined() == first
    me.well()


def test_sliders_and_clicks(chromium: Any, address: str) -> None:
    me = Visitor(chromium, address)
    first = me.told("score")
    # A click beside the joints, or on one without a move, changes nothing.
    box = me.at("hand-does").bounding_box()
    me.page.mouse.click(box["x"] + 3, box["y"] + 3)
    x, y = me.middle("fingertip-1")
    me.page.mouse.click(x + 4, y + 2)
    me.page.wait_for_timeout(300)
    assert me.refined() == first
    # What a slider is dropped at is refined, however soon it is dropped.
    for k in range(4):
        me.drag("slider-fingertip_length", 20 - 40 * (k % 2), 0)
        me.refined()
    assert me.told("score") == first or me.at("number-fingertip_length").input_value() != "100"
    for _ in range(4):
        me.at("undo").click()
    assert me.refined() == first
    # A number that is refused is put back, and so is an emptied one.
    me.at("number-radius").fill("")
    me.page.keyboard.press("Enter")
    me.notified("radius")
    me.page.wait_for_function(
        "document.querySelector('[data-testid=number-radius]').value === '25'"
    )
    me.at("mirrored").click()
    me.at("number-link_length_21").wait_for()
    assert me.told("score") == first
    me.drag("fingertip-1", 0, 20)
    me.refined()
    assert me.at("number-fingertip_length_2").input_value() == "100"
    assert me.at("number-fingertip_length_1").input_value() != "100"
    me.well()


def test_entering_alone_is_called_so(chromium: Any, folder: Path) -> None:
    """And a lower index is the better one."""
    (folder / "enter.toml").write_text('[hand]\npreset = "box"\n\n[run]\ndirection = "eoen"\n')
    with page_served(folder, "enter.toml") as served:
        me = Visitor(chromium, served.address)
        assert me.told("score").startswith("EoEn 229,094")
        assert me.told("name") == "enter.toml"
        me.at("pin").click()
        me.until("against", "EoEn +0")
        me.drag("fingertip-1", -20, 10)
        me.refined()
        gain = float(re.findall(r"EoEn ([+-][\d,]+)", me.told("against"))[0].replace(",", ""))
        assert me.told("against").endswith("better" if gain < 0 else "worse")
        me.well()


def test_a_design_that_is_none_is_red_and_says_why(chromium: Any, address: str) -> None:
    me = Visitor(chromium, address)
    me.drag("fingertip-1", 130, 10)
    assert "crosses" in me.until("problem", "limb")
    assert me.told("score") == "no score"
    assert me.page.locator("polyline.limbs.wrong").count() >= 1
    keep(me, "illegal")
    me.at("play").click()
    me.notified("no trial to be played")
    me.page.keyboard.press("Control+z")
    assert me.refined() == "score 1.528 [1.491, 1.564]"
    # Narrower than the clearance allows: red, too, but it has numbers.
    me.at("number-gap_width").fill("100")
    me.page.keyboard.press("Enter")
    assert "clearance" in me.until("problem", "less than the object's")
    me.refined()
    me.page.get_by_text("Limits", exact=True).click()
    me.at("limits").fill("fingertip_length >= 120")
    me.at("number-gap_width").fill("200")
    me.page.keyboard.press("Enter")
    me.until("problem", "breaks the limit fingertip_length >= 120")
    me.refined()
    me.at("number-radius").fill("-3")
    me.page.keyboard.press("Enter")
    me.notified("radius is -3")
    assert me.at("number-radius").input_value() == "25"
    me.well()


def test_a_trial_is_played_and_a_search_is_taken(chromium: Any, address: str) -> None:
    me = Visitor(chromium, address)
    before = me.told("score")
    me.at("occupancy").click()
    for direction in ("does", "eoen"):
        me.page.locator(f"[data-testid=hand-{direction}] image").wait_for()
    assert me.page.locator("[data-testid=hand-does] circle.escape").count() > 20
    me.at("play").click()
    me.until("clock", "escaped")
    where = me.page.locator("[data-testid=hand-does] polygon.object")
    assert where.count() == 1
    first, now = where.get_attribute("points"), me.told("clock")
    me.page.wait_for_timeout(600)
    assert me.told("clock") != now
    assert where.get_attribute("points") != first
    keep(me, "played")
    me.at("play").click()
    me.until("play", "play_arrow")
    me.page.get_by_role("tab", name="improve").click()
    me.at("optimise").click()
    me.until("optimum", "round")
    me.page.locator("polyline.ghost").first.wait_for(state="attached")  # the best so far
    told = me.until("optimum", "unseen trials: better")
    keep(me, "improved")
    me.at("take").click()
    after = me.refined()
    assert float(after.split()[1]) > float(before.split()[1]) + 0.2
    assert f"fingertip_length {me_number(me, 'fingertip_length'):g}" in told
    me.page.get_by_role("tab", name="sweep").click()
    me.at("sweep").click()
    me.until("swept", "the curve goes there")
    keep(me, "swept")
    # What was found was of this study: it goes with it.
    me.file("open", "own.toml")
    me.until("name", "own.toml")
    assert not me.at("curve").is_visible()
    me.page.get_by_role("tab", name="improve").click()
    assert not me.at("take").is_visible()
    assert me.told("optimum") == ""
    me.well()


def me_number(me: Visitor, label: str) -> float:
    me.page.get_by_role("tab", name="design").click()
    return float(me.at(f"number-{label}").input_value())


def test_files_are_opened_saved_and_exported(chromium: Any, address: str, folder: Path) -> None:
    me = Visitor(chromium, address)
    me.file("open", "bad.toml")
    me.notified("palm_lenght")
    me.file("open", "../../etc/passwd")
    me.notified("outside of the folder")
    me.file("open", "none.toml")
    me.notified("none.toml")
    me.file("open", "own.toml")
    me.notified("opened own.toml")
    me.until("name", "own.toml")
    for name in ("joint-1-1", "joint-1-2", "joint-1-3", "fingertip-1", "joint-2-3", "fingertip-2"):
        assert me.at(name).count() == 1
    assert me.at("joint-2-4").count() == 0
    assert me.at("number-fingertip_angle_2_deg").input_value() == "40"  # each finger by itself
    assert me.refined() != "score 1.528 [1.491, 1.564]"
    told = json.loads(me.download("json"))
    assert told["evaluation"]["trials"] == 5000
    assert "palm_length = 400" in told["study"]
    assert me.download("png").startswith(b"\x89PNG")
    assert ElementTree.fromstring(me.download("svg")).tag.endswith("svg")
    (folder / "hand.dxf").write_bytes(me.download("dxf"))
    layers = {entity.dxf.layer for entity in ezdxf.readfile(folder / "hand.dxf").modelspace()}
    assert {"LIMBS", "OBJECT"} <= layers
    me.file("open", "hand.dxf")
    me.notified("opened hand.dxf")
    me.refined()
    assert float(me.at("number-palm_length").input_value()) == pytest.approx(400)
    me.well()


def test_fingers_and_keys_move_joints(chromium: Any, address: str) -> None:
    phone = Visitor(
        chromium,
        address,
        viewport={"width": 390, "height": 844},
        has_touch=True,
        is_mobile=True,
        color_scheme="dark",
    )
    keep(phone, "phone", full_page=True)
    width = phone.page.evaluate("document.documentElement.scrollWidth")
    assert width <= 390
    first = phone.told("score")
    phone.touch("fingertip-1", 8, 20)
    second = phone.refined()
    assert second != first
    phone.at("fingertip-1").focus()
    for key in ("ArrowUp", "ArrowLeft", "Shift+ArrowRight"):
        phone.page.keyboard.press(key)
    assert phone.refined() != second
    focused = phone.page.evaluate("document.activeElement.dataset.testid")
    assert focused == "fingertip-1"
    phone.well()


def test_a_foreign_page_is_refused(address: str) -> None:
    """By its origin, also for a web socket, and by a name that is not this machine's."""
    host = urlsplit(address).netloc
    upgrade = {
        "Connection": "Upgrade",
        "Upgrade": "websocket",
        "Sec-WebSocket-Version": "13",
        "Sec-WebSocket-Key": "dGhlIHNhbXBsZSBub25jZQ==",
    }
    socket_path = "/_nicegui_ws/socket.io/?EIO=4&transport=websocket"

    def status(path: str, **headers: str) -> int:
        connection = http.client.HTTPConnection(host, timeout=30)
        connection.putrequest("GET", path, skip_host=True)
        for key, value in ({"Host": host} | headers).items():
            connection.putheader(key, value)
        connection.endheaders()
        found = connection.getresponse().status
        connection.close()
        return found

    assert status("/") == 200
    assert status("/", Origin=f"http://{host}") == 200
    assert status("/", Origin="http://evil.example") == 403
    assert status("/", Origin="null") == 403
    assert status("/", Origin="http://[") == 403
    assert status("/", **{"Sec-Fetch-Site": "cross-site", "Sec-Fetch-Mode": "no-cors"}) == 403
    assert status("/", **{"Sec-Fetch-Site": "cross-site", "Sec-Fetch-Mode": "navigate"}) == 200
    assert status("/", Host="evil.example") == 403
    assert status("/", Host="evil.example:" + host.split(":")[1]) == 403
    assert status(socket_path, **upgrade, Origin=f"http://{host}") == 101
    assert status(socket_path, **upgrade, Origin="http://evil.example") == 403
