"""Named shapes of reference motions: parameters, and curves with exact derivatives."""

from omnidrive.reference.shapes.circle import Circle
from omnidrive.reference.shapes.eight import Eight
from omnidrive.reference.shapes.raised_cosine import RaisedCosine
from omnidrive.reference.shapes.random_smooth import RandomSmooth
from omnidrive.reference.shapes.shape import PlaneCurve, Shape
from omnidrive.reference.shapes.slalom import Slalom
from omnidrive.reference.shapes.square import Square

__all__ = [
    "Circle",
    "Eight",
    "PlaneCurve",
    "RaisedCosine",
    "RandomSmooth",
    "Shape",
    "Slalom",
    "Square",
]
