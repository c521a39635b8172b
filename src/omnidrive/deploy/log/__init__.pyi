from .drive_log import DriveLog, LogFolder, LogSummary
from .logged_drive import LoggedDrive, read_log
from .logged_sample import LoggedSample, Segment

__all__ = [
    "DriveLog",
    "LogFolder",
    "LogSummary",
    "LoggedDrive",
    "LoggedSample",
    "Segment",
    "read_log",
]
