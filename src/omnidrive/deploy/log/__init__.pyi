from .drive_log import DriveLog, LogFolder, LogSummary
from .logged_drive import RUN_LOG, LoggedDrive, read_log
from .logged_sample import LoggedSample, Segment

__all__ = [
    "RUN_LOG",
    "DriveLog",
    "LogFolder",
    "LogSummary",
    "LoggedDrive",
    "LoggedSample",
    "Segment",
    "read_log",
]
