"""Study files: what is written is read back, presets are the paper's hands, and bad files are
refused in one line that names table, key and the nearest name."""

from __future__ import annotations

import math
import re
from pathlib import Path

import jax
import numpy as np
import pytest

import pcjax
import pcjax.study.evaluate
from pcjax.model.bodies.circle import Circle
from pcjax.model.bodies.stick import Stick
from pcjax.model.contact import ContactLaw
from pcjax.model.drives.arm import PlanarArm
from pcjax.model.drives.wrist import WristTilt
from pcjax.model.hand import HandDesign
from pcjax.model.presets import box_hand, two_joint_hand
from pcjax.study.read import example, load_study
from pcjax.study.spec import Run, Study, Sweep
from pcjax.study.vary import unit_of
from pcjax.words import InputWarning

BOX = box_hand(math.radians(10))


def read(text: str, folder: Path) -> Study:
    path = folder / "study.toml"
    path.write_text(text)
    return load_study(path)


@pytest.mark.parametrize(
    "study",
    [
        Study(BOX, Circle(20.0), WristTilt(gravity=5.0), ContactLaw(restitution=0.3)),
        Study(
            HandDesign(400.0, ((300.0, 200.0), (310.0, 190.0)), ((1.5, 1.0), (1.6, 0.9))),
            Stick(30.0, 0.7),
            WristTilt(),
            ContactLaw(),
        ),
    ],
)
def test_a_study_file_gives_back_the_study(study: Study, tmp_path: Path) -> None:
    path = tmp_path / "hand.toml"
    path.write_text(study.to_toml())
    back = load_study(path)
    assert jax.tree.structure(back.hand) == jax.tree.structure(study.hand)
    for mine, other in zip(
        jax.tree.leaves((back.hand, back.body, back.drive, back.law)),
        jax.tree.leaves((study.hand, study.body, study.drive, study.law)),
        strict=True,
    ):
        assert float(mine) == pytest.approx(float(other), rel=1e-9)


GOOD = Study(two_joint_hand(), Circle(50.0), WristTilt(), ContactLaw()).to_toml()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (GOOD.replace("[hand]", "[hand"), "no TOML"),
        (GOOD.replace("[hand]", "[hnad]"), "did you mean hand"),
        (GOOD.replace("palm_length", "palm_lenght"), "did you mean palm_length"),
        (GOOD.replace("palm_length = 200.0", ""), "palm_length is missing"),
        (GOOD.replace("palm_length = 200.0", "palm_length = '2'"), "has to be a number"),
        (GOOD.replace("palm_length = 200.0", "palm_length = -2"), "above 0"),
        (GOOD.replace("lengths = [[200.0, 100.0], ", "lengths = ["), "two lists"),
        (GOOD.replace('"circle"', '"cube"'), "circle or stick or polygon or square"),
        (GOOD.replace('"circle"', '"square"'), "radius does not apply to the body square"),
        (GOOD.replace("radius", "orientation_deg"), "does not apply"),
        ("hand = 3", "has to be a table"),
    ],
)
def test_bad_study_files_are_refused(text: str, words: str, tmp_path: Path) -> None:
    path = tmp_path / "bad.toml"
    path.write_text(text)
    with pytest.raises(ValueError, match=words) as caught:
        load_study(path)
    assert "bad.toml" in str(caught.value)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (
            "[hand]\npalm_length = 1\nlengths = [[1], [1]]\nangles_deg = [[1.57], [1.2]]",
            "[hand] angles_deg: no joint is bent by 3 deg or more; these look like radians",
        ),
        (
            "[hand]\npreset = 'two-joint'\njoint_angles_deg = [1.1, 1.57]",
            "[hand] joint_angles_deg: no joint is bent by 3 deg or more; these look like radians",
        ),
        ("[hand]\nfingertip_angle_deg = -400", "[hand] fingertip_angle_deg is -400 deg"),
        ("[sweep]\nfingertip_angle_deg = [1, 1000]", "[sweep] fingertip_angle_deg is 1000 deg"),
    ],
)
def test_angles_that_look_like_a_slip_of_units_are_pointed_out(
    text: str, words: str, tmp_path: Path
) -> None:
    check_pointed_out(text, words, tmp_path)


