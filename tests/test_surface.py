"""Probed surfaces: known shapes swept with noise come back, defects are repaired, what is open or too little is
said."""

import dataclasses

import mujoco
import numpy as np
import pytest
import trimesh

from hand_model import twin
from hand_model.check import check
from hand_model.compile import compile
from hand_model.compile.surface import Surface as Compiled
from hand_model.errors import IdentificationError, MissingDependencyError
from hand_model.hand import Coupling, Finger, Hand, Joint
from hand_model.identify.probe import calibrated_probe
from hand_model.identify.surface import distance_to_mesh, identify_surfaces, with_surfaces
from hand_model.identify.surface.mend import mended, rims
from hand_model.identify.surface.refine import refined
from hand_model.identify.surface.solid import CLOSED, HULL, LID, closed, convex_parts, hull, volume
from hand_model.identify.surface.sweep import displacement, resampled
from hand_model.identify.surface.triangulate import HEIGHT_FIELD, carved, has_open3d, triangulated
from hand_model.rotation import kabsch, rotation_from_vector
from hand_model.session import read_session

RADII = np.array([0.03, 0.009, 0.0095])
METHODS = [False, pytest.param(True, marks=pytest.mark.skipif(not has_open3d(), reason="Open3D is not installed"))]


def _swept_ellipsoid(low, high, noise_m=4e-4, seed=3, n=3500, turns=20):
    """Zig-zag of a probe over an ellipsoid, from one angle about its long axis to another; its shaft stands off the
    surface."""
    random, t = np.random.default_rng(seed), np.linspace(0, 1, n)
    along = 0.97 * (2 * t - 1)
    ring, angle = np.sqrt(1 - along**2), low + (high - low) * (0.5 - 0.5 * np.cos(2 * np.pi * turns * t))
    sphere = np.stack([along, ring * np.cos(angle), ring * np.sin(angle)], axis=1)
    shaft = sphere / RADII + 20 * random.normal(size=3)
    points = sphere * RADII + noise_m * random.normal(size=sphere.shape)
    return points, shaft / np.linalg.norm(shaft, axis=1, keepdims=True)


def _solid(tip, shaft, pivoting, voxel_m=0.005):
    cloud = resampled(tip, shaft, voxel_m)
    faces, method = triangulated(cloud.points_palm, cloud.normals, voxel_m, pivoting)
    vertices, faces, normals, _ = mended(cloud.points_palm, faces, cloud.normals)
    vertices, faces = refined(vertices, faces, normals)
    return *closed(vertices, faces, cloud.points_palm, voxel_m), method


@pytest.mark.parametrize("pivoting", METHODS)
def test_a_surface_swept_all_round_comes_back_closed(pivoting):
    tip, shaft = _swept_ellipsoid(0, 2 * np.pi)
    vertices, faces, how, _ = _solid(tip, shaft, pivoting)
    assert how == CLOSED and Compiled(vertices, faces).watertight and trimesh.Trimesh(vertices, faces).is_watertight
    assert volume(vertices, faces) == pytest.approx(4 / 3 * np.pi * RADII.prod(), rel=0.12)
    off = np.abs(np.linalg.norm(vertices / RADII, axis=1) - 1) * RADII.min()
    assert np.median(off) < 3e-4  # below the noise of one tip


@pytest.mark.parametrize("pivoting", METHODS)
def test_half_a_finger_is_closed_behind_and_keeps_the_side_that_was_swept(pivoting):
    tip, shaft = _swept_ellipsoid(0, np.pi)
    vertices, faces, how, _ = _solid(tip, shaft, pivoting)
    assert how.startswith(LID) and Compiled(vertices, faces).watertight
    assert volume(vertices, faces) == pytest.approx(2 / 3 * np.pi * RADII.prod(), rel=0.3)  # a rim loses half a voxel
    assert np.median(distance_to_mesh(tip, vertices, faces)) < 6e-4


