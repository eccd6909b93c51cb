"""The command line: `helideck <verb>`.

A verb is one file here, `<verb>.py`, with a frozen dataclass `<Verb>` whose fields are its arguments (tyro reads
names, types and docstrings) and whose `run` does the work and returns the exit code. Only the verb that is called
is imported, and verbs import what is heavy inside `run`, so that help comes at once.

Exit codes: 0 success, 1 a flight or check that failed, 2 unusable input, 130 interrupted.
"""

import contextlib
import difflib
import io
import os
import sys
from collections.abc import Sequence
from importlib import import_module
from importlib.metadata import version
from typing import Annotated, Any, Protocol, Union

from flightlog.errors import UserError
from helideck.cli.document import emit
from helideck.cli.see import SIGHTS
from helideck.cli.usage import one_line

# in the order of the help
VERBS: tuple[str, ...] = (
    "land", "replay", "estimate", "diagnose", "predict", "see", "campaign", "reproduce", "vehicle", "list", "doctor",
)  # fmt: skip

DESCRIPTION = (
    "A small helicopter that sees, fuses faulty sensors, hovers over an H and lands on it. "
    "`helideck VERB --help` tells more and gives an example."
)


class Verb(Protocol):
    """What a verb's dataclass offers."""

    def run(self) -> int:
        """Do the work; the exit code."""
        ...


def main(argv: Sequence[str] | None = None) -> int:
    """Run `helideck` with these words (default: the process's own); the exit code."""
    words = [*(sys.argv[1:] if argv is None else argv)] or ["--help"]  # `list` is one of the verbs' modules here
    as_json = "--json" in words

    def fail(message: str, code: int) -> int:
        if as_json:
            emit({"error": message})
        print(f"helideck: {message}", file=sys.stderr)
        return code

    try:
        try:
            code = _parse(words).run()
        except SystemExit as end:  # help, version and shell completion end like this
            code = end.code if isinstance(end.code, int) else 0
        sys.stdout.flush()
        return code
    except UserError as error:
        return fail(str(error), 2)
    except KeyboardInterrupt:
        return fail("interrupted", 130)
    except BrokenPipeError:  # the reader left (`helideck ... | head`); nothing may be written at exit either
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except Exception as error:  # ours to mend: the traceback follows on stderr
        if as_json:
            emit({"error": f"{type(error).__name__}: {error}"})
        raise


def _parse(words: list[str]) -> Verb:
    """The verb that these words call, with its fields filled in."""
    import tyro

    if words == ["--version"]:
        print(version("helideck"))
        raise SystemExit(0)
    options: dict[str, Any] = {"config": (tyro.conf.FlagCreatePairsOff,)}
    if words[0] == "see" and words[1:2] and words[1] in SIGHTS:
        target, arguments, options["prog"] = _load(f"see_{words[1]}"), words[2:], f"helideck see {words[1]}"
    elif words[0] in VERBS:
        target, arguments, options["prog"] = _load(words[0]), words[1:], f"helideck {words[0]}"
    elif words[0].startswith("-"):
        target, arguments, options["prog"] = _overview(), words, "helideck"
        options["description"] = DESCRIPTION
    else:
        near = difflib.get_close_matches(words[0], VERBS, n=1)
        meant = f"did you mean {near[0]!r}? " if near else ""
        raise UserError(f"there is no verb {words[0]!r}; {meant}There are {', '.join(VERBS)}")
    complaints = io.StringIO()
    try:
        with contextlib.redirect_stderr(complaints):
            verb: Verb = tyro.cli(target, args=arguments, **options)
    except SystemExit as end:
        if end.code in (0, None):
            raise
        raise UserError(one_line(complaints.getvalue())) from None
    return verb


def _load(verb: str) -> Any:
    """The dataclass of a verb."""
    return getattr(import_module(f"helideck.cli.{verb}"), verb.title().replace("_", ""))


def _overview() -> Any:
    """A union of all verbs, each told in one line."""
    from tyro.conf import subcommand

    choices = []
    for name in VERBS:
        kind = _load(name)
        summary = (kind.__doc__ or "").strip().partition("\n\n")[0]
        choices.append(Annotated[kind, subcommand(name, description=summary)])
    return Union[tuple(choices)]  # noqa: UP007 - built at run time
