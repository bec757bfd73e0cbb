"""The counter-based random numbers behind every emulated loss and every measurement noise."""

from __future__ import annotations

import math
import random

import numpy as np
import pytest

from ftcc.link.philox import CHANNEL, NOISE, gaussian_pair, philox, uniform

WORDS = 2**32 - 1


def plain(function):
    """The Python function behind a compiled one."""
    return getattr(function, "py_func", function)


# kat_vectors of the authors' Random123 library: counter (4 words), key (2 words), result (4 words).
KNOWN_ANSWERS = [
    ((0, 0, 0, 0), (0, 0), (0x6627E8D5, 0xE169C58D, 0xBC57AC4C, 0x9B00DBD8)),
    ((WORDS,) * 4, (WORDS,) * 2, (0x408F276D, 0x41C83B0E, 0xA20BC7C6, 0x6D5451FD)),
    (
        (0x243F6A88, 0x85A308D3, 0x13198A2E, 0x03707344),
        (0xA4093822, 0x299F31D0),
        (0xD16CFE09, 0x94FDCCEB, 0x5001E420, 0x24126EA1),
    ),
]


@pytest.mark.parametrize(("counter", "key", "answer"), KNOWN_ANSWERS)
def test_published_known_answers_of_philox4x32_10(counter, key, answer):
    seed = key[0] | key[1] << 32
    assert plain(philox)(seed, *counter) == answer
    if seed < 2**63:  # what a scenario's seed may be
        assert philox(seed, *counter) == answer


def test_plain_python_and_compiled_code_draw_the_same_bits():
    draw = random.Random(1)
    for _ in range(3000):
        seed = draw.randrange(2**63)
        counter = [draw.choice((0, 1, WORDS, draw.randrange(2**32))) for _ in range(4)]
        words = philox(seed, *counter)
        assert words == plain(philox)(seed, *counter)
        assert all(0 <= word <= WORDS for word in words)
        assert uniform(words[0]) == plain(uniform)(words[0])
        assert gaussian_pair(words[0], words[1]) == plain(gaussian_pair)(words[0], words[1])


def test_every_word_is_a_number_strictly_between_0_and_1():
    assert 0.0 < uniform(0) < 1e-9
    assert 1.0 - 1e-9 < uniform(WORDS) < 1.0
    assert all(map(math.isfinite, gaussian_pair(0, 0)))
    assert all(map(math.isfinite, gaussian_pair(WORDS, WORDS)))


def test_uniform_draws_fill_the_interval_evenly():
    draws = np.array([uniform(word) for n in range(5000) for word in philox(3, n, 7, CHANNEL, 0)])
    counts, _ = np.histogram(draws, bins=20, range=(0.0, 1.0))
    expected = len(draws) / 20
    chi_squared = float(((counts - expected) ** 2 / expected).sum())
    assert chi_squared < 43.8  # 99.9 % quantile at 19 degrees of freedom
    assert abs(np.corrcoef(draws[:-1], draws[1:])[0, 1]) < 4.0 / math.sqrt(len(draws))


def test_gaussian_draws_have_the_moments_of_a_standard_normal():
    pairs = np.array([gaussian_pair(*philox(5, n, 1, NOISE, 0)[:2]) for n in range(20000)])
    n = pairs.size
    assert abs(pairs.mean()) < 4.0 / math.sqrt(n)
    assert pairs.var() == pytest.approx(1.0, abs=4.0 * math.sqrt(2.0 / n))
    assert abs((pairs**3).mean()) < 4.0 * math.sqrt(15.0 / n)
    assert (pairs**4).mean() == pytest.approx(3.0, abs=4.0 * math.sqrt(96.0 / n))
    assert abs(np.corrcoef(pairs.T)[0, 1]) < 4.0 / math.sqrt(len(pairs))


@pytest.mark.parametrize(
    "other", [(4, 0, 1, CHANNEL, 0), (3, 0, 2, CHANNEL, 0), (3, 0, 1, NOISE, 0), (3, 0, 1, CHANNEL, 1)]
)
def test_another_seed_edge_purpose_or_index_is_another_stream(other):
    def stream(seed: int, _: int, b: int, c: int, d: int) -> np.ndarray:
        return np.array([uniform(philox(seed, n, b, c, d)[0]) for n in range(2000)])

    assert abs(np.corrcoef(stream(3, 0, 1, CHANNEL, 0), stream(*other))[0, 1]) < 4.0 / math.sqrt(2000)
