"""The web dashboard in a real browser: a page on loopback that draws the swarm and advances with it."""

from __future__ import annotations

import io
import json
import os
import shutil
import threading
import time
from collections.abc import Iterator

import numpy as np
import pytest

from ftcc.groundside.dashboard import Dashboard
from tests.groundside.dashboard.synthetic_swarm import SUBJECT, flight

pytestmark = [
    pytest.mark.browser,
    pytest.mark.skipif(shutil.which("chromium") is None, reason="needs the system package chromium"),
    pytest.mark.skipif(shutil.which("chromedriver") is None, reason="needs the system package chromium-driver"),
    pytest.mark.timeout(300),
]

SIZE = (1280, 800)
SCENE = (slice(50, 330), slice(10, 720))
"""Rows and columns of the picture that the 3D view fills."""


class Swarm:
    """A flying swarm: snapshots at 10 Hz until told to stop."""

    def __init__(self, dashboard: Dashboard) -> None:
        self.t = 0.0
        self._dashboard = dashboard
        self._landed = threading.Event()
        self._thread = threading.Thread(target=self._fly)
        self._thread.start()

    def _fly(self) -> None:
        for snapshot in flight(170.0):
            self._dashboard.log(snapshot)
            self.t = snapshot.t
            if self._landed.wait(0.1):
                return

    def land(self) -> None:
        self._landed.set()
        self._thread.join()


@pytest.fixture
def dashboard() -> Iterator[Dashboard]:
    made = Dashboard(SUBJECT, recording=None, viewer="web")
    yield made
    made.close()


@pytest.fixture
def swarm(dashboard: Dashboard) -> Iterator[Swarm]:
    flying = Swarm(dashboard)
    yield flying
    flying.land()


@pytest.fixture
def browser(tmp_path):
    webdriver = pytest.importorskip("selenium.webdriver")
    options = webdriver.ChromeOptions()
    options.binary_location = shutil.which("chromium")
    for argument in (
        "--headless=new",
        "--use-gl=angle",
        "--use-angle=swiftshader",
        "--enable-unsafe-swiftshader",
        "--ignore-gpu-blocklist",
        "--disable-dev-shm-usage",
        "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1",
        f"--window-size={SIZE[0]},{SIZE[1]}",
        f"--user-data-dir={tmp_path / 'profile'}",
        # Chromium's sandbox refuses to run as root.
        *(["--no-sandbox"] if os.geteuid() == 0 else []),
    ):
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"performance": "ALL"})
    driver = webdriver.Chrome(options=options, service=webdriver.ChromeService(shutil.which("chromedriver")))
    yield driver
    driver.quit()


def picture(browser) -> np.ndarray:
    """What the page shows, shape (rows, columns, 3)."""
    image = pytest.importorskip("PIL.Image")
    return np.asarray(image.open(io.BytesIO(browser.get_screenshot_as_png())).convert("RGB")).astype(int)


def colored(pixels: np.ndarray) -> float:
    """Share of pixels that are neither black, white nor gray: aircraft, trails and labels are coloured."""
    return float((pixels.max(axis=2) - pixels.min(axis=2) > 40).mean())


def open_page(browser, address: str, theme: str) -> None:
    browser.execute_cdp_cmd(
        "Emulation.setEmulatedMedia", {"features": [{"name": "prefers-color-scheme", "value": theme}]}
    )
    browser.get(f"{address}&renderer=webgl")


def wait_until_drawn(browser) -> np.ndarray:
    """A picture in which the 3D view is drawn; the next may be blank, while views take their places."""
    deadline = time.monotonic() + 120.0
    while colored((shown := picture(browser))[SCENE]) <= 0.002:
        assert time.monotonic() < deadline, "the 3D view is blank"
        time.sleep(1.0)
    return shown


def wait_until_moved(browser, early: np.ndarray) -> np.ndarray:
    """A picture whose 3D view differs from an earlier one; drawn in software, it lags behind the swarm by seconds."""
    deadline = time.monotonic() + 60.0
    while True:
        time.sleep(2.0)
        late = wait_until_drawn(browser)
        if (np.abs(late[SCENE] - early[SCENE]).max(axis=2) > 40).mean() > 0.001:
            return late
        assert time.monotonic() < deadline, "the 3D view stands still"


@pytest.mark.parametrize("theme", ["dark", "light"])
def test_the_scene_is_drawn_and_advances_while_the_swarm_flies(dashboard, swarm, browser, theme):
    assert dashboard.address is not None
    open_page(browser, dashboard.address, theme)
    shown, early_t = wait_until_drawn(browser), swarm.t
    for _ in range(2):  # views that take their places change it once, a swarm that flies again and again
        shown = wait_until_moved(browser, shown)
    if folder := os.environ.get("FTCC_SCREENSHOTS"):
        browser.save_screenshot(os.path.join(folder, f"dashboard-{theme}.png"))
    assert swarm.t > early_t
    background = np.median(shown[SCENE].reshape(-1, 3), axis=0)
    assert (background.mean() > 128) == (theme == "light")


def test_the_page_reaches_nobody_but_this_machine(dashboard, swarm, browser):
    """The page tries to send usage statistics; the browser refuses because of the policy that comes with the page."""
    assert dashboard.address is not None
    open_page(browser, dashboard.address, "dark")
    asked, refused = {}, set()
    deadline = time.monotonic() + 60.0
    running = None
    # Whatever the page asks for, it asks for within seconds of its program's start.
    while time.monotonic() < (deadline if running is None else running + 8.0):
        time.sleep(0.5)
        for entry in browser.get_log("performance"):
            message = json.loads(entry["message"])["message"]
            about = message["params"]
            if message["method"] == "Network.requestWillBeSent":
                asked[about["requestId"]] = about["request"]["url"]
            if message["method"] == "Network.loadingFailed" and about.get("blockedReason") == "csp":
                refused.add(about["requestId"])
        if running is None and any(url.split("?")[0].endswith(".wasm") for url in asked.values()):
            running = time.monotonic()
    assert running is not None, "the page did not load its program"
    outside = {request: url for request, url in asked.items() if url.startswith("http") and "//127.0.0.1:" not in url}
    assert len(outside) < len(asked), "nothing was seen of the page's own requests"
    assert {url for request, url in outside.items() if request not in refused} == set()
    assert 'href="http' not in browser.page_source.split("</head>")[0]
