from __future__ import annotations

from itertools import groupby, product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fronto import InputError
from fronto.labels.alphabet import ALPHABET
from fronto.labels.decode import decode

QUICK = settings(derandomize=True, deadline=None, max_examples=30)
SEEDS = st.integers(0, 2**32 - 1)


def softmax(logits):
    values = np.exp(logits - logits.max(axis=-1, keepdims=True))
    return values / values.sum(axis=-1, keepdims=True)


def steps_of(rng, n, count, classes, sharpness):
    return softmax(sharpness * rng.normal(size=(n, count, classes)))


def by_all_paths(steps, alphabet):
    """Texts and probabilities by going through every path there is."""
    found = {}
    for path in product(range(steps.shape[1]), repeat=len(steps)):
        text = "".join(alphabet[c - 1] for c, _ in groupby(path) if c)
        found[text] = found.get(text, 0) + np.prod(steps[range(len(steps)), path])
    return found


def said(*characters, alphabet=ALPHABET, sure=1.0):
    """Steps that say one character each ("" is the blank), the rest spread evenly."""
    steps = np.full((len(characters), 1 + len(alphabet)), (1 - sure) / len(alphabet))
    for step, character in zip(steps, characters, strict=True):
        step[alphabet.index(character) + 1 if character else 0] = sure
    return steps


@QUICK
@given(SEEDS, st.integers(1, 5), st.floats(0.1, 4.0))
def test_wide_search_finds_every_text_with_its_exact_probability(seed, count, sharpness):
    steps = steps_of(np.random.default_rng(seed), 2, count, 3, sharpness)
    for one, found in zip(steps, decode(steps, "AB", width=99, best=99), strict=True):
        truth = by_all_paths(one, "AB")
        assert dict(found) == pytest.approx(truth, abs=1e-12)
        assert len(found) == len(truth)


@QUICK
@given(SEEDS, st.integers(2, 5), st.integers(1, 4))
def test_narrow_search_may_miss_texts_but_is_right_about_the_others(seed, count, width):
    steps = steps_of(np.random.default_rng(seed), 3, count, 4, 2.0)
    for one, found in zip(steps, decode(steps, "AB*", width=width), strict=True):
        truth = by_all_paths(one, "AB*")
        assert 0 < len(found) <= width
        for text, probability in found:
            assert probability == pytest.approx(truth[text], abs=1e-12)


@QUICK
@given(SEEDS, st.floats(0.5, 6.0))
def test_many_at_once_are_as_one_by_one(seed, sharpness):
    steps = steps_of(np.random.default_rng(seed), 4, 24, 1 + len(ALPHABET), sharpness)
    together = decode(steps, ALPHABET)
    for one, found in zip(steps, together, strict=True):
        assert decode(one[None], ALPHABET) == (found,)
        texts, values = zip(*found, strict=True)
        assert len(set(texts)) == len(texts)
        assert list(values) == sorted(values, reverse=True)
        assert sum(values) <= 1 + 1e-9


def test_few_beginnings_are_enough_for_the_best_text():
    """Paths that come to one text along the way count together for what is kept."""
    right = []
    for seed in range(6):
        steps = steps_of(np.random.default_rng(seed), 10, 6, 3, 1.5)
        for one, ((text, _), *_) in zip(steps, decode(steps, "AB", width=3), strict=True):
            truth = by_all_paths(one, "AB")
            right.append(text == max(truth, key=truth.__getitem__))
    assert np.mean(right) > 0.9  # measured 0.95; 0.72 where they do not


def test_a_text_may_come_again():
    """AB is impossible after AAA or ABA, and not after one more B."""
    steps = said("A", "", "A", "B", alphabet="AB")
    steps[1] = 0, 0.5, 0.5
    expected = (("AB", pytest.approx(0.5)), ("ABAB", pytest.approx(0.5)))
    assert tuple(sorted(decode(steps[None], "AB")[0])) == expected


def test_the_best_text_is_not_the_best_path():
    steps = np.array([[[0.6, 0.4], [0.6, 0.4]]])
    assert decode(steps, "A") == ((("A", pytest.approx(0.64)), ("", pytest.approx(0.36))),)


