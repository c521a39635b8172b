"""HTML report of a study: one self-contained file with playback, charts and tables."""

from omnidrive.evaluation.page.markup import PageFigure
from omnidrive.evaluation.page.writer import page_text, write_page

__all__ = ["PageFigure", "page_text", "write_page"]
