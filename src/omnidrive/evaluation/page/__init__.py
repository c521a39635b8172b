"""HTML report of a study: one self-contained file with playback, charts and tables."""

from omnidrive.evaluation.page.markup import PageFigure
from omnidrive.evaluation.page.plan_page import PlanPage
from omnidrive.evaluation.page.report import StudyPage

__all__ = ["PageFigure", "PlanPage", "StudyPage"]