@pytest.mark.parametrize("pivoting", METHODS)
def test_a_hollow_palm_becomes_a_shell_behind_the_swept_side(pivoting):
    t, random = np.linspace(0, 1, 5000), np.random.default_rng(1)
    x, y = 0.04 * (2 * t - 1), 0.035 * np.cos(40 * np.pi * t)
    tip = np.stack([x, y, 6 * (x**2 + y**2)], axis=1) + 3e-4 * random.normal(size=(5000, 3))
    vertices, faces, how, method = _solid(tip, np.tile([0.0, 0.0, 1.0], (5000, 1)), pivoting)
    assert "shell of 2 mm" in how and Compiled(vertices, faces).watertight
    assert pivoting or method == HEIGHT_FIELD
    below = vertices[len(vertices) // 2 :]
    assert (below[:, 2] < 6 * (below[:, :2] ** 2).sum(1) - 5e-4).mean() > 0.9
    parts, _ = convex_parts(vertices, faces, 0.005)
    for corners, triangles in parts:
        assert trimesh.Trimesh(corners, triangles).is_convex


def test_outliers_and_the_way_to_the_segment_are_dropped():
    tip, shaft = _swept_ellipsoid(0, 2 * np.pi)
    random = np.random.default_rng(5)
    way = np.linspace([0.1, 0.05, 0.12], tip[0], 200) + 2e-4 * random.normal(size=(200, 3))
    spikes = tip[::100] + 0.015 * random.normal(size=tip[::100].shape)
    dirty, shafts = np.concatenate([way, tip, spikes]), np.concatenate([shaft[:200], shaft, shaft[::100]])
    vertices, _, how, _ = _solid(dirty, shafts, False)
    assert how == CLOSED
    assert np.abs(vertices).max(0) == pytest.approx(RADII, abs=3e-3)


def test_smaller_voxels_follow_the_surface_more_closely():
    tip, shaft = _swept_ellipsoid(0, 2 * np.pi, noise_m=5e-5, n=9000, turns=60)
    volumes = [volume(*_solid(tip, shaft, False, voxel)[:2]) for voxel in (0.006, 0.003)]
    true = 4 / 3 * np.pi * RADII.prod()
    assert abs(volumes[1] - true) < abs(volumes[0] - true)


def test_too_few_points_are_an_error_that_says_so():
    tip, shaft = _swept_ellipsoid(0, np.pi)
    with pytest.raises(IdentificationError, match="too few for a surface"):
        resampled(tip[:80], shaft[:80], 0.005)
    with pytest.raises(IdentificationError, match="above zero"):
        resampled(tip, shaft, 0.0)


@pytest.mark.parametrize("defect", ["flipped", "doubled", "fin", "holes", "crumb"])
def test_planted_defects_are_repaired(defect):
    ball = trimesh.creation.icosphere(subdivisions=2, radius=0.02)
    vertices, faces, normals = np.array(ball.vertices), np.array(ball.faces), np.array(ball.vertex_normals)
    random = np.random.default_rng(0)
    if defect == "flipped":
        chosen = random.choice(len(faces), 60, replace=False)
        faces[chosen] = faces[chosen][:, ::-1]
    elif defect == "doubled":
        faces = np.concatenate([faces, faces[:20], faces[20:40, ::-1]])
    elif defect == "fin":  # a face that stands out of the surface on one of its edges
        vertices, normals = np.concatenate([vertices, [[0.0, 0.0, 0.05]]]), np.concatenate([normals, [[0.0, 0.0, 1.0]]])
        faces = np.concatenate([faces, [[faces[0, 0], faces[0, 1], len(vertices) - 1]]])
    elif defect == "holes":
        touched = (faces == 5).any(1) | (faces == 17).any(1) | (np.arange(len(faces)) == 200)
        faces = faces[~touched]
    else:
        far = trimesh.creation.box((0.001, 0.001, 0.001)).apply_translation([0.1, 0, 0])
        faces = np.concatenate([faces, np.array(far.faces) + len(vertices)])
        vertices, normals = np.concatenate([vertices, far.vertices]), np.concatenate([normals, far.vertex_normals])
    whole, outside, _, counts = mended(vertices, faces, normals)
    assert rims(outside) == [] and Compiled(whole, outside).watertight
    assert volume(whole, outside) == pytest.approx(ball.volume, rel=0.02)
    assert sum(counts.values()) > 0


def test_a_carved_cloud_of_two_touching_balls_does_not_touch_itself():
    random = np.random.default_rng(2)
    balls = random.normal(size=(2, 400, 3))
    points = 0.02 * balls / np.linalg.norm(balls, axis=2, keepdims=True)
    points = np.concatenate([points[0], points[1] + [0.0405, 0.0, 0.0]])
    faces = carved(points, 0.006)
    edges = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    assert set(np.unique(edges, axis=0, return_counts=True)[1]) == {2}
    assert volume(points, faces) > 2 * 4 / 3 * np.pi * 0.019**3


def test_refined_triangles_follow_a_ball_and_stay_closed():
    ball = trimesh.creation.icosphere(subdivisions=1, radius=0.02)
    vertices, faces = refined(np.array(ball.vertices), np.array(ball.faces), np.array(ball.vertices) / 0.02)
    assert Compiled(vertices, faces).watertight and len(faces) == 4 * len(ball.faces)
    assert np.abs(np.linalg.norm(vertices, axis=1) - 0.02).max() < 1e-4  # flat, the middles are 1 mm below
    flat = np.array([[0.0, 0, 0], [0.01, 0, 0], [0, 0.01, 0]]), np.array([[0, 1, 2]])
    assert np.all(refined(*flat, np.tile([0.0, 0.0, 1.0], (3, 1)))[0][:, 2] == 0)


@pytest.mark.parametrize("subdivisions", [0, 1, 3])
def test_distances_from_a_mesh_are_those_of_trimesh(subdivisions):
    ball = trimesh.creation.icosphere(subdivisions=subdivisions, radius=0.02).apply_scale([1.0, 0.2, 2.0])
    points = np.random.default_rng(0).normal(0, 0.03, (200, 3))
    nearest, _, _ = trimesh.proximity.closest_point_naive(ball, points)
    found = distance_to_mesh(points, np.array(ball.vertices), np.array(ball.faces))
    assert found == pytest.approx(np.linalg.norm(points - nearest, axis=1), abs=1e-12)


def test_hull_of_few_corners_stays_inside_and_keeps_most_of_the_volume():
    ball = np.random.default_rng(0).normal(size=(3000, 3))
    points = ball / np.linalg.norm(ball, axis=1, keepdims=True) * RADII
    corners, faces = hull(points, 64)
    assert len(corners) <= 64 and Compiled(corners, faces).watertight
    assert 0.85 < volume(corners, faces) / (4 / 3 * np.pi * RADII.prod()) < 1


def test_points_without_triangles_become_their_hull():
    points = np.random.default_rng(0).normal(0, 0.01, (50, 3))
    vertices, faces, normals, _ = mended(points, np.zeros((0, 3), np.int64), np.tile([0.0, 0.0, 1.0], (50, 1)))
    vertices, faces = refined(vertices, faces, normals)
    vertices, faces, how = closed(vertices, faces, points, 0.005)
    assert how == HULL and Compiled(vertices, faces).watertight


@pytest.mark.skipif(has_open3d(), reason="Open3D is installed")
def test_ball_pivoting_without_open3d_says_what_to_install():
    points = np.random.default_rng(0).normal(0, 0.01, (50, 3))
    with pytest.raises(MissingDependencyError, match=r"hand_model\[surface\]"):
        triangulated(points, points, 0.005, pivoting=True)


class _Seen:
    """A recording of still markers, as far as a sweep looks at one."""

    segment = "index/proximal"

    def __init__(self, markers):
        self.labels, self._markers = tuple(markers), markers

    def mocap(self):
        return self

    def markers(self, labels):
        return np.repeat(np.stack([self._markers[label] for label in labels])[None], 5, axis=0)


def test_a_finger_that_the_probe_pushed_is_followed_by_its_markers(recorded):
    truth, session = recorded
    hand, turn, move = _known(truth), rotation_from_vector([0.05, -0.2, 0.1]), np.array([0.001, -0.002, 0.003])
    rest, palm = truth.finger("index").joints[0].markers_palm, truth.palm_markers_palm
    shape = np.stack([palm[label] for label in session.palm.labels])
    lab, away = rotation_from_vector([1.0, 0.4, -0.7]), np.array([0.3, 0.1, 1.2])  # of the palm in the room
    pushed = {label: turn @ p + move for label, p in rest.items()}
    seen = _Seen({label: lab @ p + away for label, p in {**palm, **pushed}.items()})
    found = displacement(seen, session, hand, shape)
    assert np.allclose(found[0], turn, atol=1e-9) and np.allclose(found[1], move, atol=1e-9)
    unseen = displacement(_Seen({label: lab @ p + away for label, p in palm.items()}), session, hand, shape)
    assert np.all(unseen[0] == np.eye(3)) and np.all(unseen[1] == 0)


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    truth = twin.bebionic("left", 6, ["index", "ring"])
    folder = tmp_path_factory.mktemp("swept") / "session"
    twin.record(truth, folder, 6, (), twin.Plan(surfaces=("all",), flexion=("full",), validation=(), excitations=0))
    return truth, read_session(folder)


def _known(truth):
    """The hand as it is, so that a surface's errors are its own."""
    fingers = tuple(
        Finger(
            f.name,
            f.actuator,
            tuple(
                Joint(j.name, j.axis_palm, j.centre_palm, 1e-8 * np.eye(6), (0.0, 1.2), j.markers_palm)
                for j in f.joints
            ),
            (),
            (Coupling("proximal", "distal", np.array(f.distal_rad), {}, {}),),
        )
        for f in truth.fingers
    )
    return Hand("swept", truth.side, truth.palm_markers_palm, truth.landmarks_palm, fingers, 1e-4, {})


def test_sweeps_of_the_twin_give_its_ellipsoids_in_the_palm_frame(recorded):
    truth, session = recorded
    found = {s.segment: s for s in identify_surfaces(session, _known(truth), pivoting=False)}
    assert set(found) == {s.segment for s in truth.surfaces}
    for true in truth.surfaces:
        surface = found[true.segment]
        local = (surface.vertices - true.centre_palm) @ true.axes_palm.T
        off = np.abs(np.linalg.norm(local / true.radii_m, axis=1) - 1) * true.radii_m.min()
        assert np.median(off) < 4e-4, true.segment
        assert volume(surface.vertices, surface.faces) == pytest.approx(4 / 3 * np.pi * true.radii_m.prod(), rel=0.1)
        assert dict(surface.error)["median_mm"] < 4 * 1e3 * truth.mocap.noise_m + 1
        assert surface.notes == ()


def test_surfaces_arrive_in_the_compiled_hand(recorded, tmp_path):
    truth, session = recorded
    hand = with_surfaces(_known(truth), identify_surfaces(session, _known(truth), pivoting=False))
    hand.save(tmp_path / "swept.hand")
    description = compile(hand, tmp_path / "out")
    assert [f.sentence for f in check(description.folder) if not f.passed] == []
    model = mujoco.MjModel.from_xml_path(str(description.mjcf))
    true = next(s for s in truth.surfaces if s.segment == "palm")
    assert model.body("palm").mass[0] == pytest.approx(1100 * 4 / 3 * np.pi * true.radii_m.prod(), rel=0.05)
    assert np.allclose(model.body("palm").ipos, true.centre_palm, atol=1e-3)
    of_palm = [
        i for i in range(model.ngeom) if model.geom_bodyid[i] == model.body("palm").id and model.geom_group[i] == 3
    ]
    assert {int(model.geom_type[i]) for i in of_palm} == {int(mujoco.mjtGeom.mjGEOM_MESH)}


def test_parts_that_would_touch_give_way_to_capsules_with_a_note(recorded, tmp_path):
    truth, session = recorded
    hand = with_surfaces(_known(truth), identify_surfaces(session, _known(truth), pivoting=False))
    surfaces = {name: dict(table) for name, table in hand.extra["surfaces"].items()}
    probed = np.array(surfaces["index/proximal"]["vertices"])
    # as wide as all fingers together
    corners, faces = hull(np.concatenate([probed + [0, 0.03, 0], probed - [0, 0.03, 0]]))
    surfaces["index/proximal"]["parts"] = [{"vertices": corners.tolist(), "faces": faces.tolist()}]
    description = compile(dataclasses.replace(hand, extra={"surfaces": surfaces}), tmp_path / "out")
    assert [f.sentence for f in check(description.folder, items=("contact", "geoms")) if not f.passed] == []
    assert "`index_proximal_link` stays with capsules" in (description.folder / "README.md").read_text()


def test_a_short_sweep_leaves_the_fallback_and_says_so(recorded):
    truth, session = recorded
    bare = identify_surfaces(session, _known(truth), voxel_m=0.05, pivoting=False)
    assert all(not s.found and "fallback" in s.notes[0] and len(s.notes) == 1 for s in bare)
    hand = with_surfaces(_known(truth), bare)
    assert "surfaces" not in hand.extra and len(hand.notes) == len(bare)


def test_a_probe_that_is_calibrated_on_the_moving_hand_has_its_tip_where_it_is(tmp_path):
    truth = twin.bebionic("right", 12, ["index"])
    plan = twin.Plan(flexion=("full",), validation=(), excitations=0, pivot=True)
    twin.record(truth, tmp_path / "session", 12, (), plan)
    probe = calibrated_probe(read_session(tmp_path / "session"))
    _, off = kabsch(np.stack([truth.probe[label] for label in probe.labels]), probe.position_probe)
    assert np.linalg.norm(off) < 4e-4
