"""Films: what is in the pictures, what is in the files, and what is refused."""

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
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from omnidrive.errors import CannotDraw, CannotWrite, InvalidInput, MissingExtra
from omnidrive.geometry import BodyTwist, Pose
from omnidrive.robot import named_robot
from omnidrive.simulation import KinematicPlant, MujocoPlant
from omnidrive.visualization import (
    Canvas,
    GhostModel,
    Overlays,
    Recorder,
    check_film,
    film,
    follows,
    frame,
    make_camera,
    observe,
)
from tests.laws.motions import Circle

ROBOT = named_robot("small")
SIZE = (160, 90)
ORANGE, GREEN = np.array([0.93, 0.36, 0.06]), np.array([0.05, 0.62, 0.32])


@pytest.fixture(scope="module")
def recording():
    """A second on a circle of 1 m."""
    recorder, reference = Recorder(), Circle(duration=4.0)
    plant = observe(MujocoPlant(ROBOT, "ball"), ROBOT, reference, [recorder])
    plant.reset(reference.at(0.0).pose)
    for _ in range(10):
        plant.step(BodyTwist(1.57, 0.0, 1.57), 0.1)
    return recorder.recording


@pytest.fixture(scope="module")
def brief(recording):
    """The first frames of it."""
    series = {name: getattr(recording, name)[:5] for name in ("t", "positions", "moving", "target")}
    return replace(recording, **series)


def share(picture, colour):
    """Of the pixels those that are of a hue, however bright."""
    pixels = picture.reshape(-1, 3).astype(float)
    pixels /= np.linalg.norm(pixels, axis=1, keepdims=True) + 1e-9
    return float((pixels @ (colour / np.linalg.norm(colour)) > 0.93).mean())


def frames_of(path):
    with Image.open(path) as image:
        for k in range(image.n_frames):
            image.seek(k)
            yield np.array(image.convert("RGB")), image.info["duration"]


def test_a_gif_plays_the_run_at_real_time_for_ever(recording, tmp_path):
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


def test_a_gif_is_what_was_drawn(recording, tmp_path):
    """But for the number of its colours: a later frame is not the rest of an earlier one."""
    film(recording, tmp_path / "run.gif", size=SIZE, camera="follow")
    last = list(frames_of(tmp_path / "run.gif"))[-1][0]
    data = mujoco.MjData(recording.model)
    data.qpos[:] = recording.positions[-1]
    mujoco.mj_forward(recording.model, data)
    path = np.vstack([recording.path, recording.positions[:, :2]])
    camera = make_camera("follow", path, ROBOT.body_radius, 16 / 9)
    camera.lookat[:2] = recording.positions[-1, :2]
    target = Pose(*recording.target[-1])
    marks = Overlays(recording.path, recording.positions[:, :2], target, ROBOT.body_radius)
    with Canvas(recording.model, *SIZE) as canvas:
        drawn = canvas.draw(data, camera, marks)
    off = np.abs(drawn.astype(float) - last)[30:]  # below the caption
    assert np.median(off) < 6.0
    assert off.mean() < 8.0


def test_too_long_a_run_plays_faster(recording, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules["omnidrive.visualization.film"]._MOST, ".gif", 10)
    assert film(recording, tmp_path / "run.gif", size=SIZE) == 3.0
    assert sum(duration for _, duration in frames_of(tmp_path / "run.gif")) == 9 * 40


def test_marks_are_where_they_belong():
    """Seen from right above, the target is a green disc with the robot's radius."""
    puppet = GhostModel(ROBOT)
    puppet.set_pose(0.0, Pose(5.0, 5.0, 0.0), np.zeros(4))  # out of the picture
    camera = mujoco.MjvCamera()
    camera.azimuth, camera.elevation, camera.distance = 90.0, -90.0, 4.0
    nothing = np.zeros((0, 2))
    marks = Overlays(nothing, nothing, Pose(0.5, -0.3, 0.5), ROBOT.body_radius)
    with Canvas(puppet.model, 200, 200) as canvas:
        drawn = canvas.draw(puppet.data, camera, marks).astype(float)
    green = (drawn[:, :, 1] > drawn[:, :, 0] + 25) & (drawn[:, :, 1] > drawn[:, :, 2] + 10)
    rows, columns = np.nonzero(green)
    metres = 2.0 * 4.0 * tan(radians(22.5)) / 200
    where = (columns.mean() - 99.5) * metres, (99.5 - rows.mean()) * metres
    assert where == pytest.approx((0.53, -0.28), abs=0.05)  # an arrow stands out ahead
    assert green.sum() * metres**2 == pytest.approx(np.pi * ROBOT.body_radius**2, rel=0.25)


