"""What griffe is not told of a NamedTuple: that it is made of its fields, so that their types stand beside what they are."""

from __future__ import annotations

from typing import Any

from griffe import Class, Extension, Function, Parameter, ParameterKind, Parameters


class NamedTuples(Extension):
    """Give every NamedTuple the signature that Python gives it."""

    def on_class_members(self, *, cls: Class, **_: Any) -> None:
        """Add the method that takes its fields."""
        if not any(str(base).rpartition(".")[2] == "NamedTuple" for base in cls.bases):
            return
        taken = [Parameter("self", kind=ParameterKind.positional_or_keyword)]
        taken += [
            Parameter(name, annotation=field.annotation, kind=ParameterKind.positional_or_keyword, default=field.value)
            for name, field in cls.attributes.items()
        ]
        cls.set_member("__init__", Function("__init__", parameters=Parameters(*taken), parent=cls))
