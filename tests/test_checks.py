"""Repeatability, mirror and parallelism: planted truths, coverage of the intervals, and no false alarms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from synthetic_hand import synthetic_hand

from hand_model.checks import (
    MIRROR,
    axis_difference,
    joint_covariance,
    mirror,
    parallelism,
    point_difference,
    reflected,
    repeatability,
)
from hand_model.errors import HandModelError
from hand_model.hand import Joint
from hand_model.rotation import rotation_from_vector, skew
from hand_model.twin.published import published_joint


def random_covariance(rng, size, scale):
    root = rng.normal(size=(size, size)) * scale
    return root @ root.T


def each_joint(hand, change):
    """The hand with every joint changed."""
    return replace(hand, fingers=tuple(replace(f, joints=tuple(change(j) for j in f.joints)) for f in hand.fingers))


def unit(v):
    return v / np.linalg.norm(v)


def test_the_same_hand_repeats_exactly():
    hand = synthetic_hand(3)
    for row in repeatability(hand, hand):
        assert row.angle.value == 0 and row.distance.value == 0 and not row.angle.real and row.angle.ci95[0] == 0
        assert row.angle.ci95[1] > 0 and row.angle.significance == pytest.approx(1)


def test_a_planted_turn_is_measured():
    hand = synthetic_hand(4)
    rng = np.random.default_rng(0)
    for angle in (1e-3, 0.05, 1.0):

        def turned(joint, angle=angle):
            axis = rotation_from_vector(angle * unit(np.cross(joint.axis_palm, rng.normal(size=3)))) @ joint.axis_palm
            return replace(joint, axis_palm=axis, centre_palm=joint.centre_palm + [0, 0.003, 0.004])

        for row in repeatability(hand, each_joint(hand, turned)):
            assert row.angle.value == pytest.approx(angle, rel=1e-9)
            assert row.distance.value == pytest.approx(5e-3, rel=1e-9)


def test_intervals_hold_the_truth_and_zero_raises_no_alarm():
    rng = np.random.default_rng(1)
    for truth in (0.0, 0.003, 0.03):
        covered, alarms, runs = 0, 0, 400
        covariance = np.diag([1.0, 4.0, 0.2]) * 1e-6
        for _ in range(runs):
            point = rng.multivariate_normal([truth, 0, 0], covariance)
            found = point_difference(np.zeros(3), point, covariance)
            covered += found.ci95[0] <= truth <= found.ci95[1]
            alarms += found.real
        assert covered / runs > 0.92, truth
        if truth == 0.0:
            assert alarms / runs < 0.03
        if truth == 0.03:
            assert alarms == runs


def test_axis_noise_raises_no_alarm():
    rng = np.random.default_rng(2)
    axis = unit(np.array([0.1, 1.0, -0.2]))
    across = np.eye(3) - np.outer(axis, axis)
    covariance = across @ random_covariance(rng, 3, 0.01) @ across
    runs, alarms, square = 400, 0, 0.0
    for _ in range(runs):
        seen = unit(axis + rng.multivariate_normal(np.zeros(3), covariance))
        found = axis_difference(axis, seen, covariance)
        alarms += found.real
        square += found.value**2
    assert alarms / runs < 0.03
    assert np.sqrt(square / runs) == pytest.approx(found.noise, rel=0.15)


def test_an_exact_mirror_image_is_found_to_be_one():
    left = synthetic_hand(5, "left")
    right = replace(each_joint(left, lambda j: reflected(j, MIRROR)), side="right")
    for rows in (mirror(left, right), mirror(right, left)):
        for row in rows:
            assert row.angle.value < 1e-12 and row.distance.value < 1e-12 and not row.angle.real


def test_a_mirrored_joint_moves_its_markers_to_the_mirror_image():
    """The axis is a pseudovector: turning by the same positive angle must commute with the reflection."""
    joint = synthetic_hand(6).fingers[2].joints[0]
    seen = reflected(joint, MIRROR)
    marker = next(iter(joint.markers_palm.values()))
    for angle in (0.3, 1.2):
        moved = joint.centre_palm + rotation_from_vector(angle * joint.axis_palm) @ (marker - joint.centre_palm)
        mirrored = seen.centre_palm + rotation_from_vector(angle * seen.axis_palm) @ (
            MIRROR @ marker - seen.centre_palm
        )
        np.testing.assert_allclose(mirrored, MIRROR @ moved, atol=1e-15)


def test_the_published_hands_are_mirror_images_within_what_the_thesis_says():
    """Sign conventions: the published left and right axes differ by a few degrees when reflected, not by 180."""
    hands = {}
    for side in ("left", "right"):
        hand = synthetic_hand(7, side, fingers=("index", "middle", "ring", "little", "thumb_0", "thumb_1"))

        def published(finger, side=side):
            axes, centres = published_joint(side, finger.name)
            joints = [
                replace(j, name=n, axis_palm=a, centre_palm=c)
                for j, n, a, c in zip(finger.joints, ("proximal", "distal"), axes, centres, strict=True)
            ]
            return replace(finger, joints=tuple(joints), couplings=())

        hands[side] = replace(hand, fingers=tuple(published(f) for f in hand.fingers))
    for row in mirror(hands["left"], hands["right"]):
        assert np.rad2deg(row.angle.value) < 12 and row.distance.value < 0.02
        assert row.published_deg == pytest.approx(np.rad2deg(row.angle.value), abs=1e-9)
    for row in (*parallelism(hands["left"]), *parallelism(hands["right"])):
        # Three published digits per component: the angle between the published axes is known to about 0.1 deg.
        assert row.published_deg == pytest.approx(np.rad2deg(row.angle.value), abs=0.1), row.finger


def test_angles_do_not_depend_on_the_frame():
    hand = synthetic_hand(8)
    turn = rotation_from_vector([0.4, -1.0, 2.0])
    both = np.kron(np.eye(2), turn)
    rng = np.random.default_rng(3)
    hand = each_joint(hand, lambda j: replace(j, covariance=random_covariance(rng, 6, 1e-3)))
    turned = each_joint(
        hand, lambda j: replace(j, axis_palm=turn @ j.axis_palm, covariance=both @ j.covariance @ both.T)
    )
    for a, b in zip(parallelism(hand), parallelism(turned), strict=True):
        assert a.angle.value == pytest.approx(b.angle.value, abs=1e-12)
        assert a.angle.noise == pytest.approx(b.angle.noise, rel=1e-9)
        np.testing.assert_allclose(a.angle.ci95, b.angle.ci95, atol=1e-9)


def test_the_palm_frames_own_uncertainty_is_taken_out():
    """By construction: frame noise turns axis and centre of every joint together and leaves angles between them
    alone.
    """
    rng = np.random.default_rng(4)
    frame = random_covariance(rng, 6, 1e-2)
    own = random_covariance(rng, 6, 1e-4)

    def with_frame(joint: Joint) -> Joint:
        by_frame = np.block([[skew(joint.axis_palm), np.zeros((3, 3))], [skew(joint.centre_palm), -np.eye(3)]])
        return replace(joint, covariance=own + by_frame @ frame @ by_frame.T)

    plain = each_joint(synthetic_hand(9), lambda j: replace(j, covariance=own))
    hand = replace(each_joint(plain, with_frame), extra={"frame_covariance": frame.tolist()})
    for finger in hand.fingers:
        for joint in finger.joints:
            np.testing.assert_allclose(joint_covariance(hand, joint), own, atol=1e-12)
    for a, b in zip(parallelism(hand), parallelism(plain), strict=True):
        assert a.angle.noise == pytest.approx(b.angle.noise, rel=1e-6)


def test_hands_that_cannot_be_compared():
    left, right = synthetic_hand(1, "left"), synthetic_hand(1, "right")
    with pytest.raises(HandModelError, match="two sessions of one hand"):
        repeatability(left, right)
    with pytest.raises(HandModelError, match="a left and a right hand"):
        mirror(left, left)
    with pytest.raises(HandModelError, match="share no finger"):
        repeatability(left, synthetic_hand(1, "left", fingers=("other",)))
