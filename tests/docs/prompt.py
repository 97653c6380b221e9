"""Code that awaits at the top, compiled and run as ``python -m asyncio`` and notebooks do."""

from __future__ import annotations

import ast
import inspect
from types import CodeType, FunctionType
from typing import Any


def compiled(source: str | ast.Module, where: str) -> CodeType:
    """Compile it; errors name where it stands."""
    code = compile(source, where, "exec", ast.PyCF_ALLOW_TOP_LEVEL_AWAIT, dont_inherit=True)
    assert isinstance(code, CodeType)
    return code


async def run(code: CodeType, names: dict[str, Any]) -> None:
    """Run it to its end; what it defines stands among the names."""
    outcome = FunctionType(code, names)()
    if inspect.iscoroutine(outcome):
        await outcome
