"""A headless browser, and the pages it looks at."""

import shutil
import signal
import warnings
from contextlib import contextmanager

import pytest

PROGRAMS = ("chromium", "chromium-browser", "google-chrome")
# Drawn in software: there is no graphics card in a test.
WORDS = ("--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist")
# Seconds after which nothing of playwright is waited for, whatever it says itself: a page is ready after one or two,
# and a busy machine may take a hundred times as long. No test measures time.
HANGS = 1800
STEP = 600_000  # milliseconds that starting, loading and any other step may take


@contextmanager
def limited(seconds, what):
    """Break off what hangs, where the system has a clock that can do so."""
    if not hasattr(signal, "SIGALRM"):
        yield
        return

    def broken_off(*_):
        raise TimeoutError(f"{what} took longer than {seconds} s")

    before = signal.signal(signal.SIGALRM, broken_off)
    signal.alarm(seconds)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


@pytest.fixture(autouse=True)
def never_hangs(request):
    with limited(HANGS, request.node.name):
        yield


@pytest.fixture(scope="session")
def browser():
    """Chromium: that of the system, else the one that playwright has installed."""
    sync_api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    program = next(filter(None, map(shutil.which, PROGRAMS)), None)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        with sync_api.sync_playwright() as playwright:
            try:
                with limited(HANGS, "the start of Chromium"):
                    result = playwright.chromium.launch(executable_path=program, args=[*WORDS], timeout=STEP)
            except (sync_api.Error, TimeoutError) as error:
                pytest.skip(f"no browser: {str(error).splitlines()[0]}")
            yield result
            result.close()


@pytest.fixture(scope="module")
def look(browser, tmp_path_factory):
    """A function that writes the report of a model and opens it; it returns the page, and what went wrong in it."""
    from mbsvib.report import write

    opened = []

    def show(model, **options):
        path = write(model, tmp_path_factory.mktemp("report") / "report.html", **options)
        page = browser.new_page(viewport={"width": 1280, "height": 800})
        page.set_default_timeout(STEP)
        opened.append(page)
        page.trouble, page.asked = [], []
        page.on("pageerror", lambda error: page.trouble.append(str(error)))
        page.on("console", lambda message: page.trouble.append(message.text) if message.type == "error" else None)
        page.on("request", lambda request: page.asked.append(request.url))
        page.goto(path.as_uri())
        page.wait_for_function("document.body.dataset.ready === 'yes'")
        return page

    yield show
    for page in opened:
        page.close()
