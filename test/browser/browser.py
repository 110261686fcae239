"""Chromium, and what its tabs say about the page."""

import json

from selenium import webdriver
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.by import By

from claims import claim
from robot import FOLDER
from watching import until

# What a tab notes of itself: values of the clock and when they came (both in milliseconds of POSIX), and its frames.
NOTES = """
window.notes = { clock: [], frames: [], rows: null, errors: [], told: [] };
addEventListener("error", (e) => notes.errors.push(e.message));
addEventListener("securitypolicyviolation", (e) => notes.errors.push("policy: " + e.violatedDirective));
const clock = () => [...document.querySelectorAll("#signals tr")].find((r) => r.firstChild.textContent === "clock");
const told = () => [document.visibilityState, document.getElementById("state").textContent,
  Date.now() - Number(clock()?.children[1].textContent)];
const between = new BroadcastChannel("tabs");
between.onmessage = ({ data }) => { if (data === "tell") between.postMessage(told()); else notes.told.push(data); };
addEventListener("DOMContentLoaded", () => {
  new MutationObserver(() => {
    const value = Number(clock()?.children[1].textContent);
    const time = performance.timeOrigin + performance.now();
    if (value && notes.clock.at(-1)?.[0] !== value) notes.clock.push([value, time]);
    if (notes.rows === null && document.querySelector("#tree li")) notes.rows = performance.now();
  }).observe(document.body, { subtree: true, childList: true, characterData: true });
  const frame = (time) => { notes.frames.push(time); requestAnimationFrame(frame); };
  requestAnimationFrame(frame);
});
"""


class Browser:
    def __init__(self, width=1280, height=900, dark=False):
        options = webdriver.ChromeOptions()
        for flag in ("--headless=new", "--no-sandbox", "--disable-dev-shm-usage", "--remote-debugging-pipe",
                     "--enable-precise-memory-info"):
            options.add_argument(flag)
        options.set_capability("goog:loggingPrefs", {"performance": "ALL", "browser": "ALL"})
        self.driver = webdriver.Chrome(options=options, service=webdriver.ChromeService("/usr/bin/chromedriver"))
        self.driver.set_script_timeout(60)
        self.call("Browser.setDownloadBehavior", behavior="allow", downloadPath=FOLDER + "/saved")
        self.width, self.height, self.dark = width, height, dark
        self.prepare()

    def prepare(self):
        """This tab has that size and scheme of colours, and notes what it does, from its next page on."""
        self.call("Page.addScriptToEvaluateOnNewDocument", source=NOTES)
        self.call("Emulation.setEmulatedMedia",
                  features=[{"name": "prefers-color-scheme", "value": "dark" if self.dark else "light"}])
        self.call("Emulation.setDeviceMetricsOverride", width=self.width, height=self.height, deviceScaleFactor=1,
                  mobile=False)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.driver.quit()

    def call(self, name, **arguments):
        """A command of the DevTools protocol."""
        return self.driver.execute_cdp_cmd(name, arguments)

    def js(self, expression, *arguments):
        return self.driver.execute_script("return " + expression, *arguments)

    def open(self, robot):
        """Its page, once that is live."""
        self.driver.get(robot.address)
        self.comes("live", 10)

    def tab(self):
        """Another tab, in front of the others."""
        self.driver.switch_to.new_window("tab")
        self.prepare()

    def other_tabs(self, count):
        """What that number of other tabs say at this moment, by themselves: whether each is hidden, its state, and how
        old the value of the clock is that it shows (in milliseconds)."""
        self.driver.execute_script("notes.told = []; between.postMessage('tell')")
        until(lambda: self.js("notes.told.length") == count, 5, "the answers of the other tabs")
        return self.js("notes.told")

    def state(self):
        return self.text("#state")

    def comes(self, state, seconds):
        until(lambda: self.state().startswith(state), seconds, f'the state "{state}"')

    def find(self, selector):
        return self.driver.find_element(By.CSS_SELECTOR, selector)

    def text(self, selector):
        return self.js("document.querySelector(arguments[0]).textContent", selector)

    def texts(self, selector):
        return self.js("[...document.querySelectorAll(arguments[0])].map((e) => e.textContent)", selector)

    def tree(self):
        """The names that run, without their marks."""
        return [text[2:] for text in self.texts("#tree li .span")]

    def press(self, keys):
        ActionChains(self.driver).send_keys(keys).perform()

    def accessible(self, row, passes):
        """For all: axe-core finds no violation on the page (and has more than that number of rules that hold), which is
        no wider than its window."""
        with open(FOLDER + "/node_modules/axe-core/axe.min.js", encoding="utf-8") as file:
            self.driver.execute_script(file.read())
        found = self.driver.execute_async_script("axe.run().then(arguments[0])")
        faults = [f"{v['id']} ({len(v['nodes'])}): {v['nodes'][0]['html'][:100]}" for v in found["violations"]]
        claim(row, f"axe-core, {'dark' if self.dark else 'light'}, {self.width} px: violations", faults, "none",
              not faults and len(found["passes"]) > passes)
        wide = self.js("[document.documentElement.scrollWidth, innerWidth]")
        claim(row, f"{self.width} px: the page's width", wide[0], f"at most {wide[1]}", wide[0] <= wide[1])

    def heap(self):
        """The bytes of the page's heap, without what is garbage."""
        self.call("HeapProfiler.collectGarbage")
        return self.call("Runtime.getHeapUsage")["usedSize"]

    def requests(self):
        """The addresses of all requests since this was asked last."""
        messages = [json.loads(entry["message"])["message"] for entry in self.driver.get_log("performance")]
        return [m["params"]["request"]["url"] for m in messages if m["method"] == "Network.requestWillBeSent"] + [
            m["params"]["url"] for m in messages if m["method"] == "Network.webSocketCreated"]

    def no_problems(self, row):
        """Neither the console nor the page says anything of errors. (Reading the console's makes it forget them.)"""
        problems = [entry["message"] for entry in self.driver.get_log("browser") if entry["level"] == "SEVERE"]
        problems += self.js("notes.errors")
        claim(row, "errors in the console", problems, "none", not problems)


def delays(clock):
    """How late each value of the clock was shown, in seconds."""
    return [(shown - value) / 1000 for value, shown in clock]
