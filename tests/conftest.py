"""Random tests try the same examples in every run, so that a failure is there again tomorrow.

Binaries compiled for the tests go to a cache of their own, once a run.
"""

import os

import pytest
from hypothesis import HealthCheck, Phase, settings

settings.register_profile(
    "same", deadline=None, derandomize=True, database=None, max_examples=40,
    # a mechanism that is made from a seed doesn't shrink to a simpler one
    phases=[Phase.explicit, Phase.generate],
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large],
)  # fmt: skip
settings.load_profile("same")


@pytest.fixture(autouse=True, scope="session")
def _own_cache(tmp_path_factory):
    """A folder for this run, unless the caller keeps one (CI does, between runs)."""
    if "MBSVIB_CACHE" in os.environ:
        yield
        return
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("MBSVIB_CACHE", str(tmp_path_factory.mktemp("cache")))
        yield
