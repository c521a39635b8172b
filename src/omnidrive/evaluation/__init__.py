"""Numbers, pictures and pages about runs."""

from omnidrive.evaluation.metrics import Metrics, heading_error, measure, position_error

__all__ = ["Metrics", "heading_error", "measure", "position_error"]
