"""The motions of docs/first-drive.md are as slow as the page says."""

from pathlib import Path

import numpy as np
import pytest

from omnidrive import Pose, load_waypoints
from omnidrive.reference import SampledReference
from tests.docs.blocks import blocks

PAGE = Path(__file__).parents[2] / "docs" / "first-drive.md"
FILES = {block.title: block.text for block in blocks(PAGE) if block.title.endswith(".csv")}
ENDS = {
    "slow-x.csv": Pose(0.2, 0.0, 0.0),
    "slow-y.csv": Pose(0.0, 0.2, 0.0),
    "slow-turn.csv": Pose(0.0, 0.0, 0.5),
}


@pytest.mark.parametrize("name", ENDS)
def test_slow_motions_go_from_rest_to_rest(name, tmp_path):
    (tmp_path / name).write_text(FILES[name])
    motion = load_waypoints(tmp_path / name)
    assert isinstance(motion, SampledReference)
    assert motion.duration == 10.0
    assert motion.at(0.0).pose == Pose(0.0, 0.0, 0.0)
    assert motion.at(10.0).pose == pytest.approx(ENDS[name])
    twists = np.array([motion.at(t).twist for t in np.linspace(0.0, 10.0, 101)])
    assert twists[[0, -1]] == pytest.approx(0.0, abs=1e-12)
    assert np.abs(twists).max(axis=0) == pytest.approx(0.15 * np.array(ENDS[name]), rel=1e-3)


def test_every_file_of_the_page_is_one_of_these():
    assert set(FILES) == set(ENDS)