def check_pointed_out(text: str, words: str, tmp_path: Path) -> None:
    """A study is read with one warning, that has the file and the words, where it was asked for."""
    with pytest.warns(InputWarning) as caught:
        read(text, tmp_path)
    (warning,) = caught
    assert str(warning.message).startswith(f"{tmp_path / 'study.toml'}: {words}")
    assert warning.filename == __file__


LIMBS = "lengths = [[80, 30], [80, 25]]\nangles_deg = [[90, 90], [90, 80]]\n"
OWN = f"[hand]\npalm_length = 80\n{LIMBS}"


def in_units(units: str, text: str = OWN) -> str:
    return f'{text}[units]\nlength = "{units}"\n'


@pytest.mark.parametrize(("units", "scale"), [("mm", 1000), ("cm", 100), ("m", 1)])
def test_in_a_real_unit_gravity_is_the_earths(units: str, scale: int, tmp_path: Path) -> None:
    study = read(in_units(units), tmp_path)
    assert (study.units, study.drive.gravity) == (units, 98 * scale / 10)
    assert study.law.resting_speed == scale / 1000
    assert study.body.radius == 4.0
    usual = Study.usual(study.hand, units=units)
    for other in (
        usual,
        Study(study.hand, study.body, units=units),
        read(usual.to_toml(), tmp_path),
    ):
        assert other.units == units
        assert other.drive == study.drive
        assert other.law == study.law
    # What the file says is in the study's own unit.
    own = read(in_units(units, f"{OWN}[drive]\ngravity = 3\n"), tmp_path)
    assert own.drive.gravity == 3.0
    assert own.having({"radius": 5.0}).units == units


def test_every_number_that_can_be_swept_has_its_unit(tmp_path: Path) -> None:
    parts = read(in_units("cm"), tmp_path).components
    for name, unit in {
        "radius": "cm",
        "link_length_12": "cm",
        "palm_length": "cm",
        "gravity": "cm / s^2",
        "resting_speed": "cm / s",
        "period": "s",
        "restitution": "1",
        "start_spread": "1",
        "amplitude_deg": "degree",
        "fingertip_angle_1_deg": "degree",
    }.items():
        assert unit_of(name, parts, "cm") == unit
    assert unit_of("gravity", parts, "model") == "model length / s^2"


def test_without_a_unit_all_numbers_are_the_papers(tmp_path: Path) -> None:
    for study in (
        read("[body]\nkind = 'circle'", tmp_path),
        Study.usual(),
        Study(BOX, Circle(9.0)),
    ):
        assert (study.units, study.drive.gravity) == ("model", 9.8)
        assert study.law.resting_speed == 0.05
        assert study.to_toml().startswith('[units]\nlength = "model"\n')


def test_the_same_hand_in_another_unit_is_the_same_study(tmp_path: Path) -> None:
    small = '[hand]\npreset = "box"\npalm_length = {}\n'
    mm = read(in_units("mm", small.format(90)), tmp_path).scenarios()["does"]
    metres = read(in_units("m", small.format(0.09)), tmp_path).scenarios()["does"]
    for scaled, parts in (
        (1000.0, lambda s: (s.hand.palm_length, s.hand.lengths, s.body.radius)),
        (1000.0, lambda s: (s.drive.gravity, s.law.resting_speed)),
        (1.0, lambda s: (s.hand.angles, s.drive.amplitude, s.law.restitution, s.start_spread)),
    ):
        a, b = (np.array(jax.tree.leaves(parts(one)), float) for one in (mm, metres))
        np.testing.assert_allclose(a, scaled * b, rtol=1e-12)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (
            in_units("inch"),
            r"line 6: \[units\] length is 'inch': it has to be model or mm or cm or m",
        ),
        ('[units]\nlenght = "mm"', "did you mean length"),
        ('[units]\nlength = "mm"', r"\[hand\] palm_length is missing: .*model units, .* in mm"),
        (in_units("mm", '[hand]\npreset = "box"\n'), r"\[hand\] palm_length is missing"),
        (
            in_units("cm", '[hand]\npreset = "two-joint"\npalm_length = 9\n'),
            r"\[hand\] link_lengths is missing: .* in cm",
        ),
        (
            in_units("mm", f'{OWN}[drive]\nkind = "arm"\n'),
            r"\[drive\] lengths is missing: .* in mm",
        ),
        (
            in_units("mm", f'{OWN}[drive]\nkind = "arm"\nlengths = [90, 90, 0]\n'),
            r"\[body\] radius is missing: .* in mm",
        ),
    ],
)
def test_a_real_unit_asks_for_what_has_a_size(text: str, words: str, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=words):
        read(text, tmp_path)


