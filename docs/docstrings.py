"""An extension of Griffe: what a docstring says of each parameter becomes an item of a list.

Our docstrings are prose with `name: what it is` in it, which Markdown would run together.
"""

import re
from typing import Any

import griffe

LAST = r"^(?=(?:Returns|Raises|Warns|Pixels)\b)"


class ParameterList(griffe.Extension):
    """Changes the text of functions' docstrings before they are rendered."""

    def on_function(self, *, func: griffe.Function, **_: Any) -> None:
        """Put each `name: ` of a parameter, and what comes after the last, on a line of its own."""
        names = "|".join(re.escape(parameter.name) for parameter in func.parameters)
        if func.docstring is None or not names:
            return
        item = rf"(?:^|(?<=\.) |(?<=\n))((?:{names})(?:, (?:{names}))*): "
        text, found = re.subn(item, r"\n- **\1**: ", func.docstring.value, flags=re.MULTILINE)
        if found:
            func.docstring.value = re.sub(LAST, "\n", text, flags=re.MULTILINE)
