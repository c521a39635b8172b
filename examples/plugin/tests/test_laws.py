"""The laws that every controller must obey."""

from omnidrive_decay import DecayController

from omnidrive.testing import check_controller


def test_laws() -> None:
    """The controller obeys every law."""
    check_controller(DecayController)