@settings(max_examples=50, deadline=None)
@given(
    points=st.lists(st.tuples(st.floats(-50, 50), st.floats(-50, 50)), min_size=1, max_size=8).map(
        np.array
    ),
    margin=st.floats(0.1, 2.0),
    aspect=st.floats(0.4, 2.5),
)
def test_a_framing_camera_sees_everything_and_is_near(points, margin, aspect):
    """By projection: where it is, what it looks along, and its 45 degrees from top to bottom."""
    camera = frame(points, margin, aspect)
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
    most = max(sideways.max(), upwards.max())
    assert most == pytest.approx(0.9, abs=1e-6)


def test_a_camera_follows_where_the_robot_would_be_too_small():
    short, long = np.array([[0.0, 0.0], [5.0, 1.0]]), np.array([[0.0, 0.0], [25.0, 9.0]])
    assert not follows("auto", short, 0.28)
    assert follows("auto", long, 0.28)
    assert follows("follow", short, 0.28)
    assert not follows("whole", long, 0.28)


@pytest.mark.parametrize("name", ["run.avi", "run", "gif"])
def test_other_endings_are_refused(recording, tmp_path, name):
    for refuse in (check_film, lambda path: film(recording, path)):
        with pytest.raises(InvalidInput, match=r"films are written as \.mp4 or \.gif"):
            refuse(tmp_path / name)


@pytest.mark.parametrize("size", [(63, 64), (65, 64), (64, 4000), (64, 2)])
def test_sizes_are_bounded_and_even(recording, tmp_path, size):
    with pytest.raises(InvalidInput, match="need even numbers from 64 to 1920"):
        film(recording, tmp_path / "run.gif", size=size)


def test_a_camera_that_there_is_not(recording, tmp_path):
    with pytest.raises(InvalidInput, match="there is no camera 'side'; there are auto, whole"):
        unwrap(film)(recording, tmp_path / "run.gif", camera="side")  # without type checks


def test_a_film_that_cannot_be_written_leaves_nothing(recording, tmp_path):
    with pytest.raises(CannotWrite, match="name a file in a folder that is there"):
        check_film(tmp_path / "no" / "run.gif")
    with pytest.raises(CannotWrite, match="cannot write the film"):
        film(recording, tmp_path / "no" / "run.gif", size=SIZE)

    def stop(done, count):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        film(recording, tmp_path / "run.gif", size=SIZE, progress=stop)
    assert not os.listdir(tmp_path)


