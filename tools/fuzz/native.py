"""The targets in C, with ASan and UBSan: under libFuzzer where there is a clang that has it, else under our driver."""

from __future__ import annotations

import hashlib
import re
import shutil
import struct
import subprocess
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from random import Random
from typing import NamedTuple

from protocol.law_tables import C_LAWS, config_words
from sil.pil import library
from tools.fuzz import BOARD_TESTS, CORPUS, build_folder, with_board_tests
from tools.fuzz.session import from_steps

SOURCES = Path(__file__).parent / "c"
CLANGS = ("clang", *(f"clang-{version}" for version in range(22, 11, -1)))
FLAGS = ("-g", "-O1", "-std=c11", "-Wall", "-Wextra", "-Werror", "-fwrapv", "-fno-sanitize-recover=all")
LONGEST = 8192
SLACK_S = 120.0  # for the seeds, and for the input under way; beyond it the input hangs, which our driver does not see
EXECUTIONS = re.compile(r"(?:stat::number_of_executed_units:|executions) *(\d+)")
COVERED = re.compile(r"cov: (\d+)")


class Engine(NamedTuple):
    """A program with all targets, and what makes their inputs."""

    name: str  # libFuzzer or driver
    program: Path


class Ran(NamedTuple):
    """One target's run."""

    executions: int
    covered: int  # edges; 0 with the driver, which does not know
    findings: list[Path]  # an input each, with what was said of it beside it in .txt


def engine() -> Engine:
    """The best there is here, built once. Raises library.LibraryError where there is no compiler."""
    for clang in filter(None, map(shutil.which, CLANGS)):
        try:
            program = _built("libfuzzer", (clang,), ("-fsanitize=fuzzer,address,undefined",), ())
        except library.LibraryError:
            continue  # a clang without its run-time libraries
        return Engine("libFuzzer", program)
    return driver()


def driver() -> Engine:
    """Our own driver, with whatever compiler there is."""
    compiler = next(library.compilers())
    return Engine("driver", _built("driver", compiler, ("-fsanitize=address,undefined",), ("driver.c",)))


def _built(name: str, compiler: Sequence[str], sanitizers: Sequence[str], more: Sequence[str]) -> Path:
    mine = [path for path in sorted(SOURCES.glob("*.c")) if path.name != "driver.c" or path.name in more]
    files = [*library.c_files(library.FOLDERS[:2]), str(BOARD_TESTS / "script.c"), *map(str, mine)]
    arguments = [*FLAGS, *sanitizers, f"-I{library.FIRMWARE / 'core'}", f"-I{BOARD_TESTS}", *files]
    digest = hashlib.sha256((library.source_hash() + "\0".join([*compiler, *arguments])).encode())
    for path in [*mine, SOURCES / "targets.h", BOARD_TESTS / "script.c", BOARD_TESTS / "script.h"]:
        digest.update(path.read_bytes())
    path = build_folder() / f"{name}-{digest.hexdigest()[:16]}"
    if not path.exists():
        path.parent.mkdir(parents=True, exist_ok=True)
        library.build(path, compiler, arguments)
    return path


def run(made: Engine, name: str, seconds: float, corpus: Path, findings: Path, tell: Callable[[str], None]) -> Ran:
    """Fuzz one target; a crash ends it, and its input is kept."""
    corpus.mkdir(parents=True, exist_ok=True)
    for data in start(name):
        (corpus / hashlib.sha256(data).hexdigest()[:16]).write_bytes(data)
    log = findings / f"{name}.log"
    before = set(_artifacts(made, name, findings))  # of an earlier run: told then
    command = [str(made.program), *_arguments(made, name, seconds, corpus, findings)]
    (findings / f"{name}-last").unlink(missing_ok=True)
    give_up_s = time.monotonic() + seconds + SLACK_S
    with open(log, "wb") as out:
        process = subprocess.Popen(command, stdout=out, stderr=subprocess.STDOUT, env=_environment(name))
        try:
            while process.poll() is None and time.monotonic() < give_up_s:
                try:
                    process.wait(5.0)
                except subprocess.TimeoutExpired:
                    tell(_progress(log))
        finally:
            process.kill()
            process.wait()
    said = log.read_text(errors="replace")
    counts = EXECUTIONS.findall(said)
    found = sorted(set(_artifacts(made, name, findings)) - before)
    if process.returncode and not found:
        found = [_ended_badly(name, findings)]
    for path in found:
        path.with_suffix(".txt").write_text(f"exit code {process.returncode}\n{said[-6000:]}")
    return Ran(int(counts[-1]) if counts else _last_number(said), int((COVERED.findall(said) or [0])[-1]), found)


