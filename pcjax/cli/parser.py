"""The parser: its errors are one line, and so are those of the commands."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from typing import Any, NoReturn

from pcjax.words import did_you_mean


def fail(message: str) -> NoReturn:
    print(f"pcjax: {message}", file=sys.stderr)
    sys.exit(2)


class Terminated(SystemExit):
    """SIGTERM has come: there is time to leave the files in order, and for nothing else."""


class Parser(argparse.ArgumentParser):
    """An argument parser whose errors are one line, with the nearest name for a misspelt one."""

    def error(self, message: str) -> NoReturn:
        fail(f"{message} (see '{self.prog} --help')")

    def unknown(self, words: Sequence[str]) -> NoReturn:
        word = words[0]
        flags = [flag for flag in self._option_string_actions if flag.startswith("--")]
        hint = did_you_mean(word.split("=")[0], flags)
        what = "flag" if word.startswith("-") else "argument"
        self.error(f"unknown {what} {word}" + (f": {hint.rstrip()}" if hint else ""))

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        if action.choices is not None and value not in action.choices:
            allowed = [str(choice) for choice in action.choices]
            hint = did_you_mean(str(value), allowed)
            name = "/".join(action.option_strings) or action.metavar or action.dest
            self.error(f"{name} is {value!r}: {hint}it has to be one of {', '.join(allowed)}")


class HelpFormatter(argparse.ArgumentDefaultsHelpFormatter):
    """Adds the default to a flag's help where there is one to tell."""

    def _get_help_string(self, action: argparse.Action) -> str | None:
        no_default = action.default is None or action.default is False
        return action.help if no_default else super()._get_help_string(action)


class NegativeNumber:
    def match(self, text: str) -> bool:
        try:
            float(text)
        except ValueError:
            return False
        return text.startswith("-")