def test_an_mp4_needs_an_encoder_and_says_which(tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setitem(sys.modules, "cv2", None)
    monkeypatch.setattr("omnidrive.visualization.video_file.find_spec", lambda name: None)
    with pytest.raises(MissingExtra, match=r"install the command ffmpeg, or pip install 'omni"):
        check_film(tmp_path / "run.mp4")
    check_film(tmp_path / "run.gif")


FFMPEG = """#!{python}
import sys
if "-encoders" in sys.argv:
    print(" V....D {encoder}  some encoder")
    raise SystemExit
given = sys.stdin.buffer.read({most})
open(sys.argv[-1].removeprefix("file:"), "wb").write(len(given).to_bytes(8, "big"))
open({notes!r}, "w").write(" ".join(sys.argv[1:]))
print("a word of warning", file=sys.stderr)
raise SystemExit({status})
"""


def stand_in(folder, monkeypatch, *, encoder="libx264", most=-1, status=0):
    """A command ffmpeg that takes pictures in and says what it was told."""
    command = folder / "bin" / "ffmpeg"
    command.parent.mkdir()
    notes = str(folder / "notes")
    command.write_text(
        FFMPEG.format(python=sys.executable, encoder=encoder, most=most, status=status, notes=notes)
    )
    command.chmod(command.stat().st_mode | stat.S_IEXEC)
    monkeypatch.setenv("PATH", str(command.parent))
    return Path(notes)


@pytest.mark.parametrize("encoder", ["libx264", "libopenh264", "libvpx-vp9", "mpeg4"])
def test_the_command_ffmpeg_gets_every_picture(brief, tmp_path, monkeypatch, encoder):
    notes = stand_in(tmp_path, monkeypatch, encoder=encoder)
    check_film(tmp_path / "run.mp4")
    film(brief, tmp_path / "run.mp4", size=SIZE)
    taken = int.from_bytes((tmp_path / "run.mp4").read_bytes(), "big")
    assert taken == 5 * 160 * 90 * 3
    told = notes.read_text()
    assert "-s 160x90 -r 25 " in told
    assert f"-c:v {encoder} " in told
    assert "-pix_fmt yuv420p" in told


def test_an_ffmpeg_that_fails_says_why(recording, tmp_path, monkeypatch):
    stand_in(tmp_path, monkeypatch, status=1, most=1000)
    with pytest.raises(CannotWrite, match="ffmpeg cannot write the film: a word of warning"):
        film(recording, tmp_path / "run.mp4", size=SIZE)
    assert not (tmp_path / "run.mp4").exists()
    assert not (tmp_path / "run.mp4.part").exists()


def test_an_ffmpeg_without_encoders(recording, tmp_path, monkeypatch):
    stand_in(tmp_path, monkeypatch, encoder="gif")
    with pytest.raises(CannotWrite, match="ffmpeg has none of the encoders libx264"):
        film(recording, tmp_path / "run.mp4", size=SIZE)


def test_opencv_writes_an_mp4_that_opens_again(recording, tmp_path, monkeypatch):
    cv2 = pytest.importorskip("cv2")
    monkeypatch.setenv("PATH", str(tmp_path))
    film(recording, tmp_path / "run.mp4", size=SIZE)
    video = cv2.VideoCapture(str(tmp_path / "run.mp4"))
    assert video.get(cv2.CAP_PROP_FPS) == pytest.approx(25.0)
    count = 0
    while video.read()[0]:
        count += 1
    assert count == len(recording.t)


def test_drawing_that_is_switched_off(monkeypatch, tmp_path):
    monkeypatch.setenv("MUJOCO_GL", "off")
    with pytest.raises(CannotDraw, match="switched off by MUJOCO_GL=off"):
        check_film(tmp_path / "run.gif")


def test_no_opengl_at_all(monkeypatch, tmp_path):
    for name in ("MUJOCO_GL", "DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr("omnidrive.visualization.opengl.find_library", lambda name: None)
    with pytest.raises(CannotDraw, match="apt install libegl1") as error:
        check_film(tmp_path / "run.gif")
    assert "no library found" in str(error.value)


def test_a_library_that_fails_is_named(monkeypatch, tmp_path):
    monkeypatch.setenv("MUJOCO_GL", "egl")

    def broken(name):
        raise ImportError("no such driver")

    monkeypatch.setattr("omnidrive.visualization.opengl.import_module", broken)
    with pytest.raises(CannotDraw, match="egl: no such driver"):
        check_film(tmp_path / "run.gif")
    assert os.environ["MUJOCO_GL"] == "egl"


def test_the_choice_of_opengl_is_not_left_behind(monkeypatch, tmp_path):
    monkeypatch.delenv("MUJOCO_GL", raising=False)
    check_film(tmp_path / "run.gif")
    assert "MUJOCO_GL" not in os.environ


def test_a_kinematic_run_is_filmed_too(tmp_path):
    recorder, reference = Recorder(), Circle(duration=4.0)
    plant = observe(KinematicPlant(ROBOT), ROBOT, reference, [recorder])
    plant.reset(reference.at(0.0).pose)
    plant.step(BodyTwist(1.0, 0.0, 0.0), 0.1)
    film(recorder.recording, tmp_path / "run.GIF", size=SIZE)
    assert len(list(frames_of(tmp_path / "run.GIF"))) == 3
