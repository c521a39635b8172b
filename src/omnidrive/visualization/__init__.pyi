from .camera import (
    CameraName,
    follow,
    is_following,
    make_camera,
    overview_camera,
)
from .canvas import Canvas
from .display_model import DisplayModel
from .film import check_film, film
from .observer import Observer, Scene, observe
from .overlays import Overlays, sample_path
from .recording import Recorder, Recording, replay
from .viewer import Viewer

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
