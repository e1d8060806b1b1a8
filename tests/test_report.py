"""The page of a replay: self-contained, the same bytes, and sentences that follow the figures."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from lxml import html
from synthetic_hand import synthetic_hand

from hand_model.compile import compile
from hand_model.errors import HandModelError
from hand_model.hand import Estimate, Hand, Motor
from hand_model.identify import identify
from hand_model.output import new_file, new_folder
from hand_model.replay import replay
from hand_model.report import replay_figures, replay_page, write_report
from hand_model.report.comparison import comparison_page, comparison_text
from hand_model.report.identified import axes_section, coupling_section, maps_section, repairs_section
from hand_model.report.motors import MAIN, motors_section
from hand_model.report.page import Cell, Section, page, table
from hand_model.report.pictures import box_statistics
from hand_model.report.replayed import clock_section, distances_mm, error_section, noise_ratio
from hand_model.report.style import SERIES, drawing
from hand_model.report.text import columns, hand_text
from hand_model.report.words import listed, number, span
from hand_model.twin import Plan, bebionic, record


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Session and compiled hand of one finger, replayed."""
    root = tmp_path_factory.mktemp("report")
    plan = Plan(flexion=("full", "half", "full"), validation=("half",), excitations=0, still_s=0.3)
    record(bebionic("left", 2, ["index"]), root / "session", 2, plan=plan)
    compile(identify(root / "session"), root / "compiled")
    return root, replay(root / "compiled", root / "session")


@pytest.fixture(scope="module")
def residuals(made):
    return made[1]


def figure(text: str, pattern: str) -> float:
    return float(re.search(pattern, text).group(1))


def test_the_page_is_one_file_and_every_section_opens_with_a_sentence(residuals):
    raw = replay_page(residuals)
    tree = html.fromstring(raw)
    assert not tree.xpath("//link | //script | //img | //iframe")
    outside = [v for v in tree.xpath("//@href | //@src") if not v.startswith("#")]
    assert outside == []
    sections = tree.xpath("//section")
    ids = [s.get("id") for s in sections if "motors" not in s.get("id")]
    assert ids == ["error", "axes", "maps", "linkages", "clocks", "engines", "repairs"]
    assert tree.xpath("//nav/a/@href") == [f"#{s.get('id')}" for s in sections]
    for section in sections:
        sentence = section.xpath("p[@class='conclusion']")[0].text_content()
        assert sentence.endswith(".") and len(sentence.split()) > 8 and "nan" not in sentence
    assert len(tree.xpath("//*[local-name()='svg']")) == 2 + 1 + 2  # markers, phases, map, correlation, overlay


def test_tables_are_rectangular(residuals):
    for element in html.fromstring(replay_page(residuals)).xpath("//table"):
        head = len(element.xpath("thead/tr[last()]/th"))
        assert {len(row.xpath("td")) for row in element.xpath("tbody/tr")} == {head}
        for row in element.xpath("thead/tr[position() < last()]"):
            assert sum(int(v) for v in row.xpath("th/@colspan")) == head


def test_the_same_bytes_in_another_process(made, residuals, tmp_path):
    root, _ = made
    code = (
        "import sys; from hand_model.replay import replay; from hand_model.report import write_report\n"
        "write_report(replay(sys.argv[1], sys.argv[2]), sys.argv[3])"
    )
    argv = [sys.executable, "-c", code, str(root / "compiled"), str(root / "session"), str(tmp_path / "other")]
    subprocess.run(argv, check=True, env={**os.environ, "PYTHONHASHSEED": "77", "MPLBACKEND": "pdf"})
    write_report(residuals, tmp_path / "here")
    for name in ("report.html", "figures.json"):
        assert (tmp_path / "here" / name).read_bytes() == (tmp_path / "other" / name).read_bytes()


def test_sentences_follow_the_figures(residuals):
    """Residuals three times as large: the median triples in the sentence, the ratio to noise too."""

    def scaled(by):
        trials = [replace(t, residual_palm={m: by * r for m, r in t.residual_palm.items()}) for t in residuals.trials]
        return error_section(replace(residuals, trials=tuple(trials))).conclusion

    once, thrice = scaled(1.0), scaled(3.0)
    for pattern in (r"error is ([\d.]+) mm", r"([\d.]+) times what marker noise"):
        assert figure(thrice, pattern) == pytest.approx(3 * figure(once, pattern), abs=0.02)
    assert "took no part in the fit" in once
    fitted = [replace(t, held_out=False) for t in residuals.trials]
    assert "may have been fitted" in error_section(replace(residuals, trials=tuple(fitted))).conclusion


