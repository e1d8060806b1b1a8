"""Marker station: what is planted in a chain's markers is named, and what has no name is said."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation

from hand_model.diagnose.locate import markers
from hand_model.diagnose.locate.blocks import Blocks, _assembled, frames_of_block, present_way, project, way_of_motion
from hand_model.diagnose.locate.displacement import (
    CREEP,
    NO_HINGE,
    STRETCHED,
    WITH_FINGER,
    YIELDING,
    MarkerEffect,
    candidates_of,
)
from hand_model.diagnose.locate.lasting_noise import LastingNoise, camera_drift, lasting_noise
from hand_model.diagnose.locate.markers import MarkerNaming, named_in, tilt
from hand_model.diagnose.locate.slips import SPACE, _finding, _of_neighbours, _turning, palm_bends, unexplained
from hand_model.diagnose.locate.stepwise import Stepwise
from hand_model.identify.chain import Chain

BODY = np.repeat([0, 1, 2], 4)
LABELS = tuple(f"M{i}" for i in range(12))
COUNT, RECORDS = 240, 2
FLEXED = np.array([0.6, 0.4])  # rad, half of each joint's range


def seen(shift, *arguments, **settings) -> MarkerNaming:
    """The naming of `blocks_seen`."""
    return named_in(blocks_seen(shift, *arguments, **settings))


def blocks_seen(
    shift, seed: int = 0, body: int = 1, lasting: float = 0.0, rests: bool = False, slow: float = 0.0
) -> Blocks:
    """Two recordings, in each of which the hand is held another way, of a finger of two joints whose markers are displaced
    by shift(share, turn, arm): (b, 4, 3) [m] of one segment's markers. share: (b,) of the recording. turn: (b, 3, 3) of the first segment. arm:
    (4, 3) [m] from the support's middle, at rest. lasting: share of the noise that neighbouring blocks have alike; rests:
    whether the finger rests between its strokes, as it does beside such noise. slow: times the noise of blocks, what fades
    in 3 s."""
    rng = np.random.default_rng(seed)
    rest = np.concatenate([rng.normal(0, 0.012, (4, 3)) + [0.03 * k + 0.01, 0, 0.01] for k in range(3)])
    chain = Chain(rest, np.array([[0, 1, 0], [0, 1, 0]], float), np.array([[0.03, 0, 0], [0.06, 0, 0]]))
    share = np.tile(np.linspace(0, 1, COUNT), RECORDS)
    angle = (1 - np.cos(2 * np.pi * 4 * share))[:, None] * FLEXED
    residual = rng.normal(0, 3e-5, (COUNT * RECORDS, 12, 3))
    if lasting or rests:
        angle = np.clip(2 * angle - FLEXED, 0, 2 * FLEXED)
    if lasting:
        residual = lfilter([np.sqrt(1 - lasting**2)], [1, -lasting], residual, axis=0)
    fades = np.exp(-30 / COUNT / 3.0)
    for k in range(RECORDS):
        drift = rng.normal(0, slow * 3e-5 * np.sqrt(1 - fades**2), (COUNT + 100, 12, 3))
        residual[k * COUNT : (k + 1) * COUNT] += lfilter([1.0], [1.0, -fades], drift, axis=0)[100:]
    turn = Rotation.from_rotvec(angle[:, :1] * chain.axis_palm[0]).as_matrix()
    residual[:, BODY == body] += shift(share, turn, rest[BODY == body] - rest[BODY == body].mean(0))
    record = np.repeat(np.arange(RECORDS), COUNT)
    palm = Rotation.from_rotvec(np.outer(record, [0.3, -0.5, 0.4])).as_matrix()
    weight = np.full((len(share), 12), 8.0)
    return _assembled(chain, BODY, LABELS, residual, weight, angle, palm, record, 30 * share)


def slipping(at: float):
    """The first marker slips by 1.5 mm at that share of each recording."""

    def shift(share, turn, arm):
        out = np.zeros((len(share), 4, 3))
        out[:, 0] = (share >= at)[:, None] * (turn @ np.array([1e-3, -1e-3, 0.5e-3]))
        return out

    return shift


def slipping_together(share, turn, arm):
    """A support and two of its markers slip anew in each recording, soon after each other."""
    turned = Rotation.from_rotvec([0.01, 0.006, -0.004]).apply(arm) - arm
    out = (share >= 0.26)[:, None, None] * np.einsum("bij,mj->bmi", turn, turned)
    out[:, 1] += (share >= 0.32)[:, None] * (turn @ np.array([1.2e-4, 1.8e-4, -0.9e-4]))
    out[:, 3] += (share >= 0.28)[:, None] * (turn @ np.array([-2e-4, 0.5e-4, 1.5e-4]))
    return out


def creeping(share, turn, arm):
    turned = np.stack([Rotation.from_rotvec(s * np.array([0.05, 0.02, -0.08])).apply(arm) - arm for s in share])
    return np.einsum("bij,bmj->bmi", turn, turned)


def places(naming: MarkerNaming) -> set[tuple[str, str | None]]:
    return {(e.effect, e.label) for e in naming.found}


def test_healthy_markers_are_consistent() -> None:
    naming = seen(lambda share, turn, arm: np.zeros((len(share), 4, 3)))
    assert not naming.found and naming.p_before > 0.003


@pytest.mark.parametrize("seed", [0, *(pytest.param(s, marks=pytest.mark.slow) for s in (1, 2, 3))])
def test_noise_that_lasts_is_no_misfit_and_hides_none(monkeypatch, seed: int) -> None:
    healthy = seen(lambda share, turn, arm: np.zeros((len(share), 4, 3)), seed, lasting=0.5)
    assert not healthy.found and healthy.p_before > 0.003
    slipped = seen(slipping(0.4), seed, lasting=0.5)
    assert slipped.believed and places(slipped) == {("marker_slip", "M4")}
    monkeypatch.setattr(markers, "lasting_noise", lambda *_: LastingNoise())
    assert seen(lambda share, turn, arm: np.zeros((len(share), 4, 3)), seed, lasting=0.5).p_before < 1e-6


@pytest.mark.parametrize("seed", range(3))
def test_cameras_that_drift_are_no_misfit_and_hide_none(seed: int) -> None:
    """The palm's markers, of recordings in which nothing else moves, say whether it is the cameras."""
    still = blocks_seen(lambda share, turn, arm: np.zeros((len(share), 4, 3)), seed, slow=0.8)
    assert named_in(still).p_before < 0.003 < named_in(still, 0.6).p_before
    slipped = named_in(blocks_seen(slipping(0.4), seed, slow=0.8), 0.6)
    assert slipped.believed and places(slipped) == {("marker_slip", "M4")}
    # one segment alone that changes from pass to pass is none of theirs, and white noise has next to no such part
    loose = blocks_seen(lambda share, turn, arm: still.residual[:, BODY == 1], seed)
    for blocks in (loose, blocks_seen(lambda share, turn, arm: np.zeros((len(share), 4, 3)), seed)):
        y = project(blocks, blocks.residual.reshape(len(blocks.residual), -1, 1))[..., 0]
        assert lasting_noise(blocks, y, 0.6).inflation < 8.0 and lasting_noise(blocks, y) == LastingNoise()


