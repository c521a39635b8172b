"""Films: content of pictures and files, and invalid requests."""

import os
import stat
import sys
from dataclasses import replace
from inspect import unwrap
from math import radians, tan
from pathlib import Path

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from omnidrive.errors import CannotDraw, CannotWrite, InvalidInput, MissingExtra
from omnidrive.geometry import BodyTwist, Pose
from omnidrive.robot import named_robot
from omnidrive.simulation import KinematicPlant, MujocoPlant
from omnidrive.testing.laws import Circle
from omnidrive.visualization import (
    Canvas,
    DisplayModel,
    Overlays,
    Recorder,
    check_film,
    film,
    is_following,
    make_camera,
    observe,
    overview_camera,
)
from tests.examples import examples

ROBOT = named_robot("small")
SIZE = (160, 90)
ORANGE, GREEN = np.array([0.93, 0.36, 0.06]), np.array([0.05, 0.62, 0.32])


@pytest.fixture(scope="module")
def recording():
    """One second on a circle of radius 1 m."""
    recorder, reference = Recorder(), Circle(duration=4.0)
    plant = observe(MujocoPlant(ROBOT, "ball"), ROBOT, reference, [recorder])
    plant.reset(reference.at(0.0).pose)
    for _ in range(10):
        plant.step(BodyTwist(1.57, 0.0, 1.57), 0.1)
    return recorder.recording


@pytest.fixture(scope="module")
def brief(recording):
    """Return its first frames."""
    names = ("t", "qpos", "mocap_positions", "target")
    series = {name: getattr(recording, name)[:5] for name in names}
    return replace(recording, **series)


def share(picture, colour):
    """Return the share of pixels with the hue of a colour."""
    pixels = picture.reshape(-1, 3).astype(float)
    pixels /= np.linalg.norm(pixels, axis=1, keepdims=True) + 1e-9
    return float((pixels @ (colour / np.linalg.norm(colour)) > 0.93).mean())


def frames_of(path):
    with Image.open(path) as image:
        for k in range(image.n_frames):
            image.seek(k)
            yield np.array(image.convert("RGB")), image.info["duration"]


def test_gif_plays_in_real_time_and_repeats(recording, tmp_path):
    path = tmp_path / "run.gif"
    seen = []
    speed = film(recording, path, size=(320, 180), progress=lambda *done: seen.append(done))
    assert speed == 1.0
    assert seen == [(k, 26) for k in range(1, 27)]
    pictures, durations = zip(*frames_of(path), strict=True)
    assert sum(durations) == 26 * 40
    assert {picture.shape for picture in pictures} == {(180, 320, 3)}
    with Image.open(path) as image:
        assert image.info["loop"] == 0
    trails = [share(picture, ORANGE) for picture in (pictures[0], pictures[12], pictures[-1])]
    assert trails == sorted(trails)
    assert trails[0] < 0.5 * trails[-1]
    assert os.listdir(tmp_path) == ["run.gif"]


def test_gif_frame_equals_the_rendered_picture(recording, tmp_path):
    """Up to the reduced number of colours; late frames contain no rests of earlier ones."""
    film(recording, tmp_path / "run.gif", size=SIZE, camera="follow")
    last = list(frames_of(tmp_path / "run.gif"))[-1][0]
    data = mujoco.MjData(recording.model)
    data.qpos[:] = recording.qpos[-1]
    mujoco.mj_forward(recording.model, data)
    path = np.vstack([recording.path, recording.qpos[:, :2]])
    camera = make_camera("follow", path, ROBOT.body_radius, 16 / 9)
    camera.lookat[:2] = recording.qpos[-1, :2]
    target = Pose(*recording.target[-1])
    overlays = Overlays(recording.path, recording.qpos[:, :2], target, ROBOT.body_radius)
    with Canvas(recording.model, *SIZE) as canvas:
        drawn = canvas.draw(data, camera, overlays)
    difference = np.abs(drawn.astype(float) - last)[30:]  # below the caption
    assert np.median(difference) < 6.0
    assert difference.mean() < 8.0


def test_long_run_plays_faster(recording, tmp_path, monkeypatch):
    monkeypatch.setitem(
        sys.modules["omnidrive.visualization.film"]._MAX_FRAMES_BY_SUFFIX, ".gif", 10
    )
    assert film(recording, tmp_path / "run.gif", size=SIZE) == 3.0
    assert sum(duration for _, duration in frames_of(tmp_path / "run.gif")) == 9 * 40


