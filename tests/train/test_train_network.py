"""The network's maps: shapes, ranges, and where they lie on the picture."""

from __future__ import annotations

from dataclasses import replace

import pytest

torch = pytest.importorskip("torch")

from fronto.categories import CATEGORIES
from fronto.train.network import Network, NetworkOptions, mask_logits

SMALL = NetworkOptions(channels=8, decoder=8)
#: How far the picture's border is felt, with atrous rates of (1, 1, 1).
REACH = 320


@pytest.fixture(scope="module")
def network() -> Network:
    torch.manual_seed(0)
    return Network(SMALL).eval()


@pytest.mark.parametrize(("height", "width", "number"), [(64, 96, 2), (16, 16, 1), (48, 160, 1)])
@torch.no_grad()
def test_shapes(network: Network, height: int, width: int, number: int) -> None:
    maps = network(torch.rand(number, 3, height, width))
    cells = (height // 4, width // 4)
    assert maps.masks.shape == (number, 2, height, width)
    assert maps.classes.shape == (number, len(CATEGORIES), *cells)
    assert maps.centers.shape == (number, 2, *cells)
    assert maps.sides.shape == (number, 4, *cells)
    assert maps.features.shape == (number, SMALL.decoder, *cells)
    assert (maps.sides > 0).all()


@pytest.mark.parametrize("stride", [8, 16])
@pytest.mark.parametrize("separable", [True, False])
@torch.no_grad()
def test_options_keep_the_shapes(stride: int, separable: bool) -> None:
    options = NetworkOptions(channels=6, decoder=4, output_stride=stride, separable=separable)
    network = Network(options).eval()
    deep = network.backbone(torch.rand(1, 3, 64, 64))[-1]
    assert deep.shape[2:] == (64 // stride, 64 // stride)
    assert network(torch.rand(1, 3, 64, 64)).masks.shape == (1, 2, 64, 64)


@pytest.mark.parametrize("vertical", [False, True])
@torch.no_grad()
def test_a_shifted_picture_shifts_every_map(vertical: bool) -> None:
    torch.manual_seed(1)
    network = Network(NetworkOptions(channels=8, decoder=8, rates=(1, 1, 1))).eval().double()
    length = 2 * REACH + 192
    pictures = torch.full((2, 3, 32, length), 0.5, dtype=torch.float64)
    content = torch.rand(3, 32, 96, dtype=torch.float64)
    for k, shift in enumerate((0, 16)):
        pictures[k, :, :, REACH + 32 + shift : REACH + 128 + shift] = content
    if vertical:
        pictures = pictures.transpose(2, 3)
    for values in network(pictures):
        along = values.transpose(2, 3) if vertical else values
        pixels = length // along.shape[3]
        first = along[0, :, :, REACH // pixels : -(REACH + 16) // pixels]
        second = along[1, :, :, (REACH + 16) // pixels : -REACH // pixels]
        assert first.shape == second.shape
        assert first.std() > 1e-6
        assert (first - second).abs().max() < 1e-9


def test_mask_logits_are_those_of_the_classes() -> None:
    logits = torch.randn(2, len(CATEGORIES), 3, 5, generator=torch.Generator().manual_seed(2))
    p = logits.softmax(dim=1)
    masks = mask_logits(logits).sigmoid()
    assert torch.allclose(masks[:, 0], p[:, 1:-1].sum(dim=1), atol=1e-6)
    assert torch.allclose(masks[:, 1], p[:, -1], atol=1e-6)


@torch.no_grad()
def test_details_change_the_buttons_masks_only() -> None:
    torch.manual_seed(3)
    network = Network(SMALL).eval()
    picture = torch.rand(1, 3, 64, 64)
    plain = network(picture)
    coarse = Network(replace(SMALL, details=0)).eval()
    state = network.state_dict()
    coarse.load_state_dict({k: state[k] for k in coarse.state_dict()})
    # Untrained they add nothing.
    assert all(torch.equal(a, b) for a, b in zip(plain, coarse(picture), strict=True))
    assert network.details is not None
    torch.nn.init.normal_(network.details.last.weight)
    sharp = network(picture)
    assert not torch.allclose(sharp.masks[:, 0], plain.masks[:, 0], atol=1e-3)
    assert torch.equal(sharp.masks[:, 1], plain.masks[:, 1])
    # At stride 1: neighbouring pixels of one cell differ by more than a bilinear map's do.
    added = (sharp.masks - plain.masks)[0, 0]
    bend = added[:, 1:-2:4] - 2 * added[:, 2:-1:4] + added[:, 3::4]
    assert bend.abs().max() > 1e-3


@torch.no_grad()
def test_an_untrained_network_reports_next_to_nothing(network: Network) -> None:
    # Its bias says 1 %; what the features add is little.
    centers = network(torch.rand(1, 3, 64, 64)).centers.sigmoid()
    assert 0.002 < float(centers.mean()) < 0.05
