"""What a run looks like: in a window while it happens, or in a film afterwards."""

from omnidrive.simulation.show.camera import CameraName, camera_of, follow, follows, frame
from omnidrive.simulation.show.canvas import Canvas
from omnidrive.simulation.show.film import check_film, film
from omnidrive.simulation.show.marks import Marks, path_of
from omnidrive.simulation.show.onlooker import Onlooker, Scene, watched
from omnidrive.simulation.show.puppet import Puppet
from omnidrive.simulation.show.recording import Recorder, Recording, replay
from omnidrive.simulation.show.viewer import Viewer

__all__ = [
    "CameraName",
    "Canvas",
    "Marks",
    "Onlooker",
    "Puppet",
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
    "path_of",
    "replay",
    "watched",
]
