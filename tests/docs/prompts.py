"""The words that a program gets of a line, typed at the prompts of Windows.

Both are written from the rules: those of the command prompt and of the C library that splits the line for the
program ("Parsing C++ command-line arguments"), and PowerShell's in "about_Parsing" and "about_Quoting_Rules".
What a line must not use there is refused: the prompt would do something else with it than a shell does.
"""

from __future__ import annotations

import re


class NotForThisPromptError(Exception):
    """The line does something else there."""


def command_prompt(line: str) -> list[str]:
    """The words at the command prompt, ``cmd``. It has no comments and no single quotes.

    Raises:
        NotForThisPromptError: variables, pipes, carets and the like.
    """
    if re.search(r"%[^%\s]+%", line):
        raise NotForThisPromptError("a variable")
    if found := re.search(r"[&|<>^()#']", re.sub(r'"[^"]*"?', "", line)):
        raise NotForThisPromptError(f"{found[0]} outside of double quotes")
    return _split_by_the_program(line)


def powershell(line: str) -> list[str]:
    """The words in PowerShell. A # at the beginning of a word begins a comment there, as in sh.

    Raises:
        NotForThisPromptError: variables, arrays, pipes, and the like.
    """
    words: list[str] = []
    rest = line.strip()
    while rest and not rest.startswith("#"):
        match = re.match(r'(?:"[^"]*"|[^\s"])+', rest)
        if match is None:
            raise NotForThisPromptError("an open quote")
        word, bare = match[0], re.sub(r'"[^"]*"', "", match[0])
        if bare.startswith(("@", "<", ">")) or (found := re.search(r"[$`]", word)):
            raise NotForThisPromptError(f"{word} is expanded")
        if found := re.search(r"[,;&|(){}']", bare):
            raise NotForThisPromptError(f"{found[0]} outside of double quotes")
        words.append(word.replace('"', ""))
        rest = rest[match.end() :].lstrip()
    return words


def _split_by_the_program(line: str) -> list[str]:
    """Split as the C library splits a line without backslashes before quotes."""
    if '\\"' in line:
        raise NotForThisPromptError("a backslash before a quote")
    return [word.replace('"', "") for word in re.findall(r'(?:"[^"]*"?|[^\s"])+', line)]