def test_a_drift_of_the_cameras_is_in_every_recording() -> None:
    """By the distances between palm markers, which no finger changes; one of them that creeps in some recordings is not."""
    rng, fades = np.random.default_rng(3), np.exp(-1 / 300.0)
    time_s = np.arange(6000) / 100.0

    def session(*recordings: np.ndarray) -> SimpleNamespace:
        trials = [
            SimpleNamespace(mocap_path="m", mocap=lambda x=x: SimpleNamespace(markers=lambda _: x, time_s=time_s))
            for x in recordings
        ]
        return SimpleNamespace(palm=SimpleNamespace(labels=("A", "B", "C")), select=lambda kind: trials)

    at = rng.normal(0, 0.05, (3, 3))
    white = [at + rng.normal(0, 1e-4, (6000, 3, 3)) for _ in range(4)]
    drift = lfilter([1.0], [1.0, -fades], rng.normal(0, 3e-5 * np.sqrt(1 - fades**2), (4, 6000, 3, 3)), axis=1)
    creeps = np.zeros((6000, 3, 3))
    creeps[:, 0, 0] = np.linspace(0, 2e-3, 6000)
    assert camera_drift(session(*white)) == 0.0
    assert camera_drift(session(*(w + d for w, d in zip(white, drift, strict=True)))) > 0.2
    assert camera_drift(session(white[0] + creeps, *white[1:])) == 0.0
    assert camera_drift(session(white[0] + creeps)) == 0.0  # nothing says that it is the cameras