def run_files(made: Engine, name: str, files: Sequence[Path]) -> str:
    """Each file once; "" or what the sanitizer said."""
    command = [str(made.program), *map(str, files)]
    done = subprocess.run(command, capture_output=True, env=_environment(name), timeout=300)
    return "" if done.returncode == 0 else done.stderr.decode(errors="replace")[-4000:] or f"exit {done.returncode}"


def _arguments(made: Engine, name: str, seconds: float, corpus: Path, findings: Path) -> list[str]:
    whole = max(1, round(seconds))
    if made.name == "libFuzzer":
        options = [f"-max_total_time={whole}", f"-max_len={LONGEST}", "-timeout=20", "-print_final_stats=1"]
        return [*options, "-rss_limit_mb=4096", f"-artifact_prefix={findings}/{name}-", str(corpus)]
    last = findings / f"{name}-last"
    return [f"-seconds={whole}", "-seed=1", f"-last={last}", *map(str, sorted(corpus.iterdir()))]


def _environment(name: str) -> dict[str, str]:
    return {"FUZZ_TARGET": name, "ASAN_OPTIONS": "quarantine_size_mb=16", "UBSAN_OPTIONS": "print_stacktrace=1"}


def _progress(log: Path) -> str:
    lines = [line for line in log.read_text(errors="replace").splitlines() if line.strip()]
    return lines[-1][:100] if lines else ""


def _last_number(said: str) -> int:
    """libFuzzer counts in front of its lines; a crash prints no statistics."""
    return int((re.findall(r"^#(\d+)", said, re.MULTILINE) or [0])[-1])


def _artifacts(made: Engine, name: str, findings: Path) -> list[Path]:
    """Inputs that libFuzzer kept; our driver keeps none itself."""
    kinds = ("crash", "timeout", "oom", "leak") if made.name == "libFuzzer" else ()
    return [path for kind in kinds for path in findings.glob(f"{name}-{kind}-*") if path.suffix != ".txt"]


def _ended_badly(name: str, findings: Path) -> Path:
    """A program that failed is a finding, also where it did not come to an input: an empty one stands for it then."""
    last = findings / f"{name}-last"
    content = last.read_bytes() if last.exists() else bytes(4)
    (length,) = struct.unpack_from("<I", content)
    data = content[4 : 4 + length]
    found = findings / f"{name}-crash-{hashlib.sha256(data).hexdigest()[:12]}"
    found.write_bytes(data)
    return found


# -- what it starts from ----------------------------------------------------------------------------------------------


def start(name: str) -> list[bytes]:
    """The committed corpus, and what is made here."""
    return [path.read_bytes() for path in sorted((CORPUS / name).glob("*"))] + list(SEEDS[name]())


def _streams() -> Iterator[bytes]:
    from tools.fuzz.stream import Stream

    yield from Stream().seeds()


def _packets() -> Iterator[bytes]:
    """Frames of every kind; whole CONFIGs in parts."""
    with_board_tests()
    from hostile import any_packet, any_parts, any_words

    from protocol import frames

    random = Random(5)
    for _ in range(20):
        yield b"".join(bytes([len(body)]) + body for body in (any_packet(random)[:-4] for _ in range(5)))
        parts = [frames.pack(part, 0)[:-4] for part in any_parts(random, any_words(random))]
        if sum(map(len, parts)) < LONGEST - 500:
            yield b"".join(bytes([len(body)]) + body for body in parts)


def _sessions() -> Iterator[bytes]:
    with_board_tests()
    from hostile import Laboratory

    for seed in range(24):
        data = from_steps(Laboratory(Random(seed)).steps(40), seed % 8)
        if len(data) <= LONGEST:
            yield data


def _flights() -> Iterator[bytes]:
    """Each law with its defaults through twelve plausible samples."""
    random = Random(6)
    for table in C_LAWS:
        words = config_words(table, {}, [])
        data = bytes([len(words)]) + struct.pack(f"<{len(words)}i", *words)
        for _ in range(12):
            numbers = [random.randrange(-(2**24), 2**24) for _ in range(19)]
            data += bytes([1, 7]) + struct.pack("<I19i", 0, *numbers)
        yield data


SEEDS: dict[str, Callable[[], Iterator[bytes]]] = {
    "decoder": _streams,
    "packet": _packets,
    "board": _sessions,
    "flight": _flights,
}
