# SPDX-License-Identifier: Apache-2.0
"""What several commands share: options that take several values, progress, output of documents."""

from __future__ import annotations

import json
import math
import sys
from contextlib import contextmanager
from pathlib import Path

import click
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from ..errors import DriveidError
from ..files import write_text

ANSWER, USAGE, BAD_DATA = 0, 2, 3


class DriveidCommand(click.Command):
    """Lets an option be followed by several values: --held-out a.csv b.csv, --given K_t_Nm_A=0.05 pole_pairs=4.

    `spread` maps the option to the number of positional arguments that must stand before it takes more than one value;
    -1: it takes every further NAME=VALUE that is no file."""

    def __init__(self, *args, spread: dict[str, int] | None = None, **kwargs):
        super().__init__(*args, **kwargs)
        self.spread = spread or {}

    def parse_args(self, ctx, args):
        return super().parse_args(ctx, self._expand(args))

    def _expand(self, args: list[str]) -> list[str]:
        takes_value = {name for p in self.params if isinstance(p, click.Option) and not p.is_flag for name in p.opts}
        out, positionals, at = [], 0, 0
        while at < len(args):
            word = args[at]
            at += 1
            out.append(word)
            if word == "--":
                return out + args[at:]
            if word in takes_value and at < len(args):
                out.append(args[at])
                at += 1
                while word in self.spread and at < len(args) and self._more(args[at], self.spread[word], positionals):
                    out += [word, args[at]]
                    at += 1
            elif not word.startswith("-") or word == "-":
                positionals += 1
        return out

    @staticmethod
    def _more(word: str, needed: int, positionals: int) -> bool:
        if word.startswith("-") and len(word) > 1:
            return False
        if needed < 0:
            return "=" in word and not Path(word).exists()
        return positionals >= needed


class FiniteRange(click.FloatRange):
    """FloatRange lets nan through: it is neither below nor above."""

    def convert(self, value, param, ctx):
        number = super().convert(value, param, ctx)
        if not math.isfinite(number):
            self.fail(f"{value} is no number to go by", param, ctx)
        return number


def invoke_guard(function):
    """Errors of ours become click's, so that tests and programs see exit code 2 with one sentence."""
    from functools import wraps

    @wraps(function)
    def guarded(*args, **kwargs):
        try:
            return function(*args, **kwargs)
        except DriveidError as e:
            raise OneSentence(str(e)) from e
    return guarded


class OneSentence(click.ClickException):
    exit_code = USAGE

    def show(self, file=None) -> None:
        click.echo(f"driveid: {self.message}", err=True)


def say(text: str) -> None:
    click.echo(text, err=True)


@contextmanager
def progress_bar(title: str):
    """Yields a callback (done, what). A bar on a terminal's standard error, silence elsewhere."""
    console = Console(stderr=True)
    if not console.is_terminal:
        yield None
        return
    with Progress(TextColumn("{task.description}"), BarColumn(), TextColumn("{task.percentage:>3.0f} %"), TimeElapsedColumn(),
                  console=console, transient=True) as bar:
        task = bar.add_task(title, total=1.0)
        yield lambda done, what: bar.update(task, completed=done, description=what or title)


def write_document(target: str | None, document: dict) -> None:
    """--json F; '-' is standard output."""
    if target is None:
        return
    text = json.dumps(document, indent=2, ensure_ascii=False, allow_nan=False) + "\n"
    if target == "-":
        sys.stdout.write(text)
        sys.stdout.flush()
    else:
        write_text(target, text)


def write_model(target: str | None, toml: str) -> None:
    if target == "-":
        sys.stdout.write(toml)
        sys.stdout.flush()
    elif target is not None:
        write_text(target, toml)


def stdout_console(*taken: str | None) -> Console:
    """For people: standard output, unless a document goes there."""
    console = Console(stderr="-" in taken, highlight=False)
    return console if console.is_terminal else Console(stderr="-" in taken, highlight=False, width=120)
