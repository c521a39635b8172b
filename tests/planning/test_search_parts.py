"""The parts of the grid search: boards, whole-number lengths, lines of sight."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from omnidrive.planning.search.board import BitBoard
from omnidrive.planning.search.jump_board import transposed
from omnidrive.planning.search.lazy_theta import sees
from omnidrive.planning.search.lengths import DIAGONAL, STRAIGHT
from omnidrive.planning.search.moves import surroundings
from tests.planning.test_search import line_is_clear


def random_map(shape, seed, density=0.4):
    return np.random.default_rng(seed).random(shape) < density


SHAPES = st.tuples(st.integers(1, 140), st.integers(1, 140))


@settings(max_examples=60, deadline=None)
@given(shape=SHAPES, seed=st.integers(0, 99))
def test_a_board_holds_its_grid(shape, seed):
    occupied = random_map(shape, seed)
    board = BitBoard.of(occupied)
    bits = np.unpackbits(board.bits, bitorder="little")
    numbers = np.array([board.number(cell) for cell in np.ndindex(shape)])
    assert (bits[numbers].reshape(shape) == occupied).all()
    assert (board.cells(numbers) == np.argwhere(np.ones(shape, bool))).all()
    bits[numbers] = 1
    assert bits.all()  # the border is occupied


@settings(max_examples=60, deadline=None)
@given(shape=SHAPES, seed=st.integers(0, 99))
def test_transposed_boards(shape, seed):
    occupied = random_map(shape, seed)
    board, other = BitBoard.of(occupied), transposed(BitBoard.of(occupied))
    turned = BitBoard.of(occupied if board.turned else occupied.T)
    if not turned.turned:
        assert (other.words == turned.words).all()
        assert other.stride == turned.stride


@given(seed=st.integers(0, 99), row=st.integers(0, 8), col=st.integers(0, 129))
def test_surroundings(seed, row, col):
    occupied = random_map((9, 130), seed)
    board = BitBoard.of(occupied)
    around = np.pad(occupied, 1, constant_values=True)[row : row + 3, col : col + 3]
    number = surroundings(board.bits, board.stride, board.number((row, col)))
    assert number == around.ravel() @ (1 << np.arange(9))


COUNTS = st.integers(0, 400_000)


@given(one=st.tuples(COUNTS, COUNTS), apart=st.tuples(st.integers(-9, 9), st.integers(-9, 9)))
def test_whole_numbers_compare_as_lengths_do(one, apart):
    """For close pairs: straight moves are exchanged for diagonal ones in a ratio near sqrt(2)."""
    diagonal = apart[0] * 33461 + apart[1] * 985
    straight = apart[0] * -47321 + apart[1] * -1393
    sign = (straight > 0) - (straight < 0)
    exact = (
        sign * straight**2 + ((diagonal > 0) - (diagonal < 0)) * 2 * diagonal**2
    )  # the sign of straight + diagonal * sqrt(2), for opposite signs or one of them zero
    if abs(diagonal) >= STRAIGHT or straight * diagonal > 0:
        return
    ours = (one[0] + straight) * STRAIGHT + (one[1] + diagonal) * DIAGONAL
    ours -= one[0] * STRAIGHT + one[1] * DIAGONAL
    assert np.sign(ours) == np.sign(exact)


@settings(max_examples=300, deadline=None)
@given(
    shape=st.tuples(st.integers(1, 12), st.integers(1, 12)), seed=st.integers(0, 999),
    ends=st.tuples(*[st.floats(0, 0.999)] * 4), density=st.floats(0.0, 0.3),
)  # fmt: skip
def test_lines_of_sight(shape, seed, ends, density):
    occupied = random_map(shape, seed, density)
    one, other = (int(ends[0] * shape[0]), int(ends[1] * shape[1])), (
        int(ends[2] * shape[0]), int(ends[3] * shape[1]))  # fmt: skip
    occupied[one] = occupied[other] = False
    board = BitBoard.of(occupied)
    seen = sees(board.bits, board.stride, board.number(one), board.number(other))
    assert seen == line_is_clear(occupied, one, other)


@pytest.mark.parametrize("shape", [(1, 1), (1, 64), (64, 1), (65, 65), (200, 3)])
def test_boards_are_not_much_larger_than_their_grids(shape):
    board = BitBoard.of(np.zeros(shape, bool))
    assert board.size <= 3 * (shape[0] + 63) * (shape[1] + 128)
