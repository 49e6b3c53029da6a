"""What each picture shows, by its file's name, and the runs it is made of."""

from __future__ import annotations

import csv
import io
import shutil
import subprocess
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image

from sil.report.colours import DARK, LIGHT, Look
from sil.report.look import finish
from tools.browser import Browser, program
from tools.pictures import loop, terminal

LAWS = {"fvsc": "fuzzy", "vsc": "the same without fuzzy part", "pd": "PD", "lqg": "LQG", "glover": "loop shaping",
        "glover_integral": "loop shaping, integral"}  # fmt: skip
ERRORS = {"euler": "error as difference of Euler angles", "quaternion": "error in body axes"}
DELAYS = "0.1:1.7:17"
LOST_deg = 2.0  # rms over the last 20 s that the study calls lost
NOISY, QUIET = "sensors.attitude.noise_deg=0.02", "sensors.attitude.noise_deg=0.005"
TRIES, MIDDLE = 3, 0.55  # of a paced run on a machine that others use, too


class Studio:
    """A folder with runs; each is made once."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def sil(self, *words: str) -> None:
        """One command. Raises OSError, but not for a requirement that failed."""
        done = subprocess.run([*terminal.SIL, *words], cwd=self.folder, capture_output=True, check=False)
        if done.returncode > 1:
            raise OSError(f"sil {' '.join(words)}: {done.stderr.decode().strip()}")

    def run(self, scenario: str) -> str:
        """The directory of a run of this scenario."""
        if not (self.folder / scenario).exists():
            self.sil("run", scenario, "--out", scenario)
        return scenario

    def file(self, name: str, *words: str) -> bytes:
        """What a command writes to the file `name`."""
        self.sil(*words)
        return (self.folder / name).read_bytes()

    def screen(self, shown: str, columns: int = 96) -> bytes:
        """What a command shows on a terminal, when it is done."""
        text = terminal.seen([*terminal.SIL, *shown.split()[1:]], self.folder, (columns, 60))
        return terminal.drawn(shown, terminal.after_the_view(text)).encode()

    def live(self) -> bytes:
        """The view of a paced run about its middle; before its first real miss, if this machine makes one."""
        shown, best, view = "sil run mrac-rs232 --clock scaled:20 --priority 50", -1.0, ""
        for _ in range(TRIES):
            shutil.rmtree(self.folder / "live", ignore_errors=True)
            text = terminal.seen([*terminal.SIL, *shown.split()[1:], "--out", "live"], self.folder, (100, 30))
            frames = terminal.frames(text)
            calm = sum("real misses 0 " in terminal.plain(each) for each in frames) / len(frames)
            if calm > best:
                best, view = calm, frames[max(0, int(min(calm, MIDDLE) * len(frames)) - 1)]
            if calm >= MIDDLE:
                break
        return terminal.drawn(shown, view).encode()

    def page(self, width: int, height: int, dark: bool = False) -> bytes:
        """The report of a run in a browser, in mid-turn."""
        self.sil("report", self.run("mrac-rs232"), "--out", "report.html")
        found = program()
        assert found is not None, "main() asks first"
        with Browser(found) as browser:
            browser.open(self.folder / "report.html", width, height, dark)
            moved = "{ value: 432 }).dispatchEvent(new Event('input'))"
            browser.ask(f"Object.assign(document.getElementById('time'), {moved}")
            browser.frames()
            return browser.picture()


def small(png: bytes, width: int = 0) -> bytes:
    """The same picture with at most 256 colours, and no wider than that."""
    picture = Image.open(io.BytesIO(png)).convert("RGB")
    if width and picture.width > width:
        picture = picture.resize((width, round(picture.height * width / picture.width)), Image.Resampling.LANCZOS)
    out = io.BytesIO()
    picture.quantize(256, dither=Image.Dither.NONE).save(out, "PNG", optimize=True)
    return out.getvalue()


def plotted(name: str, *runs: str, options: Sequence[str] = ()) -> dict[str, Callable[[Studio], bytes]]:
    """The pictures that `sil plot` makes of runs of these scenarios, for light and for dark paper."""

    def make(studio: Studio, *more: str) -> bytes:
        folders = [studio.run(run) for run in runs]
        return small(studio.file("plot.png", "plot", *folders, *options, *more, "--out", "plot.png"))

    return {f"{name}.png": make, f"{name}-dark.png": lambda studio: make(studio, "--dark")}


def delays(studio: Studio, look: Look = LIGHT) -> bytes:
    """Rms attitude error over the last 20 s against the delay of the sensors, law by law."""
    if not (studio.folder / "delays").exists():
        keys = {"variant": LAWS, "law.params.error": ERRORS, "sensors.sampling.delay_s": (DELAYS,)}
        vary = (word for key, values in keys.items() for word in ("--vary", f"{key}={','.join(values)}"))
        studio.sil("sweep", "delay-comparison", *vary, "--out", "delays")
    with (studio.folder / "delays" / "results.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    figure = Figure(figsize=(12, 4.6), dpi=100, facecolor=look.paper)
    FigureCanvasAgg(figure)
    for ax, (error, title) in zip(figure.subplots(1, 2, sharey=True), ERRORS.items(), strict=True):
        for (law, name), colour in zip(LAWS.items(), look.runs, strict=False):
            mine = [row for row in rows if (row["variant"], row["law.params.error"]) == (law, error)]
            delay = [float(row["sensors.sampling.delay_s"]) for row in mine]
            residual = [float(row["residual_error_deg.all"] or "nan") for row in mine]
            ax.plot(delay, np.maximum(residual, 0.01), "o-", ms=4, lw=1.6, color=colour, label=name)
        ax.set_yscale("log")
        ax.axhline(LOST_deg, color=look.faint, lw=1, ls="--")
        finish(ax, "rms of the last 20 s" if error == "euler" else "", "deg" if error == "euler" else "", title, look)
        ax.set_xlabel("delay of the sensors in s", fontsize=11, color=look.ink)
    figure.axes[0].legend(frameon=False, fontsize=10, loc="lower right", labelcolor=look.ink)
    figure.tight_layout()
    out = io.BytesIO()
    figure.savefig(out, format="png", dpi=100)
    return small(out.getvalue())


def margins(studio: Studio) -> bytes:
    """The heat maps of `sil faults`: laws over loss, burst and delay."""
    studio.sil("faults", "appc-rs232", "--transport", "", "--seeds", "3", "--set", NOISY, "--out", "map")
    return small((studio.folder / "map" / "map.png").read_bytes())


def designed(studio: Studio) -> bytes:
    """Bode, Nichols and step of the compensator of how-to/design-a-controller."""
    loop_ = ("--wc", "0.25", "--delay", "0.75", "--integral", "0.02", "--period", "0.5", "--inertia", "2.13,3.04,3.09")
    return small(studio.file("design.png", "design", "glover", *loop_, "--plot", "design.png"))


def screens_after_a_run(shown: str, columns: int = 96) -> Callable[[Studio], bytes]:
    """What a command shows of the run that the quick start makes, under its usual name."""

    def make(studio: Studio) -> bytes:
        if not (studio.folder / "runs" / "mrac-rs232-001").exists():
            studio.sil("run", "mrac-rs232", "--out", "runs/mrac-rs232-001")
        return studio.screen(shown, columns)

    return make


SWEEP = "sil sweep mrac-rs232 --vary law.params.c2_pole=0.6:0.8:3 --vary seed=1:2 --set " + QUIET
PICTURES: dict[str, Callable[[Studio], bytes]] = {
    "loop.svg": lambda _: loop.drawn().encode(),
    "run.svg": lambda studio: studio.screen("sil run mrac-rs232"),
    "live.svg": Studio.live,
    "info.svg": screens_after_a_run("sil info runs/mrac-rs232-001"),
    "ladder.svg": screens_after_a_run("sil ladder mrac-rs232", 132),
    "sweep.svg": screens_after_a_run(SWEEP, 100),
    **plotted("plot", "mrac-rs232"),
    "report.png": lambda studio: small(studio.page(1400, 900)),
    "report-dark.png": lambda studio: small(studio.page(1400, 900, dark=True)),
    "report-phone.png": lambda studio: small(studio.page(390, 844), 585),
    **plotted("compare", "appc-rs232", "mrac-rs232", options=("--signals", "error,torque", "--time", "100:300")),
    **plotted("adaptive", "mrac-as-printed", "pd-root-locus", "mrac-rs232", options=("--signals", "attitude,torque")),
    "margin-map.png": margins,
    "delays.png": delays,
    "delays-dark.png": lambda studio: delays(studio, DARK),
    "design.png": designed,
}
