"""Lookup surface: exact at its nodes, with a measured error."""

from dataclasses import replace

import numpy as np
import pytest

from omnidrive.errors import InvalidInput
from omnidrive.fuzzy.files import load
from omnidrive.fuzzy.inference import Inference
from omnidrive.fuzzy.surface import MAX_NODES, LookupSurface
from omnidrive.fuzzy.variables import Footprint
from tests.shared_data import shared


def paper(**options):
    return Inference(load(shared("paper/IT1FUZZY.fis")), **options)


def grid(inference, nodes):
    axes = [np.linspace(v.low, v.high, nodes) for v in inference.system.inputs]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes))


def test_surface_equals_system_at_nodes():
    inference = paper()
    surface = LookupSurface(inference, nodes=21)
    at = grid(inference, 21)
    np.testing.assert_allclose(surface.batch(at), inference(at), atol=1e-13)
    np.testing.assert_array_equal(surface(*at[37]), surface.batch(at[37:38])[0])


def test_surface_is_bilinear_between_nodes():
    inference = paper()
    surface = LookupSurface(inference, nodes=5)
    corners = inference(np.array([[0.0, 0.5], [0.5, 0.5], [0.0, 1.0], [0.5, 1.0]]))
    found = surface(0.1, 0.9)
    expected = np.array([0.8 * 0.2, 0.2 * 0.2, 0.8 * 0.8, 0.2 * 0.8]) @ corners
    np.testing.assert_allclose(found, expected, atol=1e-14)


def test_error_is_difference_at_reported_point():
    inference = paper()
    surface = LookupSurface(inference, nodes=31)
    assert [e.output for e in surface.errors] == ["kp", "ki", "kd"]
    for o, error in enumerate(surface.errors):
        difference = abs(surface(*error.at)[o] - inference(*error.at)[o])
        assert difference == pytest.approx(error.size, rel=1e-12)


def test_error_at_other_points_is_similar():
    inference = paper()
    surface = LookupSurface(inference, nodes=31)
    at = np.random.default_rng(5).uniform(-1, 1, (200_000, 2))
    middles = grid(inference, 30) * (29 / 30)  # centres of the 30 cells along each input
    for points, factor in ((at, 1.1), (middles, 1.0 + 1e-9)):
        worst = np.abs(surface.batch(points) - inference(points)).max(axis=0)
        assert (worst <= factor * np.array([e.size for e in surface.errors])).all()


def test_error_decreases_with_nodes():
    sizes = [max(e.size for e in LookupSurface(paper(), nodes=n).errors) for n in (11, 41, 161)]
    assert sizes[0] > 2 * sizes[1] > 4 * sizes[2]


def test_inputs_beyond_range_are_clamped():
    surface = LookupSurface(paper(), nodes=11)
    np.testing.assert_array_equal(surface(-7.0, 1e300), surface(-1.0, 1.0))


@pytest.mark.parametrize("nodes", [7, 11, 50, 201])
def test_grid_has_no_point_beyond_range_by_rounding(nodes):
    """The last node of a range such as [-0.1, 0.3] equals its end to the last bit."""
    system = load(shared("paper/IT1FUZZY.fis"))
    inputs = tuple(replace(v, low=-0.1, high=0.3 + 1e-3 * k) for k, v in enumerate(system.inputs))
    run = Inference(replace(system, inputs=inputs), out_of_range="raise")
    assert LookupSurface(run, nodes=nodes).errors[0].size < 0.2


def test_surface_of_type_2():
    system = load(shared("paper/IT1FUZZY.fis")).with_footprint(Footprint(1.0, 0.3))
    surface = LookupSurface(Inference(system), nodes=41)
    assert max(e.size for e in surface.errors) < 0.05


def test_random_points_are_repeatable_without_generator():
    errors = [LookupSurface(paper(), nodes=12).errors for _ in range(2)]
    assert errors[0] == errors[1]
    LookupSurface(paper(), nodes=12, rng=np.random.default_rng(9))


@pytest.mark.parametrize("nodes", [-1, 0, 1, int(MAX_NODES**0.5) + 1, 10**9])
def test_invalid_number_of_nodes_is_refused(nodes):
    with pytest.raises(InvalidInput, match="nodes along each"):
        LookupSurface(paper(), nodes=nodes)


@pytest.mark.parametrize("x", [(0.0,), (0.0, 0.0, 0.0), (np.nan, 0.0), (0.0, np.inf)])
def test_bad_inputs_are_refused(x):
    with pytest.raises(InvalidInput):
        LookupSurface(paper(), nodes=3)(*x)
