"""Visualization of runs: in a window during the simulation, or as a film afterwards."""

from omnidrive.visualization.camera import (
    CameraName,
    follow,
    is_following,
    make_camera,
    overview_camera,
)
from omnidrive.visualization.canvas import Canvas
from omnidrive.visualization.display_model import DisplayModel
from omnidrive.visualization.film import check_film, film
from omnidrive.visualization.observer import Observer, Scene, observe
from omnidrive.visualization.overlays import Overlays, sample_path
from omnidrive.visualization.recording import Recorder, Recording, replay
from omnidrive.visualization.viewer import Viewer

__all__ = [
    "CameraName",
    "Canvas",
    "DisplayModel",
    "Observer",
    "Overlays",
    "Recorder",
    "Recording",
    "Scene",
    "Viewer",
    "check_film",
    "film",
    "follow",
    "is_following",
    "make_camera",
    "observe",
    "overview_camera",
    "replay",
    "sample_path",
]
