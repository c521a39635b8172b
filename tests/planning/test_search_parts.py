"""Parts of the grid search: bitmaps, integer lengths, jump points, lines of sight."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from omnidrive.planning.search import astar as astar_module
from omnidrive.planning.search.astar import AStar
from omnidrive.planning.search.bit_tiles import empty_tiles, tile_index
from omnidrive.planning.search.bitgrid import BitGrid
from omnidrive.planning.search.heuristics import DIAGONAL, HEURISTICS, STRAIGHT
from omnidrive.planning.search.interruptible import completed
from omnidrive.planning.search.jump_grid import JUMP, JumpGrid, jumps
from omnidrive.planning.search.lazy_theta import has_line_of_sight
from omnidrive.planning.search.moves import MOVES, neighbourhood, pruned_moves
from tests.examples import examples
from tests.planning.test_search import line_is_clear


def random_map(shape, seed, density=0.4):
    return np.random.default_rng(seed).random(shape) < density


SHAPES = st.tuples(st.integers(1, 140), st.integers(1, 140))


@examples(60)
@given(shape=SHAPES, seed=st.integers(0, 99))
def test_bitgrid_matches_its_grid(shape, seed):
    occupied = random_map(shape, seed)
    bitgrid = BitGrid.of(occupied)
    bits = np.unpackbits(bitgrid.bits, bitorder="little")
    cells = np.random.default_rng(seed).permutation(list(np.ndindex(shape)))[:200]
    indices = np.array([bitgrid.index_of(tuple(cell)) for cell in cells.tolist()])
    assert (bits[indices] == occupied[tuple(cells.T)]).all()
    assert (bitgrid.cells(indices) == cells).all()
    assert np.count_nonzero(bits == 0) == np.count_nonzero(~occupied)  # the border is occupied


def first_end(occupied, row, col, move):
    """Count the cells to the next forced neighbour, cell by cell; 0 if the run ends at a wall."""
    padded = np.pad(occupied, 1, constant_values=True)
    r, c, run = row + 1, col + 1, 0
    side = move[::-1]
    while True:
        r, c, run = r + move[0], c + move[1], run + 1
        if padded[r, c]:
            return 0
        for sign in (1, -1):
            beside = r + sign * side[0], c + sign * side[1]
            if padded[beside[0] - move[0], beside[1] - move[1]] and not padded[beside]:
                return run


def jumps_of(occupied, bitgrid, cells, move):
    """Yield the jump points of a move from each cell, as found and as expected cell by cell."""
    jump_grid, found = JumpGrid.of(bitgrid), np.zeros(4 * sum(occupied.shape), JUMP)
    steps, nowhere = [np.array(m[:: -1 if bitgrid.transposed else 1]) for m in MOVES], 0
    padded = np.pad(occupied, 1, constant_values=True)
    for cell in cells:
        at, diagonal, expected = np.array(cell), 0, set()
        beside = [m for m in range(4) if move == m or (move >= 4 and steps[m] @ steps[move] > 0)]
        while True:
            if move >= 4:
                corner = [at + 1 + step for step in (steps[move], *(steps[m] for m in beside))]
                if any(padded[tuple(c)] for c in corner):
                    break
                at, diagonal = at + steps[move], diagonal + DIAGONAL
            for m in beside:
                run = first_end(occupied, *at, tuple(steps[m]))
                there = bitgrid.index_of(tuple((at + run * steps[m]).tolist()))
                expected |= {(there, diagonal + run * STRAIGHT, m)} if run else set()
            if move < 4:
                break
        if move < 4 or diagonal > 0:  # other diagonal moves are not allowed
            index_of = bitgrid.index_of(tuple(cell))
            count = jumps(jump_grid, bitgrid.stride, index_of, nowhere, 1 << move, found)
            yield sorted(found[:count].tolist()), sorted(expected)


DENSITIES = st.one_of(st.floats(0.0, 0.5), st.floats(0.0, 0.01))


@examples(60)
@given(shape=SHAPES, seed=st.integers(0, 99), density=DENSITIES, move=st.integers(0, 7))
def test_jump_points_match_a_scan_cell_by_cell(shape, seed, density, move):
    occupied = random_map(shape, seed, density)
    occupied[0, 0] = False
    cells = np.random.default_rng(seed).permutation(np.argwhere(~occupied))[:10].tolist()
    for found, expected in jumps_of(occupied, BitGrid.of(occupied), cells, move):
        assert found == expected


@pytest.mark.parametrize("move", range(4))
def test_jump_points_at_every_distance(move):
    """A run starts at any bit of a byte and continues over words of 64 bits."""
    occupied = np.zeros((20, 260), bool)
    occupied[10, 130] = True
    cells = [(9, col) for col in range(260)]
    if move in {1, 3}:
        occupied, cells = occupied.T, [cell[::-1] for cell in cells]
    compared = list(jumps_of(occupied, BitGrid.of(occupied), cells, move))
    assert sum(len(expected) for _, expected in compared) >= 129
    assert all(found == expected for found, expected in compared)


@pytest.mark.parametrize("shape", [(1, 1), (64, 65), (600, 1100), (1100, 600)])
def test_columns_are_the_rows_of_the_transposed_map(shape):
    occupied = random_map(shape, 1)
    columns = JumpGrid.of(BitGrid.of(occupied)).columns
    assert (columns[::8] == BitGrid.of(occupied.T).words).all()


@given(seed=st.integers(0, 99), row=st.integers(0, 8), col=st.integers(0, 129))
def test_neighbourhood(seed, row, col):
    occupied = random_map((9, 130), seed)
    bitgrid = BitGrid.of(occupied)
    around = np.pad(occupied, 1, constant_values=True)[row : row + 3, col : col + 3]
    index_of = neighbourhood(bitgrid.bits, bitgrid.stride, bitgrid.index_of((row, col)))
    assert index_of == around.ravel() @ (1 << np.arange(9))


COUNTS = st.integers(0, 400_000)


@given(one=st.tuples(COUNTS, COUNTS), apart=st.tuples(st.integers(-9, 9), st.integers(-9, 9)))
def test_integer_lengths_compare_like_true_lengths(one, apart):
    """For close pairs: straight moves replace diagonal moves in a ratio close to sqrt(2)."""
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


@examples(300)
@given(
    shape=st.tuples(st.integers(1, 12), st.integers(1, 12)), seed=st.integers(0, 999),
    ends=st.tuples(*[st.floats(0, 0.999)] * 4), density=st.floats(0.0, 0.3),
)  # fmt: skip
def test_lines_of_sight(shape, seed, ends, density):
    occupied = random_map(shape, seed, density)
    one, other = (int(ends[0] * shape[0]), int(ends[1] * shape[1])), (
        int(ends[2] * shape[0]), int(ends[3] * shape[1]))  # fmt: skip
    occupied[one] = occupied[other] = False
    bitgrid = BitGrid.of(occupied)
    visible = has_line_of_sight(
        bitgrid.bits, bitgrid.stride, bitgrid.index_of(one), bitgrid.index_of(other)
    )
    assert visible == line_is_clear(occupied, one, other)


@pytest.mark.parametrize("shape", [(1, 1), (1, 64), (64, 1), (65, 65), (200, 3)])
def test_bitgrid_size_is_bounded(shape):
    bitgrid = BitGrid.of(np.zeros(shape, bool))
    assert bitgrid.size <= 3 * (shape[0] + 63) * (shape[1] + 128)


@pytest.mark.parametrize("wide", [False, True])
@pytest.mark.parametrize("shape", [(1, 1), (3, 70), (140, 9), (61, 130)])
def test_every_cell_has_its_own_word(shape, wide):
    bitgrid = BitGrid.of(np.zeros(shape, bool))
    words = empty_tiles(bitgrid, wide)
    assert not words.any()
    cells = np.argwhere(np.ones((bitgrid.size // bitgrid.stride, bitgrid.stride)))
    indices = {tile_index(bitgrid.stride, row, col) for row, col in cells.tolist()}
    assert len(indices) == bitgrid.size
    assert min(indices) >= 0
    assert max(indices) < len(words)


@pytest.mark.parametrize("shape", [(4096, 4096), (1, 5_000_000), (2_500_000, 2)])
def test_memory_of_words_is_bounded(shape):
    bitgrid = BitGrid.of(np.zeros(shape, bool))
    assert empty_tiles(bitgrid, wide=False).nbytes < 200e6
    assert empty_tiles(bitgrid, wide=True).nbytes < 400e6


def serpentine():
    """Create a map with a path of about 20,000 cells, longer than the stored low bits span."""
    occupied = np.zeros((150, 300), bool)
    occupied[1::2] = True
    occupied[1::4, -1] = occupied[3::4, 0] = False
    return occupied


@pytest.mark.parametrize("heuristic", ["octile", "euclidean", "zero"])
@pytest.mark.parametrize("cut_corners", [False, True])
@pytest.mark.parametrize("neighbours", [4, 8])
def test_low_bits_of_lengths_suffice(monkeypatch, heuristic, cut_corners, neighbours):
    """With a consistent heuristic, the search equals that with full lengths."""
    maps = [serpentine(), *(random_map((700, 600), seed, seed / 10) for seed in (1, 2, 3))]
    move_table = pruned_moves(neighbours, cut_corners)
    for occupied in maps:
        bitgrid = BitGrid.of(occupied)
        free = np.argwhere(~occupied)
        ends = [bitgrid.index_of(tuple(free[i].tolist())) for i in (0, len(free) - 1)]
        path, expansions = completed(AStar(bitgrid, *ends, move_table, HEURISTICS[heuristic]))
        with monkeypatch.context() as patch:
            patch.setattr(
                astar_module, "empty_tiles", lambda bitgrid, wide: empty_tiles(bitgrid, True)
            )
            whole, as_many = completed(AStar(bitgrid, *ends, move_table, HEURISTICS[heuristic]))
        assert expansions == as_many
        assert (path == whole).all()