def test_target_is_drawn_at_its_position():
    """In a vertical view the target is a green disc with the robot's radius."""
    display = DisplayModel(ROBOT)
    display.set_pose(0.0, Pose(5.0, 5.0, 0.0), np.zeros(4))  # out of the picture
    camera = mujoco.MjvCamera()
    camera.azimuth, camera.elevation, camera.distance = 90.0, -90.0, 4.0
    no_points = np.zeros((0, 2))
    overlays = Overlays(no_points, no_points, Pose(0.5, -0.3, 0.5), ROBOT.body_radius)
    with Canvas(display.model, 200, 200) as canvas:
        drawn = canvas.draw(display.data, camera, overlays).astype(float)
    green = (drawn[:, :, 1] > drawn[:, :, 0] + 25) & (drawn[:, :, 1] > drawn[:, :, 2] + 10)
    rows, columns = np.nonzero(green)
    metres = 2.0 * 4.0 * tan(radians(22.5)) / 200
    position = (columns.mean() - 99.5) * metres, (99.5 - rows.mean()) * metres
    assert position == pytest.approx((0.53, -0.28), abs=0.05)  # the arrow extends beyond the disc
    assert green.sum() * metres**2 == pytest.approx(np.pi * ROBOT.body_radius**2, rel=0.25)


@examples(50)
@given(
    points=st.lists(st.tuples(st.floats(-50, 50), st.floats(-50, 50)), min_size=1, max_size=8).map(
        np.array
    ),
    margin=st.floats(0.1, 2.0),
    aspect=st.floats(0.4, 2.5),
)
def test_overview_camera_is_the_nearest_with_all_points(points, margin, aspect):
    """Check by projection with the vertical field of view of 45 degrees."""
    camera = overview_camera(points, margin, aspect)
    tilt, turn = radians(camera.elevation), radians(camera.azimuth)
    ahead = np.array([np.cos(tilt) * np.cos(turn), np.cos(tilt) * np.sin(turn), np.sin(tilt)])
    right = np.array([np.sin(turn), -np.cos(turn), 0.0])
    up = np.cross(right, ahead)
    low, high = points.min(axis=0) - margin, points.max(axis=0) + margin
    corners = np.array([[x, y, 0.0] for x in (low[0], high[0]) for y in (low[1], high[1])])
    from_eye = corners - (camera.lookat - camera.distance * ahead)
    depth = from_eye @ ahead
    assert (depth > 0.0).all()
    half = tan(radians(22.5))
    sideways = np.abs(from_eye @ right) / depth / half / aspect
    upwards = np.abs(from_eye @ up) / depth / half
    fill = max(sideways.max(), upwards.max())
    assert fill == pytest.approx(0.9, abs=1e-6)


def test_auto_camera_follows_the_robot_on_long_paths():
    short, long = np.array([[0.0, 0.0], [5.0, 1.0]]), np.array([[0.0, 0.0], [25.0, 9.0]])
    assert not is_following("auto", short, 0.28)
    assert is_following("auto", long, 0.28)
    assert is_following("follow", short, 0.28)
    assert not is_following("whole", long, 0.28)


@pytest.mark.parametrize("name", ["run.avi", "run", "gif"])
def test_unknown_suffix_is_refused(recording, tmp_path, name):
    for function in (check_film, lambda path: film(recording, path)):
        with pytest.raises(InvalidInput, match=r"films are written as \.mp4 or \.gif"):
            function(tmp_path / name)


@pytest.mark.parametrize("size", [(63, 64), (65, 64), (64, 4000), (64, 2)])
def test_invalid_size_is_refused(recording, tmp_path, size):
    with pytest.raises(InvalidInput, match="need even numbers from 64 to 1920"):
        film(recording, tmp_path / "run.gif", size=size)


def test_unknown_camera_is_refused(recording, tmp_path):
    with pytest.raises(InvalidInput, match="there is no camera 'side'; there are auto, whole"):
        unwrap(film)(recording, tmp_path / "run.gif", camera="side")  # without type checks


def test_failed_film_leaves_no_file(recording, tmp_path):
    with pytest.raises(CannotWrite, match="name a file in an existing, writable"):
        check_film(tmp_path / "no" / "run.gif")
    with pytest.raises(CannotWrite, match="cannot write to "):
        film(recording, tmp_path / "no" / "run.gif", size=SIZE)

    def stop(done, count):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        film(recording, tmp_path / "run.gif", size=SIZE, progress=stop)
    assert not os.listdir(tmp_path)


