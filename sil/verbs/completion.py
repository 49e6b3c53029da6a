"""What the shell offers at TAB: scenarios, runs, keys of --set with their values, clocks, boards, links.

A person waits for it, so nothing heavy is imported: keys come from the published JSON Schema, not from the model. Where
a list is empty, the shell completes file names. Values that may follow KEY= come with the key, in one word.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Any

import typer

Offer = tuple[str, str]  # a word and what it means, which zsh and fish show
MOST_FILES = 200
WORD_BREAKS = "=:"  # where bash ends a word
PLAIN = str.maketrans("[]'", "()’", '`"$')
LONGEST = 70  # characters of what a word means
DEVICES = ("/dev/serial/by-id/*", "/dev/ttyUSB*", "/dev/ttyACM*", "/dev/ttyAMA*")
CLOCKS = (
    ("lockstep", "as fast as both sides can"),
    ("realtime", "one simulated second a second"),
    ("scaled:20", "20 times real time"),
)
BOARDS = (
    ("process", "the controller in a process of its own"),
    ("inproc", "the controller in this process"),
    ("native", "the C firmware, compiled for this machine"),
    ("cortex-m", "the C firmware on an emulated Cortex-M"),
    ("qemu", "the same image in QEMU"),
    ("none", "no controller"),
)
CHECK_GROUPS = (
    ("handshake", "HELLO, nonce, numbers, framing"),
    ("states", "every event in every state"),
    ("config", "parts, READY"),
    ("receiver", "refused packets and garbage"),
    ("ticks", "the timing contract"),
    ("numbers", "flights, bit for bit"),
    ("latency", "SAMPLE to COMMAND"),
    ("timer", "the board's own, and its clock"),
    ("baud", "at which rates it answers"),
    ("reset", "what it does at boot"),
    ("end", "nothing unasked, no session left"),
)
ADDRESSES = (
    ("127.0.0.1:8765", "this machine only, where viewers look first"),
    ("127.0.0.1:0", "any free port"),
    ("0.0.0.0:8765", "also other machines"),
)
LINKS = (
    ("pty", "pseudo-terminal, a serial line of this machine"),
    ("udp", "UDP on this machine"),
    ("inproc", "no cable, board in this process"),
    ("udp://127.0.0.1:5005", "the board at this address"),
)


def scenarios(incomplete: str) -> list[Offer]:
    """Built-in scenarios, and the YAML files here."""
    from sil.scenarios import list_scenarios

    files = [path.name for ending in ("*.yaml", "*.yml") for path in Path().glob(ending)]
    here = [(name, "file") for name in sorted(files)[:MOST_FILES]]
    return _fitting([*((info.name, info.about) for info in list_scenarios()), *here], incomplete)


def variants(ctx: typer.Context, incomplete: str) -> list[Offer]:
    """The variants of the scenario that this command line names."""
    from sil.scenario_source import variants_of

    return _fitting(((name, about) for name, about in variants_of(str(ctx.params.get("scenario") or ""))), incomplete)


def runs(incomplete: str) -> list[Offer]:
    """Run directories here and in runs/, newest first."""
    found = [path.parent for pattern in ("runs/*/run.*", "*/run.*") for path in Path().glob(pattern)]
    folders = sorted(dict.fromkeys(found), key=_changed, reverse=True)
    return _fitting(((str(folder), _verdict(folder)) for folder in folders[:MOST_FILES]), incomplete)


def runs_and_scenarios(incomplete: str) -> list[Offer]:
    return [*runs(incomplete), *scenarios(incomplete)]


def clocks(incomplete: str) -> list[Offer]:
    return _fitting(CLOCKS, incomplete)


def boards(incomplete: str) -> list[Offer]:
    return _fitting([*BOARDS, *_devices()], incomplete)


def testable_boards(incomplete: str) -> list[Offer]:
    """What `sil board-test` takes."""
    started = [offer for offer in BOARDS if offer[0] not in ("inproc", "none")]
    return _fitting([*started, *_devices(), ("udp://127.0.0.1:5005", "the board at this address")], incomplete)


def own_links(incomplete: str) -> list[Offer]:
    """Links of a board that is started."""
    return _fitting(LINKS[:2], incomplete)


def check_groups(incomplete: str) -> list[Offer]:
    """Groups of checks of `sil board-test`."""
    return _fitting(CHECK_GROUPS, incomplete)


def rungs(incomplete: str) -> list[Offer]:
    """What `sil ladder --with` adds to the usual rungs."""
    return _fitting([("qemu", "the firmware's image in QEMU"), *_devices()], incomplete)


def one_of(*words: str) -> Callable[[str], list[str]]:
    """These words."""
    return lambda incomplete: [word for word in words if word.startswith(incomplete)]


def links(incomplete: str) -> list[Offer]:
    return _fitting([*LINKS, *_devices()], incomplete)


def addresses(incomplete: str) -> list[Offer]:
    """Where viewers may connect."""
    return _fitting(ADDRESSES, incomplete)


def sets(ctx: typer.Context, incomplete: str) -> list[Offer]:
    """KEY= and KEY=VALUE of every key of a scenario, a section at a time: `law.`, then `law.form=fixed`."""
    keys = {key: schema for key, schema in _keys(_laws(ctx)) if key.startswith(incomplete.partition("=")[0])}
    inside = incomplete
    while len(sections := {key[: key.find(".", len(inside)) + 1] or key for key in keys}) == 1:
        (only,) = sections
        if not only.endswith("."):  # one key is left: its values
            return _fitting(((f"{only}={value}", _about(keys[only])) for value in _values(keys[only])), incomplete)
        inside = only
    found = ((f"{name}=" if name in keys else name, _about(keys.get(name, {}))) for name in sorted(sections))
    return _fitting(found, incomplete)


# -- bash ----------------------------------------------------------------------------------------------------------


@contextmanager
def whole_words() -> Iterator[None]:
    """Inside, words that bash took apart at = and : are one again; what is printed is what bash has to put behind them.

    For bash, `--set law.form=fl` is the words law.form, = and fl, and it replaces the last one only.
    """
    words = os.environ.get("COMP_WORDS", "").split("\n")
    index = os.environ.get("COMP_CWORD", "")
    if os.environ.get("_SIL_COMPLETE") != "complete_bash" or not index.isdecimal() or int(index) >= len(words):
        yield
        return
    joined = rejoined(words[: int(index) + 1])
    os.environ |= {"COMP_WORDS": "\n".join(joined), "COMP_CWORD": str(len(joined) - 1)}
    printed = StringIO()
    try:
        with redirect_stdout(printed):
            yield
    finally:
        for line in printed.getvalue().splitlines():
            print(behind(joined[-1], line))


def rejoined(words: list[str]) -> list[str]:
    """`["a", "=", "b"]` as `["a=b"]`; the last word is the one that is being typed."""
    joined: list[str] = []
    open_end = False
    for word in words:
        is_break = bool(word) and not word.strip(WORD_BREAKS)
        if joined and (is_break or open_end):
            joined[-1] += word
        else:
            joined.append(word)
        open_end = is_break
    return joined


def behind(typed: str, offer: str) -> str:
    """The part of `offer` behind the last = or : of what is typed; typed `--clock=l`, an offer is the value alone."""
    fixed = typed[: 1 + max(map(typed.rfind, WORD_BREAKS))]
    for before in (fixed, fixed.partition("=")[2]):
        if before and offer.startswith(before):
            return offer.removeprefix(before)
    return offer


# -- the schema ----------------------------------------------------------------------------------------------------


def _keys(law_names: tuple[str, ...]) -> Iterator[tuple[str, dict[str, Any]]]:
    """Dotted key and schema of everything that --set may set; parameters of these laws only, () for all."""
    from sil.scenarios import SCHEMA

    whole = json.loads(SCHEMA.read_text(encoding="utf-8"))
    known = whole["$defs"]

    def below(section: dict[str, Any], prefix: str) -> Iterator[tuple[str, dict[str, Any]]]:
        for name, schema in section["properties"].items():
            reference = next((part["$ref"] for part in (schema, *schema.get("anyOf", ())) if "$ref" in part), "")
            if reference:
                yield from below(known[reference.rpartition("/")[2]], f"{prefix}{name}.")
            elif name not in ("extends", "variants") and f"{prefix}{name}" != "law.params":
                yield f"{prefix}{name}", schema

    yield from below(whole, "")
    for name in sorted(known):
        if name.startswith("Params_") and (not law_names or name.removeprefix("Params_") in law_names):
            yield from below(known[name], "law.params.")


def _laws(ctx: typer.Context) -> tuple[str, ...]:
    """The law that this command line is about, () if that cannot be said."""
    said = [text.partition("=")[2] for text in ctx.params.get("set_") or () if text.startswith("law.name=")]
    if said:
        return (said[-1],)
    from sil.scenario_errors import ScenarioInvalid
    from sil.scenario_source import read_scenario

    # While the value of --set is not there yet, the scenario is left among the arguments that nobody took.
    for name in filter(None, (ctx.params.get("scenario"), *ctx.args)):
        try:
            return (str(read_scenario(str(name), ()).data["law"]["name"]),)
        except (ScenarioInvalid, KeyError, TypeError):  # no such scenario, or it says nothing about its law
            continue
    return ()


def _values(schema: dict[str, Any]) -> list[str]:
    """What may stand behind KEY=: nothing yet (so that the shell adds no space), the names there are, the default."""
    names: list[Any] = []
    for part in (schema, *schema.get("anyOf", ())):
        names += part.get("enum", ())
        names += [True, False] if part.get("type") == "boolean" else ()
        names += [None] if part.get("type") == "null" or None in _types(part) else ()
    default = [schema["default"]] if "default" in schema else []
    return ["", *dict.fromkeys(map(_yaml, [*default, *names]))]


def _types(schema: dict[str, Any]) -> list[Any]:
    types = schema.get("type")
    return [None if each == "null" else each for each in types] if isinstance(types, list) else []


def _yaml(value: Any) -> str:
    return value if isinstance(value, str) else json.dumps(value, separators=(",", ":"))


def _about(schema: dict[str, Any]) -> str:
    return str(schema.get("description", ""))


def _short(about: str) -> str:
    """One line without what a shell or rich would take for markup; longer ones are broken, which zsh cannot show."""
    plain = about.translate(PLAIN)
    return plain if len(plain) <= LONGEST else plain[: LONGEST - 3] + "..."


# -- files ---------------------------------------------------------------------------------------------------------


def _devices() -> list[Offer]:
    found = sorted(path for pattern in DEVICES for path in Path("/").glob(pattern.removeprefix("/")))
    return [(f"serial://{path}", "serial device") for path in found]


def _changed(folder: Path) -> float:
    try:
        return folder.stat().st_mtime
    except OSError:
        return 0.0


def _verdict(folder: Path) -> str:
    """`passed`, from the summary of a run."""
    try:
        return str(json.loads((folder / "summary.json").read_text(encoding="utf-8"))["verdict"])
    except (OSError, ValueError, KeyError, TypeError):
        return "no summary"


def _fitting(offers: Iterable[Offer], incomplete: str) -> list[Offer]:
    return [(word, _short(about)) for word, about in dict.fromkeys(offers) if word.startswith(incomplete)]
