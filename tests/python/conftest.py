"""Fixtures."""

import numpy as np
import pytest

import raydix


@pytest.fixture
def rng():
    return np.random.default_rng(7)


@pytest.fixture(scope="session")
def figure():
    return raydix.Scene("builtin:figure?triangles=20000")
