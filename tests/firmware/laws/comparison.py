"""What C recorded of episodes beside what Python did: every field of every struct after every step."""

from __future__ import annotations

import struct
import subprocess
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from episodes import Episode

from firmware_sim.fields import Field, offsets
from protocol.law_tables import law_by_name
from tools.c_states import SHARED, STRUCTS, c_dtype

HEAD = np.dtype(
    [
        ("torque", "<i4", 3),
        ("flags", "<u4"),
        ("started", "<i4", 2),
        ("reference_words", "<i4", 6),
        ("telemetry", "<i4", 19),
        ("telemetry_words", "<i4"),
    ]
)


class Difference(NamedTuple):
    """Steps compared and differing, and where the first one is."""

    steps: int
    differing: int
    first: str


def request(episode: Episode) -> bytes:
    """An episode as program.c reads it."""
    table = law_by_name(episode.law)
    head = (table.law_id, table.version, len(episode.common), len(episode.params), len(episode.inp))
    return struct.pack("<5I", *head) + b"".join(a.tobytes() for a in (episode.common, episode.params, episode.inp))


def run(program: Path, episodes: Sequence[Episode]) -> list[bytes]:
    """What the program recorded of each episode; b"" where the law refused. Raises with its words if it stopped."""
    done = subprocess.run([str(program)], input=b"".join(map(request, episodes)), capture_output=True)
    assert done.returncode == 0, f"{program} ended with {done.returncode}: {done.stderr.decode(errors='replace')}"
    traces, at = [], 0
    for _ in episodes:
        (size,) = struct.unpack_from("<I", done.stdout, at)
        traces.append(done.stdout[at + 4 : at + 4 + size])
        at += 4 + size
    assert at == len(done.stdout)
    return traces


def compare(episodes: Iterable[Episode], traces: Iterable[bytes]) -> Difference:
    """All episodes, all steps, all fields."""
    steps = differing = 0
    first = ""
    for number, (episode, trace) in enumerate(zip(episodes, traces, strict=True)):
        if episode.expected is None:
            assert trace == b"", f"episode {number}: C takes what Python refuses"
            continue
        wrong = _wrong(episode, trace)
        steps += len(episode.inp)
        bad = np.any(list(wrong.values()), axis=0)
        differing += int(bad.sum())
        if bad.any() and not first:
            k = int(np.argmax(bad))
            first = f"{episode.law}, episode {number}, step {k}: {[name for name, rows in wrong.items() if rows[k]]}"
    return Difference(steps, differing, first)


def law_dtype(law: str) -> np.dtype:
    """One step as C records it."""
    parts = [("head", HEAD)]
    for name in ("reference", law):
        _, par, state = STRUCTS[SHARED.get(name, name)]
        parts.append((name, np.dtype([("par", c_dtype(par)), ("state", c_dtype(state))])))
    return np.dtype(parts)


def _wrong(episode: Episode, trace: bytes) -> dict[str, np.ndarray]:
    """Field -> (n,) true where C has another number."""
    e, law, steps = episode.expected, episode.law, len(episode.inp)
    assert e is not None
    dtype = law_dtype(law)
    assert len(trace) == steps * dtype.itemsize, f"expected {steps} steps of {dtype.itemsize} bytes, got {len(trace)}"
    got = np.frombuffer(trace, dtype)
    head, words = got["head"], e.telemetry.shape[1]
    telemetry = np.zeros((steps, 20), np.int64)
    telemetry[:, :words], telemetry[:, 19] = e.telemetry, words
    wrong = {
        "torque": (head["torque"] != e.out[:, :3]).any(1),
        "flags": head["flags"] != e.out[:, 3],
        "started": (head["started"] != e.started).any(1),
        "reference_words": (head["reference_words"] != e.reference_words).any(1),
        "telemetry": (np.column_stack([head["telemetry"], head["telemetry_words"]]) != telemetry).any(1),
    }
    for name, par, state in (("reference", e.ref_par, e.ref), (law, e.par, e.state)):
        _, par_fields, state_fields = STRUCTS[SHARED.get(name, name)]
        rows = np.broadcast_to(par, (steps, len(par)))
        wrong |= _fields_wrong(f"{name}.par", par_fields, got[name]["par"], rows)
        wrong |= _fields_wrong(f"{name}.state", state_fields, got[name]["state"], state)
    return wrong


def _fields_wrong(place: str, fields: Sequence[Field], got: np.ndarray, expected: np.ndarray) -> dict[str, np.ndarray]:
    wrong = {}
    for field, start in zip(fields, offsets(fields), strict=True):
        rows = expected[:, start : start + field.length]
        wrong[f"{place}.{field.name}"] = (got[field.name] != rows).any(1)
    if "reserved" in (got.dtype.names or ()):
        wrong[f"{place}.reserved"] = (got["reserved"] != 0).any(1)
    return wrong
