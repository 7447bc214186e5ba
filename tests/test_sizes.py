"""The library of sizes: sound, with sources, and used as it is meant."""

from __future__ import annotations

import pytest

from fronto.errors import InputError
from fronto.metric import KnownLength
from fronto.sizes import button_sizes, known_size, smallest_button_m


def test_every_size_is_sound_and_has_its_source() -> None:
    sizes = button_sizes()
    assert len({size.name for size in sizes}) == len(sizes)
    for size in sizes:
        assert 10 < size.size_mm < 60
        assert size.url.startswith("http")
        # The source says the number.
        assert f"{size.size_mm:g}" in size.source
        assert (size.std_mm is not None) == (size.kind == "nominal")
        if size.gap_mm is not None:
            assert f"{size.gap_mm:g} mm" in size.source


def test_standards_are_minima() -> None:
    kinds = {size.name: (size.kind, size.size_mm) for size in button_sizes()}
    assert kinds["ada"] == ("minimum", 19)
    assert kinds["en81-70"] == ("minimum", 20)
    assert kinds["en81-70-xl"] == ("minimum", 50)
    assert smallest_button_m() == pytest.approx(0.019)


def test_nominal_sizes_are_lengths_to_measure_by() -> None:
    size = known_size("siemens-3su1-22")
    known = KnownLength(button_size_m=size.size_m, std_m=size.std_m)
    assert known.button_size_m == pytest.approx(0.02945)


@pytest.mark.parametrize("name", ["ada", "en81-70-xl", "kone", ""])
def test_minima_and_unknown_names_are_none(name: str) -> None:
    with pytest.raises(InputError, match="siemens-3su1-22"):
        known_size(name)
