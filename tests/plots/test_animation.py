"""Modes in motion."""

import re
import subprocess
import sys

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from PIL import Image

import mbsvib as mv
from mbsvib.plots.animation import program


@pytest.fixture(scope="module")
def stewart():
    return mv.library.build("stewart").linearize()


def test_points_move_as_the_bodies_do(stewart):
    modes = stewart.modes()
    motion = modes.animate(3, amplitude=0.2)
    farthest = np.linalg.norm(motion.points(0.0) - motion.scene.points, axis=1).max()
    assert farthest == pytest.approx(0.2 * motion.scene.size)
    mark = next(mark for mark in motion.scene.marks if mark.kind == "body" and mark.name == "platform")
    given = modes.body_shapes["platform"][:3, 2]
    moved = (motion.points(0.0) - motion.scene.points)[mark.point]
    np.testing.assert_allclose(np.cross(moved, given), 0.0, atol=1e-12 * np.linalg.norm(given))
    np.testing.assert_allclose(motion.points(np.pi) + motion.points(0.0), 2.0 * motion.scene.points, atol=1e-12)
    assert motion.title.startswith(f"Mode 3: {modes.frequencies[2]:.5g} Hz")


@pytest.mark.slow
def test_a_gif_has_all_frames(stewart, tmp_path):
    path = tmp_path / "mode.gif"
    stewart.modes().animate(1, path, frames=4, view="x")
    with Image.open(path) as image:
        assert image.n_frames == 4
        assert image.info["loop"] == 0
        first = np.asarray(image.convert("RGB"), dtype=int)
        image.seek(1)
        assert np.abs(np.asarray(image.convert("RGB"), dtype=int) - first).max() > 100
    assert [item.name for item in tmp_path.iterdir()] == ["mode.gif"]


@pytest.mark.slow
def test_a_page_needs_no_network(stewart, tmp_path):
    page = stewart.modes().animate(1, frames=2).save(tmp_path / "mode.html").read_text(encoding="utf-8")
    assert page.count("data:image/png;base64") >= 2


@pytest.mark.slow
def test_an_mp4_has_all_frames(stewart, tmp_path):
    pytest.importorskip("imageio_ffmpeg", reason="imageio-ffmpeg is not installed: pip install 'mbsvib[video]'")
    path = stewart.modes().animate(1, frames=6, rate=12.0).save(tmp_path / "mode.mp4")
    ffmpeg = program()
    message = subprocess.run([ffmpeg, "-hide_banner", "-i", path], capture_output=True, text=True, check=False).stderr
    assert re.search(r"Video: h264.*yuv420p.* 560x440.* 12 fps", message), message
    raw = subprocess.run([ffmpeg, "-v", "error", "-i", path, "-f", "rawvideo", "-pix_fmt", "rgb24", "-"],
                         capture_output=True, check=True).stdout  # fmt: skip
    films = np.frombuffer(raw, np.uint8).reshape(-1, 440, 560, 3).astype(int)
    assert len(films) == 6
    # not blank, the first as the still picture up to what compression does, and moving
    FigureCanvasAgg(figure := stewart.modes().animate(1).figure())
    figure.canvas.draw()
    still = np.asarray(figure.canvas.buffer_rgba(), dtype=int)[..., :3]
    assert np.abs(films[0] - still).mean() < 2.0
    assert (films[0] < 128).any(axis=2).mean() > 0.005
    assert np.abs(films[3] - films[0]).max() > 100
    assert [item.name for item in tmp_path.iterdir()] == ["mode.mp4"]


@pytest.mark.skipif(sys.platform == "win32", reason="a shell script stands for ffmpeg")
def test_ffmpeg_on_the_path_comes_first(monkeypatch, tmp_path):
    (own := tmp_path / "ffmpeg").write_text("#!/bin/sh\nexit 3\n")
    own.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path))
    assert program() == str(own)


@pytest.mark.skipif(sys.platform == "win32", reason="a shell script stands for ffmpeg")
def test_a_program_that_fails_is_told(stewart, monkeypatch, tmp_path):
    (own := tmp_path / "ffmpeg").write_text("#!/bin/sh\nexit 3\n")
    own.chmod(0o755)
    monkeypatch.setattr("mbsvib.plots.animation.which", lambda name: str(own))
    with pytest.raises(mv.ExportError, match="ffmpeg: this program wrote no MP4"):
        stewart.modes().animate(1, tmp_path / "mode.mp4", frames=2)
    assert not (tmp_path / "mode.mp4").exists()


@pytest.mark.slow
def test_it_shows_itself(stewart):
    assert "data:image/gif;base64," in stewart.modes().animate(2, frames=2)._repr_html_()


def test_complex_shapes_go_round():
    model = mv.Model("rotor")
    model.add_body("disk", 1.0, (0.1, 0.1, 0.2))
    model.add_bushing("mount", "ground", "disk", (0, 0, 0.1), stiffness=(1e3,) * 3 + (40.0,) * 3)
    model.add_rotor("spin", "disk", axis=(0, 0, 1), inertia=0.2, speed=50.0)
    motion = model.linearize().modes().animate(1)
    assert np.iscomplexobj(motion.shape)
    assert np.linalg.norm(motion.points(np.pi / 2) - motion.scene.points) > 0.0


@pytest.mark.slow
def test_refusals(stewart, tmp_path, monkeypatch):
    modes = stewart.modes()
    with pytest.raises(mv.ResponseError, match="from 1 to 6"):
        modes.animate(7)
    with pytest.raises(mv.ResponseError, match="'3-D', 'x', 'y', 'z'"):
        modes.animate(1, view="above")
    with pytest.raises(mv.ResponseError, match="frames = 1"):
        modes.animate(1, frames=1)
    with pytest.raises(mv.ExportError, match=r"\.gif, \.mp4, \.html"):
        modes.animate(1, tmp_path / "mode.avi")
    with pytest.raises(mv.ExportError, match="cannot be written"):
        modes.animate(1, tmp_path / "no" / "mode.gif", frames=2)
    monkeypatch.setattr("mbsvib.plots.animation.which", lambda name: None)
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    with pytest.raises(mv.ExportError, match=r'ffmpeg.*pip install "mbsvib\[video\]"'):
        modes.animate(1, tmp_path / "mode.mp4")
    variants = mv.library.build("stewart").linearize(values={"leg1.k.stiffness": [1e7, 2e7]}).modes()
    with pytest.raises(mv.ResponseError, match="variant of a batch"):
        variants[0].animate(1)
