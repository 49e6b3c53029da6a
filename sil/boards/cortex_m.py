"""The C firmware on an emulated Cortex-M, in a process of its own, over a pty or UDP on loopback."""

from __future__ import annotations

from sil.launched import LaunchedBoard


class CortexMBoard(LaunchedBoard):
    """Launches `python -m sil.pil.cortex_m`: the mps2-an386 image that would be flashed, on the emulator unicorn."""

    module = "sil.pil.cortex_m"
    what = "emulated Cortex-M"
    tells_incidents = True
