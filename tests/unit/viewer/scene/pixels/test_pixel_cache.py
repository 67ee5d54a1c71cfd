"""Pixels in memory: bounded in bytes, made once."""

import threading
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from ntc.errors import InputError
from viewer.scene.pixels.pixel_cache import PixelCache


def block(size: int) -> np.ndarray:
    return np.zeros(size, np.uint8)


def test_what_was_not_used_for_longest_goes_first() -> None:
    cache = PixelCache(100)
    first = cache.get("a", lambda: block(40))
    cache.get("b", lambda: block(40))
    assert cache.get("a", lambda: block(1)) is first
    cache.get("c", lambda: block(40))
    assert cache.nbytes == 80
    assert cache.get("a", lambda: block(1)) is first
    assert len(cache.get("b", lambda: block(2))) == 2


def test_what_is_too_large_is_given_but_not_kept() -> None:
    cache = PixelCache(10)
    assert len(cache.get("a", lambda: block(11))) == 11
    assert cache.nbytes == 0


def test_what_is_offered_removes_nothing() -> None:
    cache = PixelCache(100)
    cache.offer("a", block(60))
    cache.offer("b", block(60))
    assert cache.nbytes == 60
    cache.get("a", lambda: block(1))
    assert cache.made == 0


def test_what_several_threads_ask_for_is_made_once() -> None:
    cache, began = PixelCache(1000), threading.Barrier(4)
    made: list[int] = []

    def make() -> np.ndarray:
        made.append(1)
        return block(10)

    def ask(_: int) -> np.ndarray:
        began.wait()
        return cache.get("a", make)

    with ThreadPoolExecutor(4) as pool:
        found = list(pool.map(ask, range(4)))
    assert len(made) == cache.made == 1
    assert all(each is found[0] for each in found)


def test_what_fails_is_tried_again() -> None:
    cache = PixelCache(100)

    def fail() -> np.ndarray:
        raise InputError("gone")

    with pytest.raises(InputError, match="gone"):
        cache.get("a", fail)
    assert len(cache.get("a", lambda: block(3))) == 3


def test_many_threads_stay_within_the_bytes() -> None:
    cache = PixelCache(500)
    keys = np.random.default_rng(0).integers(0, 40, 2000)
    with ThreadPoolExecutor(8) as pool:
        sizes = list(pool.map(lambda key: (len(cache.get(int(key), lambda: block(20 + int(key)))), int(key)), keys))
    assert all(size == 20 + key for size, key in sizes)
    assert cache.nbytes <= 500