def test_python_asks_for_what_has_a_size() -> None:
    with pytest.raises(ValueError, match=r"^palm_length is missing: .* lengths are in mm$"):
        Study.usual(units="mm")
    with pytest.raises(ValueError, match=r"^radius is missing: .* lengths are in m$"):
        Study.usual(BOX, drive=PlanarArm(), units="m")
    with pytest.raises(ValueError, match="units is 'inch': it has to be one of model, mm, cm, m"):
        Study(BOX, Circle(5.0), units="inch")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (OWN, "[hand] palm_length is 80 in the paper's model units"),
        ('[hand]\npreset = "box"\npalm_length = 100', "[hand] palm_length is 100 in the paper's"),
        (
            in_units("mm", f"{OWN}[drive]\ngravity = 9.8\n"),
            "[drive] gravity is 9.8, the earth's in m / s^2, and lengths are in mm: there it is 98",
        ),
        (in_units("m", f"{OWN}[drive]\ngravity = 9810\n"), "[drive] gravity is 9810, the earth's"),
    ],
)
def test_lengths_that_look_like_a_slip_of_units_are_pointed_out(
    text: str, words: str, tmp_path: Path
) -> None:
    check_pointed_out(text, words, tmp_path)


@pytest.mark.parametrize(
    "text",
    [
        '[hand]\npreset = "two-joint"',
        '[hand]\npreset = "box"\ngap_width = 300',
        f"[hand]\npalm_length = 400\n{LIMBS.replace('80, 30', '350, 120')}",
        in_units("model"),
        f"{OWN}[drive]\ngravity = 9.8",
        in_units("mm", f"{OWN}[drive]\ngravity = 0\n"),
        in_units("mm", f"{OWN}[drive]\ngravity = 1620\n"),
    ],
)
def test_what_was_said_or_is_the_papers_is_not_doubted(text: str, tmp_path: Path) -> None:
    read(text, tmp_path)  # a warning would be an error


def test_evaluate_asks_about_units_like_a_file(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pcjax.study.evaluate, "evaluate_study", lambda study, **_: study)
    small = box_hand(palm_length=80.0)
    with pytest.warns(InputWarning, match='palm_length is 80 .* "mm" as units says so') as caught:
        pcjax.evaluate(small)
    assert caught[0].filename == __file__
    with pytest.warns(InputWarning, match=r"gravity is 9.8, the earth's in m / s\^2"):
        pcjax.evaluate(small, drive=WristTilt(), units="mm")
    for given in ({"units": "model"}, {"units": "mm"}, {"drive": WristTilt()}):
        pcjax.evaluate(small, **given)
    pcjax.evaluate(two_joint_hand())
    pcjax.evaluate()


def test_everything_in_a_file_comes_back(tmp_path: Path) -> None:
    study = Study(
        two_joint_hand(),
        Stick(40.0, 0.3),
        PlanarArm(gravity=3.0, ramp_time=4.0, gravity_direction=0.5),
        ContactLaw(restitution=0.4, resting_speed=0.02),
        Run("does", 300, 50_000, 7, 0.2, "stepping", 0.005, 64, 0.02),
        Sweep({"joint_angle_12_deg": (60.0, 65.5), "gravity": (1.0, 2.0)}, zipped=True),
    )
    back = read(study.to_toml(), tmp_path)
    assert back.to_toml() == study.to_toml()
    assert (back.run, back.sweep) == (study.run, study.sweep)
    assert read(example(), tmp_path).sweep is not None


