from dataclasses import replace

import numpy as np
import pytest

from fronto.pose.bundle import FIRST_GROUP, MAX_GLOBALS, Solution
from fronto.pose.observations import observations
from fronto.pose.starts import initial_parameters
from fronto.pose.structure import (
    base_model,
    chains,
    numbered,
    size_groups,
    tied_model,
    typical_width,
)
from fronto.synth import LayoutButton


def solved(view, square=False):
    """Observations, base model and the exact solution of a view."""
    seen = observations(view.outlines, view.camera)
    model = base_model(seen, numbered(seen.kind), square, -1.0)
    _, parameters, xy = initial_parameters(seen, model, view.rotation[None], keep=1)
    none = np.zeros(0)
    return seen, model, Solution(view.rotation, parameters[0], xy[0], none, none, 0, 0, 0, True)


def same_partition(labels, expected):
    return numbered(np.asarray(labels)).tolist() == numbered(np.asarray(expected)).tolist()


def test_chains_by_hand():
    values = np.array([5.0, 0.0, 0.9, 2.0, 5.5])
    assert chains(values, 1.0).tolist() == [2, 0, 0, 1, 2]
    # Neighbours chain up although the ends are far apart.
    assert chains(np.array([0.0, 0.8, 1.6]), 1.0).tolist() == [0, 0, 0]
    assert chains(np.array([3.0]), 1.0).tolist() == [0]


def test_numbered_keeps_the_partition():
    assert numbered(np.array([7, 7, 7])).tolist() == [0, 0, 0]
    assert numbered(np.array([9, 2, 9, 5])).tolist() == [2, 0, 2, 1]


def test_base_model_ties_nothing_and_squares_quads_only(view):
    buttons = [
        LayoutButton(0, -0.03, 0.03, 0.03),
        LayoutButton(0, 0.03, 0.03, 0.03, "ellipse"),
    ]
    seen = observations(view(buttons, (10, 10, 0)).outlines, view(buttons, (10, 10, 0)).camera)
    model = base_model(seen, numbered(seen.kind), True, 2.0)
    assert model.group.tolist() == [0, 1]
    assert model.square_isd[0] > 0
    assert model.square_isd[1] == 0
    assert model.focal_isd == 2.0
    assert (model.tie_index == -1).all()
    assert model.size == FIRST_GROUP + 4
    assert base_model(seen, numbered(seen.kind), False, -1.0).square_isd.tolist() == [0, 0]


@pytest.mark.parametrize("shape", ["quad", "ellipse"])
def test_rows_and_columns_are_found_on_the_plane(view, grid, shape):
    # Tilted and rolled by 30°: in the photo nothing lines up.
    panel = view(grid(3, 4, shape=shape), (25, -25, 30))
    _, model, solution = solved(panel)
    tied = tied_model(model, solution.xy, typical_width(model, solution))
    columns, rows = tied.tie_index[:, 0], tied.tie_index[:, 2]
    assert same_partition(columns, [0, 1, 2] * 4)
    assert same_partition(rows, np.repeat([0, 1, 2, 3], 3))
    assert tied.latents == 7
    assert sorted({*columns.tolist(), *rows.tolist()}) == list(range(7))
    assert (tied.tie_index[:, 1::2] == -1).all()
    np.testing.assert_array_equal(tied.tie_coef[:, ::2], 1.0)
    assert (tied.tie_isd > 0).all()


def test_staggered_rows_are_columns_of_their_own(view, grid):
    # Every other row half a button to the right: four columns, not two.
    buttons = [replace(b, x=b.x + 0.015 * (k // 2 % 2)) for k, b in enumerate(grid(2, 4))]
    _, model, solution = solved(view(buttons, (15, -10, 5)))
    tied = tied_model(model, solution.xy, typical_width(model, solution))
    assert same_partition(tied.tie_index[:, 0], [0, 2, 1, 3] * 2)
    assert same_partition(tied.tie_index[:, 2], np.repeat([0, 1, 2, 3], 2))


def test_a_button_by_itself_is_not_tied(view, grid):
    odd = LayoutButton(0.02, 0.13, 0.03, 0.03)  # between the columns, below the rows
    _, model, solution = solved(view((*grid(2, 3), odd), (10, 20, 5), distance_m=0.7))
    tied = tied_model(model, solution.xy, typical_width(model, solution))
    assert tied.tie_index[-1, 2] == -1
    assert tied.tie_isd[-1, 1] == 0
    assert tied.tie_index[:-1, 2].min() >= 0


def test_a_column_of_one_row_each(view, grid):
    _, model, solution = solved(view(grid(1, 3), (10, 20, 5)))
    tied = tied_model(model, solution.xy, typical_width(model, solution))
    assert tied.tie_index[:, 0].tolist() == [0, 0, 0]
    assert tied.tie_index[:, 2].tolist() == [-1, -1, -1]
    assert tied.latents == 1


def test_more_rows_than_fit_are_left_untied(view, grid):
    panel = view(grid(2, 2), (5, 5, 0))
    seen, _, solution = solved(panel)
    count = 300
    first = seen.kind[:1]
    many = replace(
        seen,
        kind=np.repeat(first, 2 * count),
        observed=np.repeat(seen.observed[:1], 2 * count, axis=0),
        inverse_sd=np.repeat(seen.inverse_sd[:1], 2 * count, axis=0),
    )
    model = base_model(many, numbered(many.kind), False, -1.0)
    y, x = np.divmod(np.arange(2 * count), 2)
    xy = np.column_stack([x, y]).astype(float)
    tied = tied_model(model, xy, typical_width(model, solution))
    assert tied.size <= MAX_GLOBALS
    assert tied.tie_index.max() == tied.latents - 1
    assert (tied.tie_index[:, 0] >= 0).all()


def test_wide_buttons_are_a_group_of_their_own(view, grid):
    wide = (LayoutButton(-0.04, 0.1, 0.06, 0.03), LayoutButton(0.04, 0.1, 0.06, 0.03))
    seen, model, solution = solved(view((*grid(2, 3), *wide), (20, -15, 5), distance_m=0.7))
    labels = size_groups(seen, solution, model)
    assert same_partition(labels, [0] * 6 + [1] * 2)


def test_quads_and_circles_are_never_one_group(view, grid):
    buttons = (*grid(2, 2), LayoutButton(0, 0.08, 0.03, 0.03, "ellipse"))
    seen, model, solution = solved(view(buttons, (20, -15, 5)))
    assert same_partition(size_groups(seen, solution, model), [0] * 4 + [1])


def test_noise_makes_no_groups(view, grid):
    # σ = 1 px on 20 px sides: sizes differ by far more than a tenth, by chance only.
    panel = view(grid(2, 4), (10, 10, 0)).noisy(1, 1.0)
    seen, model, solution = solved(panel)
    assert set(size_groups(seen, solution, model).tolist()) == {0}
