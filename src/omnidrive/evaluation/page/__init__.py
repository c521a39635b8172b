"""HTML report of a study: one self-contained file with playback, charts and tables."""

from omnidrive.evaluation.page.writer import page_text, write_page

__all__ = ["page_text", "write_page"]