@pytest.mark.parametrize(
    ("path", "text"),
    [
        (["1", "1", "1"], "1"),
        (["1", "", "1"], "11"),
        (["1", "1", "", "", "1", "1"], "11"),
        (["", "1", "2", ""], "12"),
        (["1", "2", "1"], "121"),
        (["B", "-", "2", ""], "B-2"),
        (["", "", ""], ""),
        (["*"], "*"),
    ],
)
def test_paths_by_hand(path, text):
    ((first, *_),) = decode(said(*path)[None], ALPHABET)
    assert first == (text, pytest.approx(1))
    ((first, *_),) = decode(said(*path, sure=0.97)[None], ALPHABET)
    assert first[0] == text
    assert 0.97 ** len(path) <= first[1] < 1


def test_doubt_about_one_character_is_the_doubt_about_the_text():
    steps = said("", "1", "", "2", "2", "")
    steps[3:5] = 0
    steps[3, [ALPHABET.index("2") + 1, ALPHABET.index("7") + 1]] = 0.7, 0.3
    steps[4, 0] = 1
    assert decode(steps[None], ALPHABET) == (
        (("12", pytest.approx(0.7)), ("17", pytest.approx(0.3))),
    )


def test_long_texts_end_where_64_bits_do():
    letters = "ABCDEFGHIJKLMNOPQRSTUVWX"
    for count in (11, 12):
        ((first, *_),) = decode(said(*letters[:count])[None], ALPHABET)
        assert first == (letters[:count], pytest.approx(1))
    assert all(len(text) <= 12 for text, _ in decode(said(*letters, sure=0.5)[None], ALPHABET)[0])
    assert decode(said(*letters)[None], ALPHABET) == ((),)
    # The fewer characters there are, the longer texts may be.
    path = ["A", ""] * 30
    ((first, *_),) = decode(said(*path, alphabet="A")[None], "A")
    assert first == ("A" * 30, pytest.approx(1))


def test_single_precision_and_half_precision_will_do():
    steps = np.stack([said("", "1", "", "2", "2", sure=sure) for sure in (0.2, 0.5, 0.8, 0.99)])
    exact = decode(steps, ALPHABET)
    for kind, off in ((np.float32, 1e-5), (np.float16, 1e-2)):
        rough = decode(steps.astype(kind), ALPHABET)
        for (one, *_), (other, *_) in zip(exact, rough, strict=True):
            assert one[0] == other[0]
            assert one[1] == pytest.approx(other[1], rel=off)


def test_rough_sums_do_not_add_up():
    ((first, *_),) = decode(1.005 * said(*["1", ""] * 6)[None], ALPHABET)
    assert first == ("1" * 6, pytest.approx(1, abs=1e-12))


def test_nothing_to_decode():
    assert decode(np.zeros((0, 24, 40)), ALPHABET) == ()


def test_as_many_texts_as_asked_for():
    steps = steps_of(np.random.default_rng(5), 1, 24, 1 + len(ALPHABET), 1.0)
    for best in (1, 3, 8):
        assert len(decode(steps, ALPHABET, best=best)[0]) == best
    few = decode(steps, ALPHABET, best=3)[0]
    assert [text for text, _ in few] == [text for text, _ in decode(steps, ALPHABET, best=4)[0]][:3]


@pytest.mark.parametrize(
    ("steps", "alphabet", "options", "word"),
    [
        (np.full((1, 24, 40), 1 / 40), ALPHABET[:-1], {}, "probabilities"),
        (np.full((24, 40), 1 / 40), ALPHABET, {}, "probabilities"),
        (np.zeros((1, 0, 40)), ALPHABET, {}, "probabilities"),
        (np.ones((1, 3, 1)), "", {}, "probabilities"),
        (np.ones((1, 3, 2)), "A", {}, "sum"),
        (np.array([[[1.5, -0.5]]]), "A", {}, "sum"),
        (np.array([[[np.nan, 1.0]]]), "A", {}, "NaN"),
        ([["a", "b"]], "A", {}, "probabilities"),
        (np.full((1, 1, 2), 0.5), "A", {"width": 0}, "width"),
        (np.full((1, 1, 2), 0.5), "A", {"width": 129}, "width"),
        (np.full((1, 1, 2), 0.5), "A", {"best": 0}, "best"),
    ],
)
def test_wrong_input_is_named(steps, alphabet, options, word):
    with pytest.raises(InputError, match=word):
        decode(steps, alphabet, **options)