def test_figures_agree_with_the_residuals(residuals):
    found = replay_figures(residuals)["fingers"]["index"]["encoder"]
    trial = residuals.trials[0]
    assert found["error_m"]["median"] == pytest.approx(float(np.median(trial.distance_m("encoder"))))
    assert found["over_noise"] == pytest.approx(trial.noise_ratio("encoder"))
    assert noise_ratio([trial], "encoder") == pytest.approx(trial.noise_ratio("encoder"))
    parts = [distances_mm([trial], "encoder", segment=s) for s in ("proximal", "distal")]
    assert sum(map(len, parts)) == len(distances_mm([trial], "encoder")) == found["error_m"]["count"]
    json.dumps(replay_figures(residuals), allow_nan=False)


def test_degenerate_arcs_are_never_confident(residuals):
    hand = residuals.description.hand
    finger = hand.fingers[0]
    weak = replace(finger.joints[1], degenerate=True)
    section = axes_section(replace(hand, fingers=(replace(finger, joints=(finger.joints[0], weak)),)))
    assert "1 of the 2 axes" in section.conclusion and "index distal does not determine its axis" in section.conclusion
    text = " ".join(part.text_content() for part in section.body)
    assert text.count("not determined") == 1
    neither = tuple(replace(j, degenerate=True) for j in finger.joints)
    section = axes_section(replace(hand, fingers=(replace(finger, joints=neither),)))
    assert "known to" not in section.conclusion and "do not determine" in section.conclusion


def test_the_thesis_stands_beside_its_own_fingers_only(residuals):
    hand = residuals.description.hand
    assert "thesis" in maps_section(hand).conclusion and "0.979" in " ".join(
        p.text_content() for p in maps_section(hand).body
    )
    other = replace(hand, fingers=(replace(hand.fingers[0], name="gripper"),))
    assert "thesis" not in maps_section(other).conclusion
    assert "thesis" not in "".join(h.text_content() for h in maps_section(other).body[0].iter("th"))


def test_without_a_log(residuals):
    """Markers only: measured angles are what remains, and no section speaks of encoder or clocks."""
    trials = [
        replace(
            t,
            clock=None,
            counts=np.full_like(t.counts, np.nan),
            residual_palm={"measured": t.residual_palm["measured"]},
        )
        for t in residuals.trials
    ]
    hand = residuals.description.hand
    bare = replace(hand, motors=(), fingers=tuple(replace(f, encoder_maps=()) for f in hand.fingers))
    without = replace(residuals, trials=tuple(trials), description=replace(residuals.description, hand=bare))
    assert clock_section(without) is None and maps_section(bare) is None
    ids = html.fromstring(replay_page(without)).xpath("//section/@id")
    assert ids == ["error", "axes", "linkages", "engines", "repairs"]
    assert "measured angles" in error_section(without).conclusion and "encoder" not in error_section(without).conclusion


def test_a_hand_without_errors_or_logs_can_be_shown():
    """One that was built and not identified: no RMSE anywhere, three joints in a chain."""
    hand = synthetic_hand(2, joints=3)
    assert "nan" not in coupling_section(hand).conclusion
    assert "synthetic" in hand_text(hand) and maps_section(hand) is None
    assert b"<!DOCTYPE html>" in comparison_page(hand, hand) and "repeat" in comparison_text(hand, hand)


def test_repairs_are_listed(residuals):
    repairs = [
        {"kind": "swap", "trial": "a.c3d", "markers": ["P1", "P2"], "from_s": 1.0, "to_s": 1.5},
        {"kind": "slip", "trial": "b.c3d", "markers": ["D1"], "at_s": 4.0, "shift_m": 0.0021},
    ]
    section = repairs_section(replace(residuals.description.hand, extra={"repairs": repairs}, notes=("mind this",)))
    text = " ".join(part.text_content() for part in section.body)
    assert section.conclusion.startswith("1 exchange of labels and 1 slipped marker were found")
    for words in ("P1 and P2", "1.00 to 1.50 s", "2.10 mm", "mind this"):
        assert words in text


def test_motors_stand_with_their_intervals(residuals):
    parameters = {
        n: Estimate(10.0 * (i + 1), (9.0 * (i + 1), 11.0 * (i + 1)), "raw", "test") for i, n in enumerate(MAIN)
    }
    parameters["delay"] = Estimate(0.004, None, "s", "test")
    motor = Motor("index", 0.0, 100.0, parameters, 3.5, ("log/a.csv",), ("mind this too",))
    hand = replace(residuals.description.hand, motors=(motor,))
    section = motors_section(hand)
    text = " ".join(part.text_content() for part in section.body)
    assert "1 motor (index) identified from 1 trial" in section.conclusion and "10.0 %" in section.conclusion
    for words in ("30 (27 to 33)", "0.004", "index: mind this too", "3.5"):
        assert words in text
    assert "30 (27 to 33)" in hand_text(hand) and motors_section(replace(hand, motors=())) is None


