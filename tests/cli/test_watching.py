"""The options `--video` and `--view` of `omnidrive run`."""

import os

import pytest
from PIL import Image

from omnidrive.scenario import paper_scenario, save_scenario
from omnidrive.scenario.tasks import StepTask
from tests.command import omnidrive

QUICK = ["run", "--plant", "kinematic", "--controller", "feedforward", "--out", "here"]


@pytest.fixture(autouse=True)
def no_display(monkeypatch):
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)


def test_video_of_a_run(tmp_path):
    step = StepTask(displacement=(0.3, 0.1, 0.2), duration=0.6)
    tasks = paper_scenario().tasks.model_copy(update={"step": step})
    save_scenario(paper_scenario().model_copy(update={"tasks": tasks}), tmp_path / "s.yaml")
    done = omnidrive(*QUICK, "--task", "step", "--video", "step.gif", "s.yaml", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-2] == "video: step.gif"
    with Image.open(tmp_path / "step.gif") as image:
        assert image.size == (640, 360)
        seconds = sum(frame_time(image, k) for k in range(image.n_frames)) / 1000
    assert seconds == pytest.approx(0.64)
    assert sorted(os.listdir(tmp_path)) == ["here", "s.yaml", "step.gif"]


def frame_time(image, k):
    image.seek(k)
    return image.info["duration"]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--video", "run.avi"], "run.avi: films are written as .mp4 or .gif"),
        (["--video", "no/run.gif"], "name a file in an existing, writable"),
        (["--view"], "there is no display for the viewer's window"),
    ],
)
def test_invalid_video_or_display_is_rejected_before_the_run(tmp_path, options, message):
    done = omnidrive(*QUICK, *options, cwd=tmp_path)
    assert done.returncode == 2
    assert message in " ".join(done.stderr.split())
    assert not os.listdir(tmp_path)