def test_presets_and_what_is_left_out_are_the_papers(tmp_path: Path) -> None:
    box = read('[hand]\npreset = "box"\nfingertip_angle_deg = 25\ngap_width = 240', tmp_path)
    same = box_hand(math.radians(25), gap_width=240.0)
    for mine, other in zip(jax.tree.leaves(box.hand), jax.tree.leaves(same), strict=True):
        assert float(mine) == pytest.approx(float(other))
    assert float(box.body.radius) == 25.0
    assert (box.directions, box.max_steps) == (("does", "eoen"), 600_000)
    arm = read('[drive]\nkind = "arm"\n[body]\nkind = "stick"', tmp_path)
    assert float(arm.hand.palm_length) == 200.0
    assert (arm.directions, arm.max_steps) == (("does",), 180_000)


def test_ranges_and_grids(tmp_path: Path) -> None:
    text = """
[sweep]
radius = { from = 10, to = 30, step = 10 }
fingertip_angle_1_deg = { from = 0, to = 1, points = 2 }
"""
    conditions = read(text, tmp_path).conditions()
    points = [tuple(point.values()) for point, _ in conditions]
    assert points == [(r, a) for r in (10.0, 20.0, 30.0) for a in (0.0, 1.0)]
    for (radius, angle), (_, study) in zip(points, conditions, strict=True):
        assert float(study.body.radius) == radius
        assert math.degrees(float(study.hand.angles[0][-1])) == pytest.approx(90 - angle)
        assert study.hand.angles[1] == BOX.angles[1]


@pytest.mark.parametrize(
    ("name", "value", "read_back"),
    [
        ("gravity", 3.0, lambda s: s.drive.gravity),
        ("amplitude_deg", 20.0, lambda s: np.degrees(s.drive.amplitude)),
        ("period", 20.0, lambda s: s.drive.period),
        ("restitution", 0.7, lambda s: s.law.restitution),
        ("start_spread", 0.3, lambda s: s.scenarios()["does"].start_spread),
        ("palm_length", 450.0, lambda s: s.hand.palm_length),
        ("gap_width", 150.0, lambda s: s.hand.finger(1)[-1].start.x - s.hand.finger(0)[-1].start.x),
        ("link_length_21", 430.0, lambda s: s.hand.lengths[1][0]),
    ],
)
def test_a_swept_number_is_that_number(name: str, value: float, read_back) -> None:
    study = Study(BOX, Circle(20.0), WristTilt(), ContactLaw()).having({name: value})
    assert float(read_back(study)) == pytest.approx(value, rel=1e-5)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (
            "[hand]\nfingertip_angle = 3",
            r"\[hand\] fingertip_angle: did you mean fingertip_angle_deg",
        ),
        ("[hand]\nfingertip_angle_deg = '10 deg'", "has to be a number, in degrees"),
        ('[hand]\npreset = "bxo"', "did you mean box"),
        ("[hand]\npalm_length = 1\nlengths = [[1, 2], [3]]", r"\[hand\] angles_deg is missing"),
        (
            "[hand]\npalm_length = 9\nlengths = [[1, 2], [3, 1]]\nangles_deg = [[90, 90], [90]]",
            "finger 2 has 2 lengths and 1 angles",
        ),
        ("[hand]\npalm_length = 3\nfoo", "at end of document"),
        ("[body]\nradius = true", r"\[body\] radius is True: it has to be a number"),
        (
            '[drive]\nkind = "arm"\namplitude_deg = 3',
            r"\[drive\] amplitude_deg does not apply to the drive arm: it belongs to wrist",
        ),
        ('[drive]\nkind = "arm"\nlengths = [1, 2]', "a list of 3 numbers"),
        ("[run]\ntrails = 3", "did you mean trials"),
        ("[run]\ntrials = 3.5", "has to be a whole number"),
        ("[run]\ntrials = 0", r"\[run\] trials is 0"),
        ('[run]\nengine = "fast"', "auto or event or stepping"),
        ("[run]\nprecision_target = 0", r"\[run\] precision_target"),
        (
            "[hand]\npalm_length = 500\nlengths = [[400], [400]]\nangles_deg = [[90], [90]]\n"
            "[run]\ndirection = 'both'",
            "EoEn is not defined for this hand: with one limb a finger",
        ),
        ("[sweep]", "empty"),
        ("[sweep]\nfingertip_angle = [1]", "did you mean fingertip_angle_deg"),
        ("[sweep]\nraduis = [1]", "did you mean radius"),
        ("[sweep]\njoint_angle_9_deg = [1]", "there is no joint_angle_9_deg"),
        (
            "[sweep]\norientation_deg = [1]",
            "orientation_deg is none of this study's numbers: the body stick, the body polygon",
        ),
        ("[sweep]\nradius = []", "radius has no values"),
        ("[sweep]\nradius = 'a'", "a list of numbers, or a range"),
        ("[sweep]\nradius = [1, 1]", "a value twice"),
        ("[sweep]\nradius = [-1]", "has to be above 0"),
        ("[sweep]\nradius = [nan]", "finite"),
        ("[sweep]\nradius = { from = 1, to = 2 }", "either points or step"),
        ("[sweep]\nradius = { from = 1, to = 2, setp = 1 }", "did you mean step"),
        ("[sweep]\nradius = { from = 1, to = 2, points = 1_000_000 }", "points is 1000000"),
        ("[sweep]\nradius = { from = 3, to = 2, step = 1 }", "has to lead up"),
        ('[sweep]\nmode = "zip"\nradius = [1, 2]\ngravity = [3]', "radius 2, gravity 1"),
        (
            "[sweep]\nradius = { from = 1, to = 5, points = 1000 }\n"
            "gravity = { from = 1, to = 5, points = 1000 }",
            "1,000,000 conditions",
        ),
    ],
)
def test_what_is_wrong_is_said_in_one_line(text: str, words: str, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=words) as caught:
        read(text, tmp_path)
    assert re.search(r"study\.toml(, line \d+)?(: | is no TOML)", str(caught.value))
    assert "\n" not in str(caught.value)


