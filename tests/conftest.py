"""Random tests try the same examples in every run, so that a failure is there again tomorrow.

``HYPOTHESIS_PROFILE=random pytest -m "slow or not slow"`` tries others each time. The end of the run names
the seed, with which ``--hypothesis-seed=SEED`` repeats it.

Binaries compiled for the tests go to a cache of their own, once a run, and are those of this platform: zig takes
minutes for the others when it runs for the first time.
"""

import gc
import os
import random
import sys

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, settings

settings.register_profile(
    "same", deadline=None, derandomize=True, database=None, max_examples=40,
    # a mechanism that is made from a seed doesn't shrink to a simpler one
    phases=[Phase.explicit, Phase.generate],
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large],
)  # fmt: skip
settings.register_profile("random", settings.get_profile("same"), derandomize=False, print_blob=True)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "same"))


def pytest_addoption(parser):
    """Options of ``tests/hunt``, which pytest reads from here only."""
    group = parser.getgroup("hunt")
    group.addoption("--hunt-seed", help="seed of the first scene of the hunt, or random")
    group.addoption("--hunt-count", type=int, help="how many scenes the hunt tries")


@pytest.hookimpl(tryfirst=True)
def pytest_configure(config):
    """Choose seeds that can be told, once for all processes."""
    if config.getoption("hunt_seed") == "random":
        config.option.hunt_seed = str(random.SystemRandom().getrandbits(30))
    if not settings.default.derandomize and config.getoption("hypothesis_seed", None) is None:
        config.option.hypothesis_seed = str(random.SystemRandom().getrandbits(32))


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_setupnodes(specs):
    """Share the cores between the processes of tests: threads of BLAS that wait for a core spin."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", str(max(1, (os.cpu_count() or 1) // len(specs))))


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    """Of tests with the marker ``few(n)`` n cases run by default, spread evenly; the others are slow."""
    cases = {}
    for item in items:
        marker = item.get_closest_marker("few")
        if marker is not None and item.get_closest_marker("slow") is None:
            cases.setdefault(item.nodeid.partition("[")[0], (marker.args[0], []))[1].append(item)
    for count, group in cases.values():
        quick = {round((k + 0.5) * len(group) / count - 0.5) for k in range(min(count, len(group)))}
        for k, item in enumerate(group):
            if k not in quick:
                item.add_marker(pytest.mark.slow)


@pytest.hookimpl(wrapper=True)
def pytest_collection():
    """Collect thousands of tests without searching them for garbage again and again."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.enable()


def pytest_terminal_summary(terminalreporter, config):
    """Tell the seed of a random run."""
    if not settings.default.derandomize:
        seed = config.option.hypothesis_seed
        terminalreporter.write_line(f"random examples: HYPOTHESIS_PROFILE=random pytest --hypothesis-seed={seed}")


@pytest.fixture(autouse=True)
def _own_printing():
    """Print options of numpy that a package sets when it is imported, as pyyeti does, end with the test."""
    before = np.get_printoptions()
    yield
    np.set_printoptions(**before)


@pytest.fixture(autouse=True)
def _own_figures():
    """Figures that a test leaves open end with the test: the next one on this process would count them."""
    yield
    if pyplot := sys.modules.get("matplotlib.pyplot"):
        pyplot.close("all")


@pytest.fixture(autouse=True, scope="session")
def _own_cache(tmp_path_factory):
    """A folder for this run, unless the caller keeps one (CI does, between runs)."""
    if "MBSVIB_CACHE" in os.environ:
        yield
        return
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("MBSVIB_CACHE", str(tmp_path_factory.mktemp("cache")))
        yield


@pytest.fixture(autouse=True, scope="session")
def _this_platform():
    """Exports without ``platforms=`` have the binary of this platform only; tests of the default put it back."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("mbsvib_export.fmu_.binaries.COMMON", ())
        yield