def test_what_slips_at_rest_is_no_noise_that_lasts() -> None:
    naming = seen(slipping(0.5), rests=True)  # at 0.5 the finger is open
    blocks = naming.blocks
    y = project(blocks, blocks.residual.reshape(len(blocks.residual), -1, 1))[..., 0]
    assert lasting_noise(blocks, y) == LastingNoise() and places(naming) == {("marker_slip", "M4")}
    lasting = seen(slipping(0.5), lasting=0.5).blocks
    y = project(lasting, lasting.residual.reshape(len(lasting.residual), -1, 1))[..., 0]
    assert 4.0 < lasting_noise(lasting, y).inflation < 9.0  # of neighbours: (1 + r) / (1 - r) over 1 - r, which is 6


@pytest.mark.parametrize("at", [0.4, 0.7])
def test_slips_in_every_recording_are_slips(at: float) -> None:
    naming = seen(slipping(at))
    assert naming.believed and places(naming) == {("marker_slip", "M4")}
    assert naming.p_after > 0.003


def test_slips_close_to_each_other_are_told_apart_whatever_was_found_first() -> None:
    naming = seen(slipping_together)
    assert places(naming) == {("support_slip", None), ("marker_slip", "M5"), ("marker_slip", "M7")}
    assert naming.p_after > 0.003
    assert {
        (e.effect, e.begin // COUNT, round(e.begin % COUNT / COUNT, 2)) for e in naming.found if e.begin is not None
    } == {
        (effect, record, at)
        for record in range(RECORDS)
        for effect, at in (("support_slip", 0.26), ("marker_slip", 0.32), ("marker_slip", 0.28))
    }


def test_what_was_put_right_before_the_next_recording_slips_there_again() -> None:
    blocks = blocks_seen(slipping(0.3))
    y, shared = (
        project(blocks, v) for v in (blocks.residual.reshape(len(blocks.residual), -1, 1), blocks.chain_columns)
    )
    search = Stepwise(blocks, candidates_of(blocks), y, shared, 3e-5 / np.sqrt(8), LastingNoise())
    at, end = round(0.3 * COUNT), COUNT * RECORDS
    slip = next(c for c in search.candidates if c.label == "M4" and c.lasting and c.step)
    lasts = MarkerEffect(slip.effect, slip.body, slip.label, at, end, slip.columns, 0.0, 0.0)  # and is not put right
    once = search.settled([lasts])
    assert {(e.label, e.begin, e.end) for e in once} == {("M4", at, COUNT), ("M4", COUNT + at, end)}


@pytest.mark.parametrize("along", [1, *(pytest.param(i, marks=pytest.mark.slow) for i in (0, 2))])
def test_cameras_whose_space_is_stretched_make_no_slips_and_no_joint_that_is_no_hinge(along: int) -> None:
    strain = np.zeros((3, 3))
    strain[along, along] = 0.02
    blocks = blocks_seen(lambda share, turn, arm: np.zeros((len(share), 4, 3)))
    world = np.einsum("bij,bmj->bmi", blocks.palm, blocks.position)
    shift = np.einsum("bji,bmj->bmi", blocks.palm, world @ strain)
    naming = named_in(replace(blocks, residual=blocks.residual + shift))
    assert naming.p_before < 1e-6 and naming.believed and places(naming) == {(STRETCHED, None)}
    finger = SimpleNamespace(finger=SimpleNamespace(name="index", segments=[]))
    (entry,) = unexplained(finger, naming)
    assert entry["shape"] == SPACE and entry["where"]["joint"] is None and entry["share_of_mismatch"] == 1.0


@pytest.mark.slow
def test_a_support_that_turns_all_the_time_does_not_slip() -> None:
    naming = seen(creeping)
    assert naming.believed and places(naming) == {(CREEP, None)}
    finger = SimpleNamespace(name="index", segments=(SimpleNamespace(name="proximal"), SimpleNamespace(name="distal")))
    (told,) = unexplained(SimpleNamespace(finger=finger), naming)
    assert (
        told["where"]["joint"] == "proximal"
        and told["shape"] == "a support moves all the time"
        and NO_HINGE not in told["shape"]
    )


@pytest.mark.parametrize(
    ("body", "course"), [(0, "pull"), (1, "speed"), (2, "pull")], ids=["palm plate", "soft mount", "thin segment"]
)
def test_a_marker_that_moves_as_the_finger_does_is_no_joint_and_no_slip(body: int, course: str) -> None:
    """By 0.1 mm: with friction's way and the spring, as what carries it bends, or with the speed, as its mount does."""

    def shift(share, turn, arm):
        phase = 2 * np.pi * 4 * share
        pull = np.sign(np.sin(phase)) + 0.5 * (1 - np.cos(phase))
        way = np.array([6e-5, 2e-5, -8e-5]) * (pull if course == "pull" else np.sin(phase))[:, None]
        out = np.zeros((len(share), 4, 3))
        out[:, 1] = way if body == 0 else np.einsum("bij,bj->bi", turn, way)
        return out

    naming, label = seen(shift, body=body), LABELS[4 * body + 1]
    assert naming.believed and naming.p_after > 0.003 and places(naming) == {(YIELDING, label)}
    assert palm_bends(naming) == (body == 0)
    finger = SimpleNamespace(name="index", segments=(SimpleNamespace(name="proximal"), SimpleNamespace(name="distal")))
    (told,) = unexplained(SimpleNamespace(finger=finger), naming)
    assert told["shape"] == f"{label} {WITH_FINGER}"
    assert told["where"]["joint"] == (None, "proximal", "distal")[body]


def tilting(amount):
    """The second joint tilts by amount(share of range, way of motion) [rad] about an axis across its own, which the
    first segment carries."""

    def shift(share, turn, arm):
        phase = 4 * share % 1
        u = 0.5 * (1 - np.cos(2 * np.pi * phase))
        tilt = amount(u, np.where(phase < 0.5, 1.0, -1.0))
        own = Rotation.from_rotvec(np.outer(2 * u * FLEXED[1], [0.0, 1.0, 0.0])).as_matrix()
        carried = np.einsum("bij,mj->bmi", own, arm + [0.012, 0.0, 0.01])  # from the joint
        return np.einsum("bij,bmj->bmi", turn, np.cross([1.0, 0.0, 0.0], carried)) * tilt[:, None, None]

    return shift


def travelling(way):
    """The second joint's centre travels by way(share of range) (n, 2) [m] across its axis, carried by the first
    segment."""

    def shift(share, turn, arm):
        x, z = way(0.5 * (1 - np.cos(2 * np.pi * 4 * share))).T
        return np.broadcast_to(np.einsum("bij,bj->bi", turn, np.stack([x, 0 * x, z], axis=1))[:, None], (len(x), 4, 3))

    return shift


def amount_of(naming: MarkerNaming, name: str = "amplitude") -> tuple[float, list[float]]:
    angles = SimpleNamespace(
        finger=SimpleNamespace(name="index", segments=[SimpleNamespace(name=n) for n in ("proximal", "distal")]),
        records=[SimpleNamespace(trial=SimpleNamespace(name=f"log/{k}.csv")) for k in range(RECORDS)],
    )
    first, found = naming.found[0], list(naming.found)
    told = _finding(angles, naming, first.effect, first.body, first.label, found).parameters[name]
    return told["value"], told["ci95"]


def test_a_joint_with_play_tilts_to_the_side_that_its_motion_takes_it() -> None:
    naming = seen(tilting(lambda u, way: 0.012 * way), body=2)
    assert naming.believed and places(naming) == {("joint_wobble", None)} and naming.p_after > 0.003
    assert naming.found[0].sides
    assert amount_of(naming)[0] == pytest.approx(0.012, rel=0.1)


def test_a_worn_joint_shifts_to_the_side_that_its_motion_takes_it() -> None:
    def shift(share, turn, arm):
        way = np.where(4 * share % 1 < 0.5, 1.0, -1.0)
        return (way[:, None] * (turn @ np.array([2e-4, 0.0, -1.5e-4])))[:, None] * np.ones((4, 1))

    naming = seen(shift, body=2)
    assert naming.believed and naming.p_after > 0.003 and naming.found[0].sides
    assert {e.effect for e in naming.found if not _turning(naming.found, e)} == {"moving_centre"}
    value, (low, high) = amount_of(naming, "travel")
    assert low < value < high and value == pytest.approx(5e-4, rel=0.1)  # from one side to the other


def test_at_rest_a_joint_moves_no_way_and_has_moved_one_before() -> None:
    blocks = seen(slipping(0.4)).blocks
    still = blocks.angle.copy()
    still[60:90] = still[60]  # on its way back
    blocks = replace(blocks, angle=still)
    now, before = present_way(blocks, 1), way_of_motion(blocks, 1)
    assert np.all(np.abs(now[62:88]) < 1e-9) and np.all(before[62:88] == before[59])
    assert set(now[[10, 40, 100]]) == {1.0, -1.0} and np.all(now[[10, 40, 100]] == before[[10, 40, 100]])


def test_a_step_that_is_small_beside_a_joint_with_play_is_not_told() -> None:
    wobble = seen(tilting(lambda u, way: 0.012 * way), body=2).found[0]
    step = replace(wobble, effect="support_slip", sides=False, begin=40, gain=0.01 * wobble.gain)
    assert _turning([wobble, step], step) and not _turning([wobble, step], wobble)
    assert not _turning([wobble, replace(step, gain=0.1 * wobble.gain)], replace(step, gain=0.1 * wobble.gain))
    assert not _turning([replace(wobble, sides=False), step], step)


def test_what_angles_may_owe_to_a_joint_that_is_no_hinge_grows_with_its_turn() -> None:
    """A quarter of the turn, the whole where its way is unknown; nothing beside slips."""
    small, large = (seen(tilting(lambda u, way, a=a: a * np.sin(np.pi * u)), body=2) for a in (0.006, 0.012))
    assert tilt(seen(slipping(0.4))) == 0.0
    assert tilt(large) == pytest.approx(2 * tilt(small), rel=0.05)
    assert 0.0 < tilt(large) < 0.25 * np.rad2deg(0.012)
    lost = replace(large, p_after=0.0, excess_after=large.excess_before)
    assert not lost.believed and tilt(lost) > 2.0 * tilt(large)


@pytest.mark.parametrize("waves", [0.65, 1.0, 1.4, 1.7])
def test_a_second_axis_may_swing_more_than_once_over_the_range(waves: float) -> None:
    naming = seen(tilting(lambda u, way: 0.012 * np.sin(2 * np.pi * waves * u + 0.7)), body=2)
    assert naming.believed and places(naming) == {("joint_wobble", None)} and naming.p_after > 0.003
    assert not naming.found[0].sides
    value, (low, high) = amount_of(naming)
    assert value == pytest.approx(0.012, rel=0.1 if waves >= 1 else 0.25) and low < 0.012 < high


@pytest.mark.parametrize(
    "way",
    [
        lambda u: np.stack([3e-3 * u, 0 * u], axis=1),
        lambda u: np.stack([0.5e-3 * np.sin(np.pi * u), 3e-3 * u], axis=1),
        lambda u: 1.5e-3 * np.stack([np.sin(np.pi * u), 1 - np.cos(np.pi * u)], axis=1),
    ],
)
def test_how_far_a_centre_travels_is_told_with_how_surely(way) -> None:
    naming = seen(travelling(way), body=2)
    assert naming.believed and places(naming) == {("moving_centre", None)}
    value, (low, high) = amount_of(naming, "travel")
    assert low <= 3e-3 <= high and value == pytest.approx(3e-3, rel=0.5)


@pytest.mark.parametrize("travels", [True, False])
def test_a_small_travel_beside_a_large_slip_stands_unless_the_slip_only_has_another_form(travels: bool) -> None:
    """A centre that travels 2 mm hardly shows beside a slip of 9 mm; nor does a slip that also changes with the angle,
    which no joint does."""
    centre = travelling(lambda u: np.stack([2e-3 * u, 0 * u], axis=1))

    def shift(share, turn, arm):
        u = 0.5 * (1 - np.cos(2 * np.pi * 4 * share))
        own = turn @ Rotation.from_rotvec(np.outer(2 * u * FLEXED[1], [0.0, 1.0, 0.0])).as_matrix()
        slip = (share >= 0.6) * (1.0 if travels else 1.0 + 0.02 * u**2)
        out = np.array(centre(share, turn, arm)) * travels
        out[:, 0] += slip[:, None] * (own @ np.array([6e-3, -6e-3, 3e-3]))
        return out

    naming = seen(shift, body=2)
    most = max(e.gain for e in naming.found)
    assert {e.effect for e in naming.found if e.gain > 0.1 * most} == {"marker_slip"}
    small = [e for e in naming.found if e.effect in markers.HINGE and e.gain < markers.SMALL * most]
    assert [e.effect for e in small if e.apart] == (["moving_centre"] if travels else [])


def test_what_no_finger_can_do_is_said_where_nothing_else_explains_the_markers(monkeypatch) -> None:
    """Whatever is found first is held to go beyond what a joint can: a slip is found without, a tilting joint is not."""
    found = markers._named
    tried: list[int] = []

    def beyond(search, before, begin=()):
        tried.append(len(search.candidates))
        naming = found(search, before, begin)
        if len(tried) > 1:
            return naming
        return replace(naming, found=tuple(replace(e, effect=NO_HINGE) for e in naming.found))

    monkeypatch.setattr(markers, "_named", beyond)
    assert places(seen(slipping(0.4))) == {("marker_slip", "M4")}
    assert len(tried) == 2 and tried[1] < tried[0]
    tried.clear()
    assert places(seen(tilting(lambda share, way: 0.01 * np.sin(2 * np.pi * share)), body=2)) == {(NO_HINGE, None)}


def test_what_slips_leave_is_told_beside_them_where_a_way_that_no_finger_can_go_was_found_first(monkeypatch) -> None:
    """A tilting joint whose marker slips is taken for no hinge at first, slips alone do not do: both together do."""
    found = markers._named
    begun: list[set[str]] = []

    def beyond(search, before, begin=()):
        begun.append({e.effect for e in begin})
        naming = found(search, before, begin)
        if len(begun) > 1:
            return naming
        ways = [e for e in naming.found if e.effect == "joint_wobble"]
        return replace(naming, found=tuple(replace(e, effect=NO_HINGE) for e in ways))

    def shift(share, turn, arm):
        tilt = tilting(lambda share, way: 0.01 * np.sin(2 * np.pi * share))
        return tilt(share, turn, arm) + slipping(0.4)(share, turn, arm)

    monkeypatch.setattr(markers, "_named", beyond)
    told = places(seen(shift, body=2))
    assert begun[0] == begun[1] == set() and "marker_slip" in begun[2]
    assert ("joint_wobble", None) in told and ("marker_slip", "M8") in told and (NO_HINGE, None) not in told


@pytest.mark.parametrize(("rate_hz", "frames"), [(50.0, 8), (120.0, 8), (240.0, 16), (960.0, 64)])
def test_a_block_lasts_as_long_at_any_high_rate(rate_hz: float, frames: int) -> None:
    assert frames_of_block(np.arange(100) / rate_hz) == frames


@pytest.mark.parametrize(
    ("through", "travels", "named"),
    [
        (0.99, 0.25, "joint_wobble"),
        (0.15, 0.97, "moving_centre"),
        (0.4, 0.7, "moving_centre"),
        (0.55, 0.4, "joint_wobble"),
        (0.3, 0.35, "joint_wobble"),
    ],
)
def test_an_axis_beside_the_joint_is_a_travelling_centre_where_that_explains_more_than_one_through_it(
    monkeypatch: pytest.MonkeyPatch, through: float, travels: float, named: str
) -> None:
    def candidate(effect: str, gain: float, shifts: tuple[bool, ...]) -> SimpleNamespace:
        kind = SimpleNamespace(effect=effect, body=1, shifts=shifts)
        return SimpleNamespace(candidate=kind, gain=gain, evidence=gain, effect=lambda: effect)

    search = object.__new__(Stepwise)
    search.candidates = []
    monkeypatch.setattr(Stepwise, "_beside", lambda *_: None)
    tried = [
        candidate("joint_wobble", 1000.0, (False, True)),
        candidate("joint_wobble", 1000.0 * through, (False, False)),
        candidate("moving_centre", 1000.0 * travels, (True,)),
    ]
    monkeypatch.setattr(Stepwise, "_tried", lambda *_: tried)
    assert search.next(()) == named


def test_a_centre_is_told_by_the_form_that_brings_evidence_and_not_by_the_one_that_fits_most(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def candidate(effect: str, gain: float, evidence: float, shifts: bool) -> SimpleNamespace:
        kind = SimpleNamespace(effect=effect, body=1, shifts=(shifts,))
        return SimpleNamespace(candidate=kind, gain=gain, evidence=evidence, effect=lambda: evidence)

    search = object.__new__(Stepwise)
    search.candidates = []
    monkeypatch.setattr(Stepwise, "_beside", lambda *_: None)
    tried = [
        candidate("joint_wobble", 180.0, 72.2, True),
        candidate("joint_wobble", 10.0, 1.0, False),
        candidate("moving_centre", 179.0, 72.1, True),
        candidate("moving_centre", 187.0, 10.0, True),
    ]
    monkeypatch.setattr(Stepwise, "_tried", lambda *_: tried)
    assert search.next(()) == 72.1


def test_a_faint_centre_is_named_where_the_test_sees_a_misfit_and_it_is_all_of_that() -> None:
    def drawn(size_m: float) -> MarkerNaming:
        return seen(travelling(lambda u: size_m * np.stack([u**2, 0 * u], axis=1)), 1, body=2)

    faint, fainter = drawn(0.88e-4), drawn(0.85e-4)
    assert faint.p_before < 0.003 < faint.p_after and places(faint) == {("moving_centre", None)}
    assert markers.SEEN <= faint.found[0].evidence < markers.EVIDENCE_LEAST
    assert fainter.p_before > 0.003 and not fainter.found  # as likely by chance


def test_a_centre_that_travels_and_a_joint_that_tilts_are_both_told() -> None:
    travel = travelling(lambda u: 0.3e-3 * np.stack([np.sin(np.pi * u), 1 - np.cos(np.pi * u)], axis=1))
    tilt = tilting(lambda u, way: 0.02 * np.sin(6 * np.pi * u))
    naming = seen(lambda share, turn, arm: travel(share, turn, arm) + tilt(share, turn, arm), body=2)
    assert naming.believed and places(naming) == {("moving_centre", None), ("joint_wobble", None)}


def test_what_a_wobble_shows_at_the_joints_beside_it_is_counted_with_it() -> None:
    naming = seen(tilting(lambda u, way: 0.012 * way), body=2)
    wobble = naming.found[0]
    beside = (wobble, replace(wobble, body=1, gain=0.1 * wobble.gain), replace(wobble, effect="moving_centre", body=1))
    assert _of_neighbours(replace(naming, found=beside), "joint_wobble", 1) == wobble.gain
    assert _of_neighbours(replace(naming, found=beside), "joint_wobble", 2) == pytest.approx(0.1 * wobble.gain)
