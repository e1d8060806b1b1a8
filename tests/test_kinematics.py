"""Forward kinematics against independent formulas, finite differences and symmetries."""

import dataclasses

import numpy as np
import pytest
from scipy.linalg import expm
from synthetic_hand import synthetic_hand

from hand_model.errors import HandModelError
from hand_model.kinematics import displace, finger_angles, hand_points, joint_keys
from hand_model.rotation import rotation_from_vector, skew


@pytest.mark.parametrize("joints", [1, 2, 3])
def test_displacement_is_the_product_of_exponentials(joints):
    finger = synthetic_hand(joints, joints=joints).fingers[2]
    angles = np.random.default_rng(0).uniform(-3, 3, (5, joints))
    motion = displace(finger, angles)
    for pose, row in enumerate(angles):
        transform = np.eye(4)
        for i, (joint, angle) in enumerate(zip(finger.joints, row, strict=True)):
            twist = np.zeros((4, 4))
            twist[:3, :3], twist[:3, 3] = skew(joint.axis_palm), -np.cross(joint.axis_palm, joint.centre_palm)
            transform = transform @ expm(twist * angle)
            assert np.allclose(motion.rotation[pose, i], transform[:3, :3], atol=1e-13)
            assert np.allclose(motion.translation[pose, i], transform[:3, 3], atol=1e-13)


@pytest.mark.parametrize("joints", [1, 2, 3])
def test_jacobians_by_finite_differences(joints):
    finger = synthetic_hand(10 + joints, joints=joints).fingers[0]
    random = np.random.default_rng(1)
    angles, points, step = random.uniform(-2, 2, (4, joints)), random.normal(0, 0.05, (6, 3)), 1e-6
    motion = displace(finger, angles)
    for segment in range(joints):
        jacobian, turning = motion.point_jacobian(segment, points), motion.rotation_jacobian(segment)
        for j in range(joints):
            ahead, behind = (displace(finger, angles + s * step * np.eye(joints)[j]) for s in (1, -1))
            numeric = (ahead.points(segment, points) - behind.points(segment, points)) / (2 * step)
            assert np.allclose(jacobian[..., j], numeric, atol=1e-9)
            spin = (
                (ahead.rotation[:, segment] - behind.rotation[:, segment])
                / (2 * step)
                @ motion.rotation[:, segment].swapaxes(-1, -2)
            )
            assert np.allclose(skew(turning[..., j]), spin, atol=1e-9)


def test_rest_is_where_the_hand_was_recorded():
    hand = synthetic_hand(3)
    markers, tips = hand_points(hand, np.zeros(len(joint_keys(hand))))
    for finger in hand.fingers:
        for joint in finger.joints:
            for label, rest in joint.markers_palm.items():
                assert np.allclose(markers[finger.name, label][0], rest, atol=1e-15)
        assert np.allclose(tips[finger.name][0], finger.joints[-1].tip_palm, atol=1e-15)


def test_a_change_of_frame_moves_every_point_with_it():
    hand, turn, shift = synthetic_hand(4), rotation_from_vector([0.3, -1.1, 0.7]), np.array([0.1, -0.2, 0.05])

    def moved(finger):
        joints = tuple(
            dataclasses.replace(
                j,
                axis_palm=turn @ j.axis_palm,
                centre_palm=turn @ j.centre_palm + shift,
                markers_palm={k: turn @ p + shift for k, p in j.markers_palm.items()},
                tip_palm=None if j.tip_palm is None else turn @ j.tip_palm + shift,
            )
            for j in finger.joints
        )
        return dataclasses.replace(finger, joints=joints)

    other = dataclasses.replace(hand, fingers=tuple(moved(f) for f in hand.fingers))
    angles = np.random.default_rng(2).uniform(-1, 1, (7, len(joint_keys(hand))))
    (markers, tips), (markers_moved, tips_moved) = hand_points(hand, angles), hand_points(other, angles)
    assert all(np.allclose(markers_moved[k], p @ turn.T + shift, atol=1e-13) for k, p in markers.items())
    assert all(np.allclose(tips_moved[k], p @ turn.T + shift, atol=1e-13) for k, p in tips.items())


def test_couplings_are_followed_along_the_chain():
    finger = synthetic_hand(5, joints=3).fingers[2]
    driver = np.linspace(0, 1, 11)
    angles = finger_angles(finger, {"s0": driver})
    assert np.array_equal(angles[:, 1], finger.couplings[0].follower_rad(driver))
    assert np.array_equal(angles[:, 2], finger.couplings[1].follower_rad(angles[:, 1]))


def test_bad_input_is_refused():
    finger = synthetic_hand(6).fingers[0]
    with pytest.raises(HandModelError, match="2 joints"):
        displace(finger, np.zeros((4, 3)))
    lengthless = dataclasses.replace(finger.joints[0], axis_palm=np.zeros(3))
    with pytest.raises(HandModelError, match="length above zero"):
        displace(dataclasses.replace(finger, joints=(lengthless, finger.joints[1])), np.zeros((1, 2)))
    loop = tuple(
        dataclasses.replace(finger.couplings[0], driver=a, follower=b) for a, b in (("s0", "s1"), ("s1", "s0"))
    )
    with pytest.raises(HandModelError, match="circle"):
        finger_angles(dataclasses.replace(finger, couplings=loop), {})