def test_the_published_motor_models_stand_beside_the_published_figures(tmp_path):
    from hand_model.published import current_rmse_raw
    from hand_model.report.published_motors import published_motors_section
    from hand_model.session import read_session
    from hand_model.twin.case import draw_case

    draw_case(7, "none").record(tmp_path / "s")
    session = read_session(tmp_path / "s")
    actuators = sorted({f.actuator for f in session.fingers})
    motors = tuple(Motor(a, 0.0, 100.0, {}, 3.5, ()) for a in actuators)
    section = published_motors_section(Hand("h", session.side, {}, {}, (), 1e-4, {}, motors), session)
    rows = [[cell.text_content() for cell in row] for row in section.body[0].xpath(".//tbody/tr")]
    assert [r[0] for r in rows if r[0]] == actuators and len(rows) == 4 * len(actuators)
    for i, actuator in enumerate(actuators):
        mine = rows[4 * i : 4 * i + 4]
        assert [float(r[6]) for r in mine] == pytest.approx(current_rmse_raw(session.side, actuator), abs=0.006)
        for column in (2, 4):  # each model holds the one before it
            errors = [float(r[column]) for r in mine]
            assert errors == sorted(errors, reverse=True)
        assert f"({actuator})" in section.conclusion
    assert (
        published_motors_section(
            Hand("h", session.side, {}, {}, (), 1e-4, {}, (Motor("absent", 0.0, 1.0, {}, 1.0, ()),)), session
        )
        is None
    )


def test_engines_that_disagree_are_said_to(residuals):
    off = replace(residuals, agreement_m={**residuals.agreement_m, "pinocchio": 2e-6})
    sentence = html.fromstring(replay_page(off)).xpath("//section[@id='engines']/p")[0].text
    assert "do not agree" in sentence and "2.0e-06 m" in sentence


def test_names_are_text_not_markup():
    raw = page(
        "<b>&",
        "lead",
        [("1", "<i>")],
        [Section("a", "t", "c <script>x</script>.", (table(["<x>"], [["a&b"], [Cell("<y>", "flag")]]),))],
    )
    tree = html.fromstring(raw)
    assert not tree.xpath("//script | //x | //y | //body//b[not(text())]")
    assert tree.xpath("//h1")[0].text == "<b>&" and tree.xpath("//td/text()") == ["a&b", "<y>"]


def test_boxes_are_median_quartiles_and_range():
    values = np.array([5.0, 1.0, 2.0, 3.0, 4.0])
    found = box_statistics(values)
    assert [found[k] for k in ("whislo", "q1", "med", "q3", "whishi")] == [1, 2, 3, 4, 5]


def test_pictures_ignore_a_users_settings_and_follow_the_page():
    import matplotlib

    def draw():
        with drawing() as d:
            d.axes.plot([0, 1], [1, 0], color=SERIES[1])
        return d.svg

    before = draw()
    with matplotlib.rc_context({"lines.linewidth": 9, "font.size": 30}):
        assert draw() == before
        assert matplotlib.rcParams["lines.linewidth"] == 9
    assert b"var(--c2)" in before and b"#110102" not in before and b"<style" not in before


def test_outputs_appear_whole_or_not_at_all(tmp_path):
    with pytest.raises(ZeroDivisionError), new_folder(tmp_path / "out", ("a",)) as staging:
        (staging / "a").write_text("half")
        1 / 0  # noqa: B018
    assert list(tmp_path.iterdir()) == []
    with new_folder(tmp_path / "out", ("a",)) as staging:
        (staging / "a").write_text("one")
    with pytest.raises(ZeroDivisionError), new_folder(tmp_path / "out", ("a",)) as staging:
        1 / 0  # noqa: B018
    assert (tmp_path / "out" / "a").read_text() == "one"
    with pytest.raises(HandModelError, match='holds "a"'), new_folder(tmp_path / "out", ("b",)):
        pass
    with pytest.raises(ZeroDivisionError), new_file(tmp_path / "f") as staging:
        staging.write_text("half")
        1 / 0  # noqa: B018
    with pytest.raises(HandModelError, match="is a folder"), new_file(tmp_path / "out"):
        pass
    assert [p.name for p in tmp_path.iterdir()] == ["out"]


def test_words():
    assert number(-0.0001) == "0.00" and number(None) == number(float("nan")) == "–" and number(1.005, 1) == "1.0"
    assert listed([]) == "none" and listed(["a"]) == "a" and listed(["a", "b", "c"]) == "a, b and c"
    assert listed(list("abcdefgh"), 3) == "a, b, c and 5 more"
    assert span([1.0, 1.001]) == "1.00" and span([2.0, 1.0], 1, "mm") == "1.0 to 2.0 mm"
    assert columns(["a", "bb"], [["xyz", "1"]]) == "a    bb\nxyz   1"
