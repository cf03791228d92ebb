"""Exceptions of this package."""

from __future__ import annotations


class Error(Exception):
    """A trial that cannot be computed, or a file that cannot be read.

    >>> try:
    ...     biflag.read_log("missing.mcap")
    ... except biflag.Error as error:
    ...     print(error.key)
    missing.mcap

    Attributes:
        key: What is concerned: a parameter, an argument or a file; may be empty.
        reason: Why.
        help: What to do about it; may be empty.
    """

    def __init__(self, text: str, key: str = "", reason: str = "", help: str = "") -> None:
        super().__init__(text, key, reason, help)
        self.key = key
        self.reason = reason
        self.help = help

    def __str__(self) -> str:
        text = str(self.args[0])
        return f"{text}\n  help: {self.help}" if self.help else text


class ParameterError(Error, ValueError):
    """An argument or a parameter of a robot with an impossible value.

    >>> try:
    ...     biflag.Robot.physical().replace({"flagellum.young_pa": -1})
    ... except biflag.ParameterError as error:
    ...     print(error.key)
    flagellum.young_pa
    """
