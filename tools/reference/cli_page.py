"""docs/reference/cli.md: every verb with its arguments, options, examples and exit codes, as --help says them.

Taken from the functions of sil/verbs/ and what typer was told of their parameters, so that no release of typer or click
changes the page.
"""

from __future__ import annotations

import inspect
import re
import typing
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

from typer.models import ArgumentInfo, CommandInfo, OptionInfo

from sil import cli
from sil.verbs.manual import said_of
from tools.spec_tables import table

HEAD = """# The command line

Made by `python -m tools.reference --write`; a test keeps it current. `sil VERB -h` says the same in a terminal.

Data goes to stdout, one-line errors to stderr: where, what was expected, what came, what is known. Exit codes, the
first that applies: 130 interrupted; 2 usage or invalid scenario; 3 link or board failure, or degraded timing;
1 a requirement failed, or a replay or diff differed; 0 passed. `sil --install-completion` makes TAB complete verbs,
scenarios, runs and keys; `sil --version` prints the versions.
"""
MARKUP = re.compile(r"\[/?(?:not )?(?:bold|dim|cyan)?\]")


class Parameter(NamedTuple):
    """One argument or option. `written` is how it is typed; `panel` the heading it stands under, empty: none."""

    written: str
    is_option: bool
    required: bool
    repeats: bool
    panel: str
    about: str


class Verb(NamedTuple):
    """One verb, a group of verbs, or one of these."""

    name: str
    call: Callable[..., Any]

    def parameters(self) -> list[Parameter]:
        """Arguments, then options in the order of their panels."""
        hints = typing.get_type_hints(self.call, include_extras=True)
        told = [_parameter(hints[name], given.default) for name, given in _signature(self.call)]
        panels = list(dict.fromkeys(each.panel for each in told))
        return sorted(told, key=lambda each: (each.is_option, panels.index(each.panel)))


def groups() -> dict[str, list[Verb]]:
    """The verbs by the panel of the help that they stand in; the kinds of a group of verbs one by one."""
    found: dict[str, list[Verb]] = {}
    for command in cli.app.registered_commands:
        found.setdefault(str(command.rich_help_panel), []).append(Verb(f"sil {_name(command)}", _call(command)))
    for group in cli.app.registered_groups:
        inner = group.typer_instance
        assert inner is not None
        name = f"sil {inner.info.name}"
        kinds = [Verb(f"{name} {_name(each)}", _call(each)) for each in inner.registered_commands]
        found.setdefault(str(group.rich_help_panel), []).extend([Verb(name, _with_help(inner.info.help)), *kinds])
    return found


def markdown() -> str:
    """The whole page."""
    return "\n".join([HEAD, *(part for title, verbs in groups().items() for part in _group(title, verbs))])


def _group(title: str, verbs: list[Verb]) -> Iterator[str]:
    yield f"## {title}\n"
    rows = [(f"[`{verb.name}`](#{_anchor(verb.name)})", _prose(said_of(verb.call).summary)) for verb in verbs]
    yield table(("verb", "what it does"), rows)
    for verb in verbs:
        yield from _verb(verb)


def _verb(verb: Verb) -> Iterator[str]:
    said, parameters = said_of(verb.call), verb.parameters()
    yield f"### {verb.name}\n\n{_prose(said.summary)}\n\n```text\n{_usage(verb.name, parameters)}\n```\n"
    yield from (f"{_prose(each)}\n" for each in said.prose)
    if parameters:
        yield table(("parameter", "meaning"), _rows(parameters))
    if said.examples:
        yield "Examples:\n\n```text\n" + "\n".join(said.examples) + "\n```\n"
    if said.codes:
        yield table(("exit code", "meaning"), [(code, _prose(about)) for code, about in said.codes])


def _usage(name: str, parameters: list[Parameter]) -> str:
    given = [each for each in parameters if not each.is_option]
    words = [each.written.removesuffix("...") + ("..." if each.repeats else "") for each in given]
    needed = [f"{each.written}" for each in parameters if each.is_option and each.required]
    free = any(each.is_option and not each.required for each in parameters)
    shown = [word if each.required else f"[{word}]" for word, each in zip(words, given, strict=True)]
    return " ".join([name, *shown, *needed, *(["[OPTIONS]"] if free else []), *([] if parameters else ["KIND ..."])])


def _rows(parameters: list[Parameter]) -> Iterator[tuple[str, str]]:
    panel = ""
    for each in parameters:
        if each.panel != panel:
            panel = each.panel
            yield "", f"**{panel}**"
        yield f"`{each.written}`", each.about


# -- what typer was told -----------------------------------------------------------------------------------------------


def _name(command: CommandInfo) -> str:
    return command.name or _call(command).__name__.replace("_", "-")


def _call(command: CommandInfo) -> Callable[..., Any]:
    assert command.callback is not None
    return command.callback


def _with_help(text: Any) -> Callable[..., Any]:
    """A group of verbs, which only has a help text, as if it were a verb without parameters."""

    def group() -> None: ...

    group.__doc__ = str(text)
    return group


def _signature(call: Callable[..., Any]) -> list[tuple[str, inspect.Parameter]]:
    return list(inspect.signature(call).parameters.items())


def _parameter(hint: Any, default: Any) -> Parameter:
    info: ArgumentInfo | OptionInfo = hint.__metadata__[0]
    kind = hint.__origin__
    is_option, required = isinstance(info, OptionInfo), default is inspect.Parameter.empty
    written = info.metavar or ("PATH" if "Path" in str(kind) else "TEXT")
    if is_option:
        flags = ", ".join([str(info.default), *(info.param_decls or ())])
        written = flags if "bool" in str(kind) else f"{flags} {written}"
    about = " ".join(filter(None, (_prose(info.help or ""), _range(info), _default(info, default))))
    return Parameter(written, is_option, required, "list" in str(kind), info.rich_help_panel or "", about)


def _range(info: ArgumentInfo | OptionInfo) -> str:
    return "" if info.min is None else f"From {info.min:.10g}" + ("." if info.max is None else f" to {info.max:.10g}.")


def _default(info: ArgumentInfo | OptionInfo, default: Any) -> str:
    """The default as the help shows it; flags and what is looked for elsewhere have none."""
    known = not any(default is each for each in (inspect.Parameter.empty, None, False))
    said = f"{default:.10g}" if isinstance(default, float) else default
    return f"Default: `{said}`." if known and info.show_default else ""


# -- text --------------------------------------------------------------------------------------------------------------


def _anchor(name: str) -> str:
    return name.replace(" ", "-")


def _prose(text: str) -> str:
    """Help text as Markdown: marks of the terminal gone, signs that Markdown would take for its own kept."""
    return re.sub(r"([|*<])", r"\\\1", MARKUP.sub("", text))
