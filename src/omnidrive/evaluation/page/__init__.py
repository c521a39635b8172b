"""The report: one file that plays the runs and shows every table."""

from omnidrive.evaluation.page.writer import page_text, write_page

__all__ = ["page_text", "write_page"]
