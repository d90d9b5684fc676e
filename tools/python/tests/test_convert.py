"""Models into scene files."""

import numpy as np
import pytest

import brickwalk
import meshes


def write_obj(path, vertices, faces):
    lines = [f"v {x} {y} {z}" for x, y, z in vertices] + [f"f {a} {b} {c}" for a, b, c in faces + 1]
    path.write_text("\n".join(lines) + "\n")
    return path


@pytest.fixture
def model(tmp_path):
    return write_obj(tmp_path / "box.obj", *meshes.box())


def test_a_model_becomes_a_scene(model, tmp_path):
    told = []
    summary = brickwalk.convert(model, tmp_path / "box.bricks", progress=lambda *so_far: told.append(so_far))
    assert summary["triangles"] == 12 and summary["bricks"] == 1
    assert summary["bytes"] == (tmp_path / "box.bricks").stat().st_size
    with brickwalk.Scene.open(tmp_path / "box.bricks", adapter="cpu") as scene:
        assert scene.info["triangles"] == 12
        assert scene.cast_rays([[0.25, 0.5, 3, 0, 0, -1]])["t"] == 2.0


def test_settings_have_effects(model, tmp_path):
    out = tmp_path / "box.bricks"
    brickwalk.convert([model, str(model)], str(out), brick_triangles=4, metres=0.5, up="z", threads=1, memory="1G")
    with brickwalk.Scene.open(out) as scene:
        assert scene.info["triangles"] == 24 and scene.info["bricks"] > 4
        np.testing.assert_allclose(scene.info["bounds"], [[0, 0, -0.5], [0.5, 0.5, 0]])


def test_models_may_name_files_of_a_folder_around_them(model, tmp_path):
    (tmp_path / "models").mkdir()
    inner = tmp_path / "models" / "box.obj"
    inner.write_text("mtllib ../paint.mtl\nusemtl paint\n" + model.read_text())
    (tmp_path / "paint.mtl").write_text("newmtl paint\nKd 1 0 0\n")
    alone = brickwalk.convert(inner, tmp_path / "box.bricks")
    assert any("paint.mtl" in warning and "--within" in warning for warning in alone["warnings"])
    assert brickwalk.convert(inner, tmp_path / "box.bricks", within=tmp_path)["warnings"] == []
    (tmp_path / "other").mkdir()
    with pytest.raises(brickwalk.BrickwalkError, match="box.obj: --within .*other: the file is not in it"):
        brickwalk.convert(inner, tmp_path / "box.bricks", within=tmp_path / "other")


@pytest.mark.parametrize(
    "options, error, text",
    [
        ({"brick_triangles": 0}, ValueError, "brick"),
        ({"brick_triangles": "many"}, TypeError, "brick_triangles"),
        ({"textures": "jpeg"}, ValueError, "textures"),
        ({"up": "x"}, ValueError, "up"),
        ({"metres": -1.0}, ValueError, "metres"),
        ({"memory": "all"}, ValueError, "memory"),
        ({"lattice": "fine"}, TypeError, "lattice"),
        ({"lattice": 1000}, ValueError, "lattice"),
        ({"threads": 0}, ValueError, "threads"),
        ({"within": 3}, TypeError, "within"),
        ({"progress": 3}, TypeError, "progress"),
        ({"no_such": 3}, TypeError, "no_such"),
    ],
)
def test_settings_out_of_range(model, tmp_path, options, error, text):
    with pytest.raises(error, match=text):
        brickwalk.convert(model, tmp_path / "box.bricks", **options)
    assert not (tmp_path / "box.bricks").exists()


def test_paths_that_do_not_do(model, tmp_path):
    out = tmp_path / "out.bricks"
    with pytest.raises(FileNotFoundError, match="none.glb"):
        brickwalk.convert(tmp_path / "none.glb", out)
    with pytest.raises(IsADirectoryError):
        brickwalk.convert(tmp_path, out)
    with pytest.raises(ValueError, match=".bricks"):
        brickwalk.convert(model, tmp_path / "out.obj")
    with pytest.raises(ValueError, match="overwrite"):
        brickwalk.convert(model, model)
    with pytest.raises(FileNotFoundError):
        brickwalk.convert(model, tmp_path / "no" / "out.bricks")
    with pytest.raises(ValueError, match="no inputs"):
        brickwalk.convert([], out)
    (tmp_path / "notes.txt").write_text("")
    with pytest.raises(ValueError, match="notes.txt"):
        brickwalk.convert(tmp_path / "notes.txt", out)
    (tmp_path / "bad.glb").write_bytes(b"glTF but not really")
    with pytest.raises(brickwalk.BrickwalkError, match="bad.glb"):
        brickwalk.convert(tmp_path / "bad.glb", out)
    assert not out.exists()


def test_generated_scenes(tmp_path):
    done = []
    count = brickwalk.generate("cornell", tmp_path / "a.bricks", triangles=20_000, progress=lambda d, t: done.append(d))
    with brickwalk.Scene.open(tmp_path / "a.bricks", adapter="cpu") as scene:
        assert scene.info["triangles"] == count and 10_000 < count < 40_000
    brickwalk.generate("cornell", tmp_path / "b.bricks", triangles=20_000)
    assert (tmp_path / "a.bricks").read_bytes() == (tmp_path / "b.bricks").read_bytes()
    with pytest.raises(ValueError, match='kind "village"'):
        brickwalk.generate("village", tmp_path / "c.bricks")
    with pytest.raises(ValueError, match="triangles"):
        brickwalk.generate("city", tmp_path / "c.bricks", triangles=100)
    with pytest.raises(ValueError, match=".bricks"):
        brickwalk.generate("city", tmp_path / "c.glb")
    assert not (tmp_path / "c.bricks").exists()


def test_the_window_is_a_program(box, tmp_path, monkeypatch):
    program = tmp_path / "brickwalk"
    program.write_text('#!/bin/sh\nprintf "%s\\n" "$@" >"$(dirname "$0")/words"\n')
    program.chmod(0o755)
    monkeypatch.setenv("BRICKWALK", str(program))
    assert box.view("--size", "640x360").wait(10) == 0
    assert (tmp_path / "words").read_text().split() == ["view", box.info["path"], "--size", "640x360"]
    with pytest.raises(TypeError):
        box.view(7)
    monkeypatch.setenv("BRICKWALK", str(tmp_path / "none"))
    with pytest.raises(FileNotFoundError, match="BRICKWALK names no program"):
        box.view()
    monkeypatch.delenv("BRICKWALK")
    monkeypatch.setenv("PATH", str(tmp_path / "empty"))
    with pytest.raises(FileNotFoundError, match="not on the path"):
        box.view()
