"""Settings and options: one declaration of a field gives its default, bounds, checks, documentation and JSON schema.

Arguments that are no options are checked by functions with the same wording of limits. A flag is no number, text is no
flag, a float without a fraction is a whole number, numbers of numpy are numbers, and no number is nan or infinite.
"""

from __future__ import annotations

import inspect
import os
import re
import reprlib
from collections.abc import Callable, Collection, Iterable, Mapping
from functools import cache, partial
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, Literal, Self, TypeVar, Union, get_args, get_origin

import numpy as np
from numpy.typing import ArrayLike
from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    ValidationError,
    create_model,
    model_validator,
)

from ankleloop.errors import DataError

Function = TypeVar("Function", bound=Callable[..., Any])

KINDS = {
    "int": "a whole number",
    "float": "a finite number",
    "bool": "true or false",
    "string": "text",
    "list": "a list in brackets",
    "dict": "a mapping of keys to values",
    "model": "a mapping of keys to values",
}
BOUNDS = ("ge", "le", "gt", "lt")
LARGEST_MEMORY = 64 * 2**30  # bytes, of a machine that does not state its memory

_SHORT = reprlib.Repr()
_SHORT.maxstring = _SHORT.maxother = _SHORT.maxlong = 80


def option(default: Any = ..., description: str = "", *, unit: str = "1", **bounds: Any) -> Any:
    """Declare a field of `Options`.

    Parameters
    ----------
    default : object
        Default; left out, the field is required.
    description : str
        What it is, in one phrase.
    unit : str
        Unit, "1" where it has none.
    **bounds
        `ge`, `gt`, `le`, `lt` and whatever else `pydantic.Field` takes.

    Returns
    -------
    pydantic.fields.FieldInfo

    Examples
    --------
    >>> class Window(Options):
    ...     length: float = option(5.0, "length of the window", unit="s", gt=0)
    >>> Window.unit("length"), Window.limits("length"), Window.defaults()
    ('s', {'gt': 0}, {'length': 5.0})
    """
    return Field(default, description=description, json_schema_extra={"unit": unit}, **bounds)


