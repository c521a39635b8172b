"""Randomly generated maps."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.ndimage import label

from omnidrive.errors import InvalidInput
from omnidrive.maps import maze_map, random_map, rooms_map, warehouse_map
from tests.examples import examples

MAKERS = {
    "random": lambda rng: random_map(40, 60, 0.2, rng, resolution=0.1),
    "maze": lambda rng: maze_map(41, 61, 2, rng, resolution=0.1),
    "rooms": lambda rng: rooms_map(40, 60, 7, rng, resolution=0.1),
    "warehouse": lambda rng: warehouse_map(40, 60, rng, resolution=0.1),
}


@pytest.mark.parametrize("make", MAKERS.values(), ids=MAKERS)
def test_seed_determines_the_map(make):
    first, again, other = (make(np.random.default_rng(seed)) for seed in (5, 5, 6))
    assert (first.occupied == again.occupied).all()
    assert (first.occupied != other.occupied).any()
    assert (first.resolution, first.origin, first.walled) == (0.1, (0.0, 0.0), True)
    assert first.occupied.shape in {(40, 60), (41, 61)}


def test_density_of_obstacles():
    for density in (0.0, 0.1, 0.2, 1.0):
        share = random_map(500, 400, density, np.random.default_rng(1)).occupied.mean()
        assert share == pytest.approx(density, abs=0.004)


@examples(40)
@given(
    rows=st.integers(3, 40), cols=st.integers(3, 40), corridor=st.integers(1, 5),
    seed=st.integers(0, 99),
)  # fmt: skip
def test_maze_is_perfect(rows, cols, corridor, seed):
    """Its junctions form a tree: connected, with one passage fewer than junctions."""
    if corridor > min(rows, cols) - 2:
        return
    grid = maze_map(rows, cols, corridor, np.random.default_rng(seed))
    free = ~grid.occupied
    assert free.shape == (rows, cols)
    assert label(free)[1] == 1
    junctions = ((rows - 1) // (corridor + 1)) * ((cols - 1) // (corridor + 1))
    passages = junctions - 1
    assert free.sum() == junctions * corridor**2 + passages * corridor
    assert not free[0].any()
    assert not free[:, -1].any()


@examples(40)
@given(
    rows=st.integers(1, 40), cols=st.integers(1, 40), room=st.integers(1, 9),
    door=st.integers(1, 9), seed=st.integers(0, 99),
)  # fmt: skip
def test_rooms_are_connected(rows, cols, room, door, seed):
    if door > room or min(rows, cols) < door:
        return
    occupied = rooms_map(rows, cols, room, np.random.default_rng(seed), door=door).occupied
    assert label(~occupied)[1] == 1
    across = [min(room, rows - r) for r in range(0, rows, room + 1) if rows - r >= door]
    along = [min(room, cols - c) for c in range(0, cols, room + 1) if cols - c >= door]
    doors = (len(across) - 1) * len(along) + len(across) * (len(along) - 1)
    assert (~occupied).sum() == sum(across) * sum(along) + doors * door


def test_shelves_are_arranged_in_rows():
    grid = warehouse_map(9, 26, np.random.default_rng(0), shelf=(2, 10), aisle=2, filled=1.0)
    expected = np.zeros((9, 26), bool)
    expected[2:4, 2:12] = expected[2:4, 14:24] = (
        True  # no second row, because its aisle does not fit
    )
    assert (grid.occupied == expected).all()
    full = warehouse_map(50, 60, np.random.default_rng(0), filled=1.0).occupied.sum()
    some = warehouse_map(50, 60, np.random.default_rng(0), filled=0.5).occupied
    assert not warehouse_map(50, 60, np.random.default_rng(0), filled=0.0).occupied.any()
    assert some.sum() == pytest.approx(full / 2, rel=0.3)
    assert label(~some)[1] == 1


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda rng: random_map(0, 5, 0.1, rng), "random map has no cells"),
        (lambda rng: random_map(9000, 9000, 0.1, rng), "more than 50,000,000 cells"),
        (lambda rng: random_map(5, 5, 1.5, rng), "density of obstacles must be from 0 to 1"),
        (lambda rng: random_map(5, 5, float("nan"), rng), "must be from 0 to 1, got nan"),
        (lambda rng: maze_map(9, 9, 0, rng), "must be 1 to 7 cells wide, got 0"),
        (lambda rng: maze_map(9, 9, 8, rng), "must be 1 to 7 cells wide, got 8"),
        (lambda rng: rooms_map(9, 9, 3, rng, door=4), "the width of a door must be 1 to 3 cells"),
        (lambda rng: rooms_map(9, 9, 0, rng), "the width of a door must be 1 to 0 cells"),
        (lambda rng: warehouse_map(9, 9, rng, aisle=0), "must be at least one cell wide"),
        (lambda rng: warehouse_map(9, 9, rng, filled=-0.1), "must be from 0 to 1"),
    ],
)
def test_invalid_arguments_are_rejected(make, message):
    with pytest.raises(InvalidInput, match=message):
        make(np.random.default_rng(0))
