"""Settings of drives in a graph of ROS 2."""

import pytest

from omnidrive.deploy.ros2.drive_settings import DriveSettings
from omnidrive.errors import InvalidInput


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("holonomic-nmpc,horizn=15", "the controller holonomic-nmpc: .*did you mean 'horizon'"),
        ("holonomic-nmpc,horizon=-1", "horizon is -1 steps, need 1 to 200 steps"),
        ("pid,x=1", "the controller pid: has no parameter 'x'; there are preset"),
        ("nosuch", "there is no controller 'nosuch'"),
    ],
)
def test_wrong_parameters_of_the_controller_are_refused(text, message):
    settings = DriveSettings(robot="mecanum", controller=text)
    with pytest.raises(InvalidInput, match=message):
        settings.make_pipeline(settings.make_robot())