class Options(BaseModel):
    """A frozen set of values whose fields are declared by `option`: an unknown name or a wrong value is refused.

    Examples
    --------
    A flag is no number, text is no flag, and no number is nan or infinite. Numbers of numpy are numbers, and a float
    without a fraction is a whole number, as tables and YAML files write it.

    >>> class Window(Options):
    ...     length: float = option(5.0, "length of the window", unit="s", gt=0, le=60)
    >>> Window.parse("the window", length=2).length
    2.0
    >>> Window.parse("the window", length=0.0)
    Traceback (most recent call last):
      ...
    ValueError: the window: length must be above 0 and at most 60 s, got 0.0.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    @classmethod
    def __pydantic_init_subclass__(cls, **_: Any) -> None:
        cls.__doc__ = f"{inspect.cleandoc(cls.__doc__ or '')}\n\n{cls.numpydoc()}"

    @model_validator(mode="before")
    @classmethod
    def _as_plain(cls, values: Any) -> Any:
        """Numbers of numpy are numbers, and floats without a fraction are whole numbers where those are due."""
        if not isinstance(values, Mapping):
            return values
        plain = {name: as_plain(value) for name, value in values.items()}
        for name, field in cls.model_fields.items():
            value = plain.get(name)
            if isinstance(value, float) and value.is_integer():
                is_count = int in union_members(field.annotation)
                plain[name] = int(value) if is_count else value
        return plain

    @classmethod
    def parse(cls, owner: str, /, **values: Any) -> Self:
        """Check values and fill in the defaults.

        Parameters
        ----------
        owner : str
            What has these options, for error messages.
        **values
            Values by name.

        Returns
        -------
        Options

        Raises
        ------
        TypeError
            For a name that is not an option.
        ValueError
            For a value of another type or out of its range; the message has owner, name, value, unit and bounds.
        """
        try:
            return cls(**values)
        except ValidationError as error:
            cls.check_names(owner, values)
            raise ValueError(f"{owner}: {cls.describe(error)}") from None

    @classmethod
    def check_names(cls, owner: str, names: Collection[str]) -> None:
        """Refuse names that are not options.

        Parameters
        ----------
        owner : str
            What has these options, for the message.
        names : collection of str
            Names.

        Raises
        ------
        TypeError
            For the first such name; the message has those that there are.
        """
        fields = cls.model_fields
        for name in names:
            if name not in fields:
                raise TypeError(
                    f"{owner} has no option {name!r}{suggest_name(name, fields)}; it has {', '.join(fields)}."
                )

    @classmethod
    def describe(cls, error: ValidationError) -> str:
        """Sentence about the first fault of a validation error."""
        first = error.errors()[0]
        if first["type"] == "value_error":  # of a validator of ours, whose message says all
            return str(first["ctx"]["error"])
        name = str(first["loc"][0])
        return f"{name} {describe_error(first, cls.unit(name), cls.limits(name))}."

    @classmethod
    def defaults(cls) -> dict[str, Any]:
        """Default of every option that has one, by name."""
        return {
            name: field.get_default()
            for name, field in cls.model_fields.items()
            if not field.is_required()
        }

    @classmethod
    def unit(cls, name: str) -> str:
        """Unit of a field, "1" where it has none."""
        field = cls.model_fields.get(name)
        extra: Any = field and field.json_schema_extra
        return str((extra or {}).get("unit", "1"))

    @classmethod
    def limits(cls, name: str) -> dict[str, float]:
        """Bounds of a field by the names that `option` has for them; none for an unknown field."""
        field = cls.model_fields.get(name)
        return {
            bound: getattr(item, bound)
            for item in (field.metadata if field else ())
            for bound in BOUNDS
            if hasattr(item, bound)
        }

    @classmethod
    def numpydoc(cls) -> str:
        """The fields as a numpydoc section."""
        lines = ["Parameters", "----------"]
        for name, field in cls.model_fields.items():
            default = "required" if field.is_required() else f"default {field.get_default()!r}"
            # For readers of Python, where YAML's null is None.
            text = re.sub(r"\bnull\b", "None", field.description or "")
            if cls.unit(name) != "1":
                text += f" [{cls.unit(name)}]"
            lines.append(f"{name} : {type_name(field.annotation)}, {default}")
            lines.append(f"    {text}.")
        return "\n".join(lines) + "\n"


def union_members(annotation: Any) -> tuple[Any, ...]:
    """Types of a field: the members of a union, or the single one."""
    return get_args(annotation) if get_origin(annotation) in (Union, UnionType) else (annotation,)


def show_fields(options: type[Options]) -> Callable[[Function], Function]:
    """Decorate a function that takes options as `**keywords`: its signature shows their names, types and defaults."""

    def decorate(function: Function) -> Function:
        signature = inspect.signature(function)
        *parameters, _ = signature.parameters.values()  # the last ones are the keywords
        parameters += [
            inspect.Parameter(
                name,
                inspect.Parameter.KEYWORD_ONLY,
                default=field.default,
                annotation=field.annotation,
            )
            for name, field in options.model_fields.items()
            if name not in signature.parameters
        ]
        function.__signature__ = signature.replace(parameters=parameters)  # type: ignore[attr-defined]  # PEP 362
        return function

    return decorate


def type_name(annotation: Any) -> str:
    """The type of a field as numpydoc writes it."""
    if get_origin(annotation) is Literal:
        return "{" + ", ".join(map(repr, get_args(annotation))) + "}"
    members = union_members(annotation)
    if len(members) > 1:
        return " or ".join(map(type_name, members))
    return "None" if annotation is NoneType else getattr(annotation, "__name__", str(annotation))


def describe_error(error: Mapping[str, Any], unit: str, limits: Mapping[str, float]) -> str:
    """What is wrong with a value, as a predicate: "must be between 1 and 20, got 0"."""
    kind = error["type"]
    context = error.get("ctx", {})
    value = show_value(error["input"])
    passed = {bound: context[bound] for bound in BOUNDS if bound in context}
    if passed:
        return f"must be {describe_limits(unit, **(limits or passed))}, got {value}"
    if kind == "literal_error":
        choices = context["expected"]
        if " or " in choices:
            choices = f"one of {choices}"
        return f"must be {choices}; got {value}"
    if kind == "value_error":
        return str(context["error"])
    expected = "a finite number" if kind == "finite_number" else KINDS.get(kind.partition("_")[0])
    if expected and kind.endswith(("_number", "_type")):
        words = describe_limits(unit, **limits)
        if words.startswith("at "):
            words = f"of {words}"
        elif unit != "1" and not words:
            words = f"[{unit}]"
        return f"must be {expected} {words}".rstrip() + f", got {value}"
    return f"is not usable, {error['msg'][0].lower()}{error['msg'][1:]}: got {value}"


def show_value(value: Any) -> str:
    """A value as a message shows it, cut where it is long."""
    return " ".join(_SHORT.repr(value).split())


def suggest_name(name: Any, names: Iterable[str]) -> str:
    """Question that offers the name that is nearest to an unknown one, in brackets; empty where none is near."""
    from difflib import get_close_matches  # here, because only errors need it

    close = get_close_matches(str(name), list(names), n=1)
    return f" (did you mean {close[0]!r}?)" if close else ""


def describe_limits(unit: str, **limits: float) -> str:
    """Limits (`ge`, `gt`, `le`, `lt`) in words, with their unit; empty where there are none."""
    if "ge" in limits and "le" in limits:
        words = f"between {_show_limit(limits['ge'])} and {_show_limit(limits['le'])}"
    else:
        forms = {"ge": "at least", "gt": "above", "le": "at most", "lt": "below"}
        words = " and ".join(
            f"{form} {_show_limit(limits[key])}" for key, form in forms.items() if key in limits
        )
    return words and words + ("" if unit == "1" else f" {unit}")


def _show_limit(limit: float) -> str:
    return f"{limit:.6g}".replace("e+", "e").replace("e0", "e").replace("e-0", "e-")


def as_plain(value: Any) -> Any:
    """A scalar of numpy as the number, flag or text of Python that it is; anything else unchanged."""
    if isinstance(value, np.generic | np.ndarray) and value.ndim == 0:
        return value.item()
    return value


def as_text(value: Any) -> str:
    """Text of an attribute, which libraries give as text, bytes or an array of one of them; "" for several or none."""
    array = np.asarray(value)
    item = array.item() if array.size == 1 else None
    if isinstance(item, bytes):
        item = item.decode(errors="replace")
    return "" if item is None else str(item).strip("\x00 \t\r\n")


def check_argument(
    kind: Any, owner: str, name: str, value: Any, unit: str = "1", **limits: float
) -> Any:
    """Check an argument as a field of `Options` of this kind and with these limits is checked."""
    model = _make_model(kind, name, unit, tuple(limits.items()))
    return getattr(model.parse(owner, **{name: value}), name)


check_number = partial(check_argument, float)
check_integer = partial(check_argument, int)
check_flag = partial(check_argument, bool)


@cache
def _make_model(kind: Any, name: str, unit: str, limits: tuple[tuple[str, Any], ...]) -> Any:
    """Options of one argument, which take as long to make as to use a hundred times."""
    fields: Any = {name: (kind, option(unit=unit, **dict(limits)))}
    return create_model("Argument", __base__=Options, **fields)


def check_path(owner: str, name: str, value: Any) -> Path:
    """Check that an argument is the path of a file."""
    if not isinstance(value, (str, os.PathLike)):
        raise TypeError(f"{owner}: {name} must be text or a pathlib.Path, got {show_value(value)}.")
    return Path(value)


def check_memory(owner: str, size: float, remedy: str) -> None:
    """Refuse what needs more memory than the machine has, before anything is allocated."""
    limit = _find_memory()
    if size > limit:
        needed, there = (f"{round(value / 1e9, 2):,g} GB" for value in (size, limit))
        raise ValueError(
            f"{owner}: this would need {needed} of memory, and the machine has {there}: {remedy}."
        )


@cache
def _find_memory() -> int:
    """Memory of the machine [bytes]."""
    try:
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, ValueError, OSError):  # not a POSIX system
        return LARGEST_MEMORY


def as_real(values: ArrayLike, name: str) -> np.ndarray:
    """Real numbers as an array of floats, without a copy where they are one."""
    try:
        array = np.asarray(values)
    except (TypeError, ValueError):  # lists of different lengths
        array = np.array(None)
    if array.dtype.kind not in "iuf":
        raise DataError(f"the {name} must be an array of real numbers, got {show_value(values)}.")
    return array.astype(float, copy=False)
