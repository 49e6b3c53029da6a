"""Benchmarks: what the testbed costs on this machine, as ratios to something run beside it in the same minutes.

A bench is a file with a class that says what it compares (`about`), how long it will take (`expected_s`) and measures
into a Book (`sil.bench.book`). One line here per bench, in the order in which they run; imported when named.
"""

from __future__ import annotations

BENCHES: dict[str, str] = {
    "codec": "sil.bench.codec:Codec",
    "recorder": "sil.bench.recorder:RecorderAndSeal",
    "law": "sil.bench.law:LawStep",
    "plant": "sil.bench.plant:PlantSteps",
    "loop": "sil.bench.loop:WholeLoop",
    "boards": "sil.bench.boards:Boards",
    "lockstep": "sil.bench.lockstep:Lockstep",
    "wakeup": "sil.bench.wakeup:Wakeup",
    "fast": "sil.bench.fast:FastLoop",
    "live": "sil.bench.live:LiveView",
}
