"""Probed surfaces in a compiled hand: mass properties against closed forms, visuals, and the fallback where a mesh
leaks."""

import dataclasses

import mujoco
import numpy as np
import pytest
import trimesh
from synthetic_hand import synthetic_hand

from hand_model.check import check
from hand_model.compile import compile
from hand_model.compile.surface import Surface, mesh_inertia
from hand_model.errors import HandFileError
from hand_model.rotation import rotation_from_vector


def _box(size, turn=(0.0, 0.0, 0.0), shift=(0.0, 0.0, 0.0)):
    box = trimesh.creation.box(size)
    rotation = rotation_from_vector(turn)
    return Surface(box.vertices @ rotation.T + shift, np.array(box.faces)), rotation


def test_mass_properties_of_a_turned_box_far_from_the_origin():
    size, shift = np.array([0.03, 0.02, 0.01]), np.array([0.4, -0.2, 0.1])
    surface, rotation = _box(size, (0.3, -0.8, 0.5), shift)
    found = mesh_inertia(surface, 1000.0)
    mass = 1000.0 * size.prod()
    tensor = rotation @ np.diag(mass / 12 * (size @ size - size**2)) @ rotation.T
    assert found.mass == pytest.approx(mass, rel=1e-9)
    assert np.allclose(found.centre, shift, atol=1e-12)
    assert np.allclose(found.tensor, tensor, rtol=1e-7, atol=1e-6 * tensor.max())


def test_watertight_means_closed_and_turned_outwards():
    surface, _ = _box((0.03, 0.02, 0.01))
    flipped = surface.faces.copy()
    flipped[0] = flipped[0, ::-1]
    assert surface.watertight
    assert not Surface(surface.vertices, surface.faces[1:]).watertight
    assert not Surface(surface.vertices, flipped).watertight
    assert not Surface(surface.vertices, surface.faces[:, ::-1]).watertight


def _probed(hand, leak=False):
    centre = hand.finger("index").joints[0].centre_palm
    surface, _ = _box((0.03, 0.014, 0.012), shift=centre + [0.016, 0, 0])
    faces = surface.faces[1:] if leak else surface.faces
    table = {"index/s0": {"vertices": surface.vertices.tolist(), "faces": faces.tolist()}}
    return dataclasses.replace(hand, extra={"surfaces": table})


@pytest.mark.parametrize("leak", [False, True])
def test_a_probed_segment_gets_its_mesh_and_if_watertight_its_mass(tmp_path, leak):
    hand = synthetic_hand(1)
    plain = mujoco.MjModel.from_xml_path(str(compile(hand, tmp_path / "plain").mjcf))
    description = compile(_probed(hand, leak), tmp_path / "probed")
    model = mujoco.MjModel.from_xml_path(str(description.mjcf))
    body = model.body("index_s0_link")
    assert [f.sentence for f in check(description.folder) if not f.passed] == []
    mesh = trimesh.load(tmp_path / "probed/assets/index_s0_link.stl")
    assert np.allclose(mesh.bounds, [[0.001, -0.007, -0.006], [0.031, 0.007, 0.006]], atol=1e-6)
    if leak:
        assert body.mass[0] == plain.body("index_s0_link").mass[0]
        assert "not watertight" in (description.folder / "README.md").read_text()
    else:
        assert body.mass[0] == pytest.approx(1100 * 0.03 * 0.014 * 0.012, rel=1e-9)
        assert np.allclose(body.ipos, [0.016, 0, 0], atol=1e-12)


def test_surfaces_that_are_none_are_refused(tmp_path):
    hand = synthetic_hand(1)
    good = _probed(hand).extra["surfaces"]["index/s0"]
    for table, message in (
        ({"index/s9": good}, 'did you mean "index/s'),
        ({"plam": good}, 'did you mean "palm"'),
        ({"palm": {"vertices": good["vertices"]}}, "needs"),
        ({"palm": {**good, "faces": [[0, 1, 99]] * 4}}, "no mesh"),
    ):
        with pytest.raises(HandFileError, match=message):
            compile(dataclasses.replace(hand, extra={"surfaces": table}), tmp_path / "out")
