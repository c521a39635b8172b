"""What a run looks like: in a window while it happens, or in a film afterwards."""

from omnidrive.visualization.camera import CameraName, camera_of, follow, follows, frame
from omnidrive.visualization.canvas import Canvas
from omnidrive.visualization.film import check_film, film
from omnidrive.visualization.ghost_model import GhostModel
from omnidrive.visualization.observer import Observer, Scene, observe
from omnidrive.visualization.overlays import Overlays, path_of
from omnidrive.visualization.recording import Recorder, Recording, replay
from omnidrive.visualization.viewer import Viewer

__all__ = [
    "CameraName",
    "Canvas",
    "GhostModel",
    "Observer",
    "Overlays",
    "Recorder",
    "Recording",
    "Scene",
    "Viewer",
    "camera_of",
    "check_film",
    "film",
    "follow",
    "follows",
    "frame",
    "observe",
    "path_of",
    "replay",
]