def test_mp4_without_encoder_is_refused(tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setitem(sys.modules, "cv2", None)
    monkeypatch.setattr("omnidrive.visualization.video_file.find_spec", lambda name: None)
    with pytest.raises(MissingExtra, match=r"install the command ffmpeg, or pip install opencv"):
        check_film(tmp_path / "run.mp4")
    check_film(tmp_path / "run.gif")


FFMPEG = """#!{python}
import sys
if "-encoders" in sys.argv:
    print(" V....D {encoder}  some encoder")
    raise SystemExit
data = sys.stdin.buffer.read({most})
open(sys.argv[-1].removeprefix("file:"), "wb").write(len(data).to_bytes(8, "big"))
open({notes!r}, "w").write(" ".join(sys.argv[1:]))
print("a word of warning", file=sys.stderr)
raise SystemExit({status})
"""


def fake_ffmpeg(folder, monkeypatch, *, encoder="libx264", most=-1, status=0):
    """Install a fake command ffmpeg that counts the bytes and records its arguments."""
    command = folder / "bin" / "ffmpeg"
    command.parent.mkdir()
    notes = str(folder / "notes")
    command.write_text(
        FFMPEG.format(python=sys.executable, encoder=encoder, most=most, status=status, notes=notes)
    )
    command.chmod(command.stat().st_mode | stat.S_IEXEC)
    monkeypatch.setenv("PATH", str(command.parent))
    return Path(notes)


@pytest.mark.parametrize(
    "encoder",
    [
        "libx264",
        *(pytest.param(n, marks=pytest.mark.long) for n in ("libopenh264", "libvpx-vp9", "mpeg4")),
    ],
)
def test_ffmpeg_receives_every_frame(brief, tmp_path, monkeypatch, encoder):
    notes = fake_ffmpeg(tmp_path, monkeypatch, encoder=encoder)
    check_film(tmp_path / "run.mp4")
    film(brief, tmp_path / "run.mp4", size=SIZE)
    taken = int.from_bytes((tmp_path / "run.mp4").read_bytes(), "big")
    assert taken == 5 * 160 * 90 * 3
    arguments = notes.read_text()
    assert "-s 160x90 -r 25 " in arguments
    assert f"-c:v {encoder} " in arguments
    assert "-pix_fmt yuv420p" in arguments


def test_ffmpeg_failure_is_reported(recording, tmp_path, monkeypatch):
    fake_ffmpeg(tmp_path, monkeypatch, status=1, most=1000)
    with pytest.raises(CannotWrite, match="ffmpeg cannot write the film: a word of warning"):
        film(recording, tmp_path / "run.mp4", size=SIZE)
    assert not (tmp_path / "run.mp4").exists()
    assert not list(tmp_path.glob(".run.mp4*"))


def test_ffmpeg_without_encoder_is_refused(recording, tmp_path, monkeypatch):
    fake_ffmpeg(tmp_path, monkeypatch, encoder="gif")
    with pytest.raises(CannotWrite, match="ffmpeg has none of the encoders libx264"):
        film(recording, tmp_path / "run.mp4", size=SIZE)


def test_opencv_writes_a_readable_mp4(recording, tmp_path, monkeypatch):
    cv2 = pytest.importorskip("cv2")
    monkeypatch.setenv("PATH", str(tmp_path))
    film(recording, tmp_path / "run.mp4", size=SIZE)
    video = cv2.VideoCapture(str(tmp_path / "run.mp4"))
    assert video.get(cv2.CAP_PROP_FPS) == pytest.approx(25.0)
    count = 0
    while video.read()[0]:
        count += 1
    assert count == len(recording.t)


def test_drawing_switched_off_is_reported(monkeypatch, tmp_path):
    monkeypatch.setenv("MUJOCO_GL", "off")
    with pytest.raises(CannotDraw, match="switched off by MUJOCO_GL=off"):
        check_film(tmp_path / "run.gif")


def test_missing_opengl_is_reported(monkeypatch, tmp_path):
    for name in ("MUJOCO_GL", "DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr("omnidrive.visualization.opengl.find_library", lambda name: None)
    with pytest.raises(CannotDraw, match="apt install libegl1") as error:
        check_film(tmp_path / "run.gif")
    assert "no library found" in str(error.value)


def test_failing_library_is_named(monkeypatch, tmp_path):
    monkeypatch.setenv("MUJOCO_GL", "egl")

    def broken(name):
        raise ImportError("no such driver")

    monkeypatch.setattr("omnidrive.visualization.opengl.import_module", broken)
    with pytest.raises(CannotDraw, match="egl: no such driver"):
        check_film(tmp_path / "run.gif")
    assert os.environ["MUJOCO_GL"] == "egl"


def test_environment_is_restored_after_drawing(monkeypatch, tmp_path):
    monkeypatch.delenv("MUJOCO_GL", raising=False)
    check_film(tmp_path / "run.gif")
    assert "MUJOCO_GL" not in os.environ


def test_kinematic_run_is_filmed(tmp_path):
    recorder, reference = Recorder(), Circle(duration=4.0)
    plant = observe(KinematicPlant(ROBOT), ROBOT, reference, [recorder])
    plant.reset(reference.at(0.0).pose)
    plant.step(BodyTwist(1.0, 0.0, 0.0), 0.1)
    film(recorder.recording, tmp_path / "run.GIF", size=SIZE)
    assert len(list(frames_of(tmp_path / "run.GIF"))) == 3
