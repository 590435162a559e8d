"""A headless Chromium that the tests drive through chromedriver (the WebDriver protocol), with the standard library alone."""
import base64
import json
import os
import shutil
import subprocess
import tempfile
import time
import urllib.error
import urllib.request

CHROMIUM, DRIVER = shutil.which("chromium"), shutil.which("chromedriver")
MISSING = None if CHROMIUM and DRIVER else "needs Debian's chromium and chromium-driver (scripts/setup --test installs them)"
STARTS_WITHIN_S, ANSWERS_WITHIN_S = 60, 120


class Browser:
    """One page at a time. Keeps what the browser logs: console messages and requests to the network."""

    def __init__(self):
        self.profile = tempfile.TemporaryDirectory(prefix="raydix-chromium-", ignore_cleanup_errors=True)
        self.driver = subprocess.Popen([DRIVER, "--port=0"], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
        self.session = ""
        try:
            self.address = f"http://127.0.0.1:{self._port()}"
            arguments = ["--headless=new", "--disable-gpu", "--hide-scrollbars", "--no-first-run", "--disable-dev-shm-usage",
                         "--disable-background-networking", "--disable-component-update",
                         f"--user-data-dir={self.profile.name}"]
            if os.geteuid() == 0:
                arguments.append("--no-sandbox")  # Chromium's sandbox refuses to run as root
            self.session = self._call("POST", "/session", {"capabilities": {"alwaysMatch": {
                "browserName": "chrome",
                "goog:chromeOptions": {"binary": CHROMIUM, "args": arguments},
                "goog:loggingPrefs": {"browser": "ALL", "performance": "ALL"}}}})["sessionId"]
        except Exception:
            self.close()
            raise

    def _port(self):
        end = time.monotonic() + STARTS_WITHIN_S
        while time.monotonic() < end:
            line = self.driver.stdout.readline()
            if "started successfully on port" in line:
                return int(line.rsplit(" ", 1)[1].rstrip(".\n"))
            if not line:
                break
        raise RuntimeError("chromedriver does not start")

    def _call(self, method, path, body=None):
        data = None if method == "GET" else json.dumps(body or {}).encode()
        request = urllib.request.Request(self.address + path, data, {"Content-Type": "application/json"}, method=method)
        opener = urllib.request.build_opener(urllib.request.ProxyHandler({}))  # the driver is on this machine
        try:
            with opener.open(request, timeout=ANSWERS_WITHIN_S) as answer:
                return json.load(answer)["value"]
        except urllib.error.HTTPError as error:
            raise RuntimeError(f"{method} {path}: {error.read().decode('utf-8', 'replace')[:2000]}") from None

    def _in_session(self, method, path, body=None):
        return self._call(method, f"/session/{self.session}{path}", body)

    def devtools(self, command, **parameters):
        return self._in_session("POST", "/goog/cdp/execute", {"cmd": command, "params": parameters})

    def show(self, file, width=1280, height=900, scheme="light"):
        self.devtools("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])
        self.devtools("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1,
                      mobile=width < 600)
        self.logs("browser"), self.logs("performance")  # what came before is not this page's
        self._in_session("POST", "/url", {"url": file.resolve().as_uri()})

    def run(self, script, *arguments):
        """The value that a function body returns in the page."""
        return self._in_session("POST", "/execute/sync", {"script": script, "args": list(arguments)})

    def logs(self, kind):
        return self._in_session("POST", "/se/log", {"type": kind})

    def requests(self, page):
        """Addresses of all that the page asked for, itself and data URIs left out; and how many there were with these."""
        sent = (json.loads(entry["message"])["message"] for entry in self.logs("performance"))
        urls = [message["params"]["request"]["url"] for message in sent if message["method"] == "Network.requestWillBeSent"]
        own = page.resolve().as_uri()
        return [url for url in urls if not url.startswith("data:") and url.split("#")[0] != own], len(urls)

    def screenshot(self, selector):
        """PNG bytes of the whole element, however far it reaches beyond the window."""
        box = self.run("const r = document.querySelector(arguments[0]).getBoundingClientRect();"
                       "return {x: r.x + scrollX, y: r.y + scrollY, width: r.width, height: r.height, scale: 1};", selector)
        shot = self.devtools("Page.captureScreenshot", format="png", captureBeyondViewport=True, clip=box)
        return base64.b64decode(shot["data"])

    def pdf(self):
        return base64.b64decode(self.devtools("Page.printToPDF", printBackground=True)["data"])

    def close(self):
        try:
            if self.session:
                self._in_session("DELETE", "")
        finally:
            self.driver.terminate()
            self.driver.wait(timeout=30)
            self.profile.cleanup()
