"""The chain of a finger: derivatives, recovery of a planted truth, gauge, frames, and the dirt of a recording."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from chain_data import BODY, LABELS, PALM, finger_chain, recording

from hand_model.errors import IdentificationError
from hand_model.identify import finger
from hand_model.identify.axis import dominant_axis, gamage_lasenby_axis
from hand_model.identify.bootstrap import variance_inflation
from hand_model.identify.centre import project_on_line, sphere_centre
from hand_model.identify.chain import Chain, Pose, jacobians, palm_pose, propagate
from hand_model.identify.hinge import block_inflation, hinge_note
from hand_model.identify.likelihood import angle_noise_ratio, fit_chain, fit_poses
from hand_model.identify.repair import find_slip, repair_labels, split_marker
from hand_model.identify.start import cluster_shape, start_chain
from hand_model.rotation import angle_between, kabsch, rotation_about, rotation_from_vector

REST = np.arange(100)


def fitted(data):
    return fit_chain(data, start_chain(data, REST, PALM))


def axis_error_deg(fit, chain):
    first = [fit.data.labels.index(label) for label in LABELS[:3]]
    rotation, _ = kabsch(fit.chain.marker_palm[first], chain.marker_palm[:3])
    return np.rad2deg(angle_between(fit.chain.axis_palm @ rotation.T, chain.axis_palm, undirected=True))


def test_jacobians_are_the_derivatives():
    rng = np.random.default_rng(0)
    chain, angle = finger_chain(1), rng.uniform(-1, 2, (4, 2))
    x, by_frame, by_marker, by_joint = jacobians(chain, BODY, angle)
    pose = Pose(np.tile(np.eye(3), (4, 1, 1)), np.zeros((4, 3)), angle)
    for i in range(8):
        step = np.zeros((4, 8))
        step[:, i] = 1e-6
        ahead, behind = pose.moved(step), pose.moved(-step)
        moved = ahead.to_world(propagate(chain, BODY, ahead.angle_rad)[0]) - behind.to_world(
            propagate(chain, BODY, behind.angle_rad)[0]
        )
        np.testing.assert_allclose(by_frame[..., i], moved / 2e-6, atol=1e-8)
    for i in range(chain.size):
        step = np.zeros(chain.size)
        step[i] = 1e-6
        moved = (propagate(chain.moved(step), BODY, angle)[0] - propagate(chain.moved(-step), BODY, angle)[0]) / 2e-6
        marker, joint = divmod(i, 3), i - 27
        if i < 27:
            expected = np.zeros_like(x)
            expected[:, marker[0]] = by_marker[:, marker[0], :, marker[1]]
        else:
            expected = by_joint[..., joint]
        np.testing.assert_allclose(expected, moved, atol=1e-8)


def test_another_rest_is_the_same_mechanism():
    chain, rng = finger_chain(2), np.random.default_rng(3)
    zero, angle = np.array([0.4, -0.3]), rng.uniform(-1, 1, (5, 2))
    moved = chain.at(zero, BODY)
    np.testing.assert_allclose(propagate(moved, BODY, angle - zero)[0], propagate(chain, BODY, angle)[0], atol=1e-14)


def test_noise_free_recording_is_recovered_exactly():
    chain, data, angle = recording(4, noise_m=0.0)
    fit = fitted(data)
    assert axis_error_deg(fit, chain).max() < 1e-6
    np.testing.assert_allclose(np.ptp(fit.pose.angle_rad, axis=0), np.ptp(angle, axis=0), atol=1e-8)


def test_error_keeps_to_the_cramer_rao_bound():
    """Squared errors over the variances that the information matrix promises: one on average, whatever the
    direction."""
    square = []
    for seed in range(16):
        chain, data, _ = recording(seed, n=600)
        fit = fitted(data)
        rotation, _ = kabsch(fit.chain.marker_palm[:3], chain.marker_palm[:3])
        for k in range(2):
            block = slice(27 + 4 * k, 29 + 4 * k)
            off = fit.chain.tangent[k] @ (rotation.T @ chain.axis_palm[k] - fit.chain.axis_palm[k])
            square.append(off @ np.linalg.solve(fit.covariance[block, block], off) / 2)
        assert fit.noise_m == pytest.approx(2e-4, rel=0.03)
    assert 0.5 < np.mean(square) < 1.25**2


def test_world_frame_does_not_matter():
    _, data, _ = recording(5)
    turn, shift = rotation_from_vector(np.array([0.4, -1.2, 0.7])), np.array([3.0, -2.0, 0.5])
    first, second = fitted(data), fitted(replace(data, position_world=data.position_world @ turn.T + shift))
    assert np.rad2deg(angle_between(first.chain.axis_palm, second.chain.axis_palm)).max() < 2e-3
    np.testing.assert_allclose(first.noise_m, second.noise_m, rtol=1e-3)


def test_mirrored_recording_gives_the_mirrored_chain():
    _, data, _ = recording(6)
    mirror = np.array([1.0, -1.0, 1.0])
    first = fitted(data)
    mirrored = replace(data, position_world=data.position_world * mirror)
    second = fit_chain(mirrored, start_chain(mirrored, REST, PALM * mirror))
    axis = -second.chain.axis_palm * mirror  # an axis is a pseudovector
    assert np.rad2deg(angle_between(first.chain.axis_palm, axis, undirected=True)).max() < 2e-3


def test_ghosts_gaps_and_hidden_palm_markers_do_no_harm():
    chain, data, _ = recording(7)
    rng = np.random.default_rng(8)
    y = data.position_world.copy()
    for marker in range(9):
        y[rng.integers(0, 1500, 20), marker] += rng.normal(0, 0.03, (20, 3))
        start = rng.integers(100, 1400)
        y[start : start + 25, marker] = np.nan
    clean, dirty = fitted(data), fitted(replace(data, position_world=y))
    assert axis_error_deg(dirty, chain).max() < 2 * axis_error_deg(clean, chain).max() + 0.05
    assert dirty.noise_m == pytest.approx(2e-4, rel=0.05)


@pytest.mark.parametrize("pair", [(3, 4), (4, 7), (0, 6)])
def test_exchanged_labels_are_put_right(pair):
    _, data, _ = recording(9)
    y = data.position_world.copy()
    y[400:520, list(pair)] = y[400:520, list(reversed(pair))]
    repaired, swaps = repair_labels(replace(data, position_world=y))
    np.testing.assert_array_equal(repaired.position_world, data.position_world)
    assert [(set(s.labels), s.start, s.stop) for s in swaps] == [({data.labels[i] for i in pair}, 400, 519)]


def test_labels_that_return_behind_a_gap_are_not_held_to_be_exchanged_for_good() -> None:
    _, data, _ = recording(5)
    pair, y = [3, 4], data.position_world.copy()
    y[400:430, pair] = y[400:430, pair[::-1]]
    y[415:445, pair] = np.nan  # neither is seen while they return
    y[900:, pair[0]] += [2e-3, 1e-3, 0.0]  # and a slip keeps the cluster out of shape from here on
    repaired, swaps = repair_labels(replace(data, position_world=y))
    assert all(s.stop < 445 for s in swaps)
    np.testing.assert_array_equal(repaired.position_world[445:], y[445:])


def test_sound_labels_are_left_alone():
    _, data, _ = recording(10, noise_m=4e-4)
    repaired, swaps = repair_labels(data)
    assert swaps == ()
    np.testing.assert_array_equal(repaired.position_world, data.position_world)


@pytest.mark.parametrize("marker", [1, 4, 8])
def test_a_slip_is_found_where_and_when_it_happened(marker):
    chain, data, angle = recording(11)
    moved = np.tile(chain.marker_palm, (1, 1))
    moved[marker] += np.array([0.0009, -0.0007, 0.0008])
    turned = propagate(replace(chain, marker_palm=moved), BODY, angle)[0] - propagate(chain, BODY, angle)[0]
    pose = palm_pose(chain, data)
    y = data.position_world.copy()
    y[800:, marker] += np.einsum("nij,nj->ni", pose.rotation, turned[:, marker])[800:]
    fit = fitted(replace(data, position_world=y))
    slip = find_slip(fit)
    assert slip is not None and slip.label == data.labels[marker] and abs(slip.frame - 800) < 60
    split = split_marker(fit.data, slip)
    start = np.insert(fit.chain.marker_palm, marker + 1, fit.chain.marker_palm[marker], axis=0)
    again = fit_chain(split, Chain(start, fit.chain.axis_palm, fit.chain.centre_palm))
    assert axis_error_deg(again, chain).max() < 0.3 and again.noise_m == pytest.approx(2e-4, rel=0.05)


def test_no_slip_is_found_where_there_is_none():
    for seed in range(4):
        assert find_slip(fitted(recording(20 + seed)[1])) is None


@pytest.mark.slow
def test_short_arcs_admit_that_they_are_short():
    long = fitted(recording(12)[1])
    short = fitted(recording(12, arcs_deg=(6, 4), noise_m=4e-4)[1])
    assert (angle_noise_ratio(long) < 0.05).all() and (angle_noise_ratio(short) > 0.12).all()
    np.testing.assert_array_equal(variance_inflation(long), 1.0)
    assert (variance_inflation(short) >= 1.0).all()


def test_poses_of_a_known_chain():
    chain, data, angle = recording(13, noise_m=1e-4)
    pose, weight = fit_poses(data, chain, 1e-4)
    assert (weight > 0.99).mean() > 0.995
    assert np.rad2deg(np.std(pose.angle_rad - angle, axis=0)).max() < 0.7


def test_published_methods_are_exact_without_noise():
    rng = np.random.default_rng(14)
    axis, centre = np.array([0.2, 0.95, -0.24]), np.array([0.03, -0.02, 0.01])
    axis /= np.linalg.norm(axis)
    markers = centre + rng.normal(0, 0.02, (3, 3))
    turned = centre + np.einsum("nij,mj->nmi", rotation_about(axis, np.linspace(0, 1.2, 60)), markers - centre)
    assert angle_between(gamage_lasenby_axis(turned), axis, undirected=True) < 1e-7
    tilt = rotation_from_vector(np.array([0.1, 0.0, -0.1])) @ axis
    found_axis, found_centre = dominant_axis(turned, tilt, centre + 0.003)
    assert angle_between(found_axis, axis) < 1e-5
    assert np.linalg.norm(np.cross(found_centre - centre, axis)) < 1e-6


def test_sphere_centre_of_a_ball_joint_and_projection():
    rng = np.random.default_rng(15)
    centre = np.array([0.04, 0.01, -0.03])
    turns = rotation_from_vector(rng.normal(0, 0.4, (200, 3)))
    markers = np.einsum("nij,mj->nmi", turns, rng.normal(0, 0.03, (4, 3))) + centre
    np.testing.assert_allclose(sphere_centre(markers), centre, atol=1e-9)
    np.testing.assert_allclose(project_on_line([1, 2, 3], [0, 0, 1], [5, 6, 7]), [5, 6, 3])


def test_cluster_shape_is_robust_and_rigid():
    rng = np.random.default_rng(16)
    shape = rng.normal(0, 0.02, (3, 3))
    frames = np.einsum("nij,mj->nmi", rotation_from_vector(rng.normal(0, 1, (300, 3))), shape) + rng.normal(
        0, 1, (300, 1, 3)
    )
    frames += rng.normal(0, 1e-4, frames.shape)
    frames[:30, 1] += 0.05
    found = cluster_shape(frames)
    sides = np.linalg.norm(found[:, None] - found, axis=-1) - np.linalg.norm(shape[:, None] - shape, axis=-1)
    assert np.abs(sides).max() < 1e-4
    with pytest.raises(IdentificationError, match="no frame shows all"):
        cluster_shape(np.full((5, 3, 3), np.nan))


def test_a_hinge_is_called_a_hinge_and_a_wobble_is_not():
    chain, data, angle = recording(17)
    fit = fitted(data)
    assert [hinge_note(fit, k) for k in range(2)] == ["", ""]
    assert block_inflation(fit) < 1.3
    wobble = np.einsum("nij,mj->nmi", rotation_from_vector(0.03 * np.sin(3 * angle[:, :1]) * [1.0, 0, 0]), np.eye(3))
    pose = palm_pose(chain, data)
    in_palm = pose.to_palm(data.position_world)
    in_palm[:, BODY > 0] = chain.centre_palm[0] + (in_palm[:, BODY > 0] - chain.centre_palm[0]) @ np.swapaxes(
        wobble, 1, 2
    ).transpose(0, 2, 1)
    moved = fitted(replace(data, position_world=pose.to_world(in_palm)))
    assert "no plain hinge" in hinge_note(moved, 0)
    assert block_inflation(moved) > 2


@pytest.mark.parametrize(("settles", "slips"), [(True, 1), (False, 0)])
def test_no_marker_is_split_where_the_chain_settles_neither_with_the_slip_nor_without(
    monkeypatch, settles: bool, slips: int
) -> None:
    _, data, _ = recording(11)
    y = data.position_world.copy()
    y[800:, 4] += np.array([0.0009, -0.0007, 0.0008])
    fit = replace(fitted(replace(data, position_world=y)), converged=False)
    calls = []

    def settling(*arguments):
        calls.append(arguments)
        return replace(fit_chain(*arguments), converged=settles)

    monkeypatch.setattr(finger, "fit_chain", settling)
    again, found = finger._fit_with_slips(fit)
    assert len(found) == slips and (again is fit) is not settles and (settles or len(calls) <= 2)


def test_a_marker_that_was_left_out_before_makes_no_other_seem_loose() -> None:
    _, data, _ = recording(11)
    fit = fitted(data)
    residual = fit.residual_palm.copy()
    residual[:, 6] = np.nan
    fit = replace(fit, residual_palm=residual)
    assert finger._without_loose(fit, (3, 4)) is fit
