"""A page in headless Chromium: its log, its network requests, and its printed layout."""

import json
import re
import shutil
import subprocess

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
WIDTH, HEIGHT = 703, 1047  # printed area of A4 within the margins [CSS pixels]
_QUIET = ("--headless=new", "--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-background-networking")
_QUIET += ("--host-resolver-rules=MAP * ~NOTFOUND",)
_PROBE = """<script>
const box = (e) => { const r = e.getBoundingClientRect(); return [r.width, r.height]; };
const svg = document.querySelector("figure svg"), before = svg.getAttribute("viewBox");
document.querySelector("figure .tools button").click();
const probe = document.createElement("pre");
probe.id = "probe";
probe.textContent = JSON.stringify({
  figures: [...document.querySelectorAll("figure")].map((f) => [f.id, ...box(f.querySelector("svg")),
    f.querySelectorAll("svg path, svg use").length, f.querySelectorAll("button").length]),
  tables: [...document.querySelectorAll("table, figure, .card")].map((t) => box(t)[1]),
  equations: [...document.querySelectorAll("math")].map((m) => box(m)[0]),
  widest: document.documentElement.scrollWidth,
  zoomed: [before, svg.getAttribute("viewBox")],
});
document.body.append(probe);
</script></body>"""


def opened(page, folder, *, width, media=""):
    """Result of a script in a copy of a page, lines on its console, requested addresses.

    With ``media="print"`` the copy shows on the screen what would be printed.
    """
    text = page.read_text(encoding="utf-8").replace("</body>", _PROBE)
    copy, log, profile = folder / "copy.html", folder / "net.json", folder / "profile"
    copy.write_text(text.replace("@media print", "@media all") if media == "print" else text, encoding="utf-8")
    done = subprocess.run(
        [
            *(CHROMIUM, *_QUIET, f"--user-data-dir={profile}", f"--window-size={width},1000"),
            *("--enable-logging=stderr", f"--log-net-log={log}", "--dump-dom", copy.as_uri()),
        ],
        capture_output=True,
        text=True,
        check=True,
        timeout=300,
    )
    (found,) = re.findall(r'<pre id="probe">(.*?)</pre>', done.stdout, flags=re.S)
    console = [line for line in done.stderr.splitlines() if "CONSOLE" in line]
    return json.loads(found), console, asked(log) - {copy.as_uri()}


def asked(log):
    """Addresses that pages requested; the browser's own requests have no origin."""
    told = [event.get("params", {}) for event in json.loads(log.read_text(encoding="utf-8"))["events"]]
    return {p["url"] for p in told if "url" in p and p.get("initiator", "not an origin") != "not an origin"}