# -------------------------------------------------------------------------------------- objective


def test_an_objective_is_read_written_and_varied(tmp_path: Path) -> None:
    path = tmp_path / "robust.toml"
    path.write_text(
        "[objective]\nradius = [10, 25]\ngravity = { from = 5, to = 10, step = 5 }\n"
        "weights = [1, 2, 3, 4]\n"
    )
    study = load_study(path)
    assert study.objective.over == {"radius": (10.0, 25.0), "gravity": (5.0, 10.0)}
    told = [(float(one.body.radius), float(one.drive.gravity)) for one in study.objective_studies()]
    assert told == [(10.0, 5.0), (10.0, 10.0), (25.0, 5.0), (25.0, 10.0)]
    path.write_text(study.to_toml())
    assert load_study(path).objective == study.objective
    path.write_text('[objective]\nfriction = [0.1, 0.5]\nof = "worst"\n')
    assert load_study(path).objective.worst


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("radius = []", "radius has no values"),
        ("radius = [5, 5]", "radius has a value twice"),
        ("radius = 5", "list of numbers"),
        ("radius = [5, -5]", "radius"),
        ("radius = [5, 6]\nweights = [1]", "1 weights for 2 conditions"),
        ("radius = [5, 6]\nweights = [1, 0]", "weight is 0"),
        ('radius = [5, 6]\nweights = [1, 1]\nof = "worst"', "worst counts"),
        ('of = "best"', "of is 'best'"),
        ("fingertip_length = [50, 60]", "hand that is looked for"),
        ("radus = [5, 6]", "did you mean radius"),
    ],
)
def test_a_wrong_objective_is_refused_with_its_line(text: str, words: str, tmp_path: Path) -> None:
    path = tmp_path / "robust.toml"
    path.write_text(f"[objective]\n{text}\n")
    with pytest.raises(ValueError, match=words) as caught:
        load_study(path)
    assert "[objective]" in str(caught.value)
    assert "line" in str(caught.value)
