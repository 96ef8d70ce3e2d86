"""`pcjax completion`: what a shell needs to complete commands, flags and choices."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping

SHELLS = ("bash", "zsh", "fish")


def add_completion(parser: argparse.ArgumentParser) -> None:
    """The command's arguments."""
    parser.add_argument(
        "shell",
        choices=SHELLS,
        help="whose script is printed; keep it in ~/.local/share/bash-completion/completions/pcjax "
        "or ~/.config/fish/completions/pcjax.fish, for zsh in a file that ~/.zshrc sources",
    )
    parser.set_defaults(run=_run)


def _run(arguments: argparse.Namespace) -> None:
    from pcjax.cli import every_parser

    print(_SCRIPTS[arguments.shell](every_parser()))


def _flags(parser: argparse.ArgumentParser) -> dict[str, argparse.Action]:
    """Every flag of a command by its long name."""
    return {
        max(action.option_strings, key=len): action
        for action in parser._actions
        if action.option_strings and action.help != argparse.SUPPRESS
    }


def _choices(action: argparse.Action) -> str:
    return " ".join(map(str, action.choices or ()))


def _bash(parsers: Mapping[str, argparse.ArgumentParser]) -> str:
    cases = []
    for name, parser in parsers.items():
        flags = _flags(parser)
        words = [a for a in parser._actions if not a.option_strings and a.choices]
        for flag, action in flags.items():
            if action.choices:
                cases.append(f'    {name}:{flag}) words="{_choices(action)}" ;;')
        own = " ".join([*flags, *(_choices(action) for action in words)])
        cases.append(f'    {name}:*) words="{own}" ;;')
    return "\n".join(
        [
            "_pcjax() {",
            '  local word="${COMP_WORDS[COMP_CWORD]}" words=""',
            '  local before="${COMP_WORDS[COMP_CWORD-1]}"',
            '  case "${COMP_CWORD}:${COMP_WORDS[1]}" in',
            f'    1:*) words="{" ".join(parsers)} --help --version" ;;',
            '    *) case "${COMP_WORDS[1]}:${before}" in',
            *(f"  {case}" for case in cases),
            "    esac ;;",
            "  esac",
            '  COMPREPLY=($(compgen -W "$words" -- "$word"))',
            "}",
            "complete -o default -F _pcjax pcjax",
        ]
    )


def _zsh(parsers: Mapping[str, argparse.ArgumentParser]) -> str:
    return "autoload -U +X bashcompinit && bashcompinit\n" + _bash(parsers)


def _fish(parsers: Mapping[str, argparse.ArgumentParser]) -> str:
    lines = [f"complete -c pcjax -n __fish_use_subcommand -a {name}" for name in parsers]
    for name, parser in parsers.items():
        there = f"-n '__fish_seen_subcommand_from {name}'"
        for flag, action in _flags(parser).items():
            line = f"complete -c pcjax {there} -l {flag.removeprefix('--')}"
            takes = "" if action.nargs == 0 else " -r"
            lines.append(line + takes + (f" -a '{_choices(action)}'" if action.choices else ""))
        lines += [
            f"complete -c pcjax {there} -a '{_choices(action)}'"
            for action in parser._actions
            if not action.option_strings and action.choices
        ]
    return "\n".join(lines)


_SCRIPTS: dict[str, Callable[[Mapping[str, argparse.ArgumentParser]], str]] = {
    "bash": _bash,
    "zsh": _zsh,
    "fish": _fish,
}
