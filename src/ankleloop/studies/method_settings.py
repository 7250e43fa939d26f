"""Methods of a study in the configuration: name, label, options, and options to select."""

from __future__ import annotations

from functools import reduce
from operator import or_
from typing import Annotated, Any, Literal, Self

from pydantic import Field, create_model, model_validator

from ankleloop.methods.registry import METHODS
from ankleloop.methods.selection import check_selection
from ankleloop.options import Options, option


class MethodSettings(Options):
    """A method of a study: its name, its label and its options."""

    method: str = option(description="identification method")
    label: str | None = option(None, "name in tables and legends; null for the key")
    options: Options = option(description="options of the method; those left out have their defaults")
    select: dict[str, Annotated[list[Any], Field(min_length=1)]] = option(
        {}, "options to select on data that were not fitted, each with its candidates from simple to complex"
    )
    criterion: Literal["instrumental", "cross-validation"] | None = option(
        None, "criterion of that selection; null for instrumental with a reference, cross-validation without"
    )

    @model_validator(mode="after")
    def _check_candidates(self) -> Self:
        options = {name: getattr(self.options, name) for name in self.options.model_fields_set}
        try:
            check_selection(f"method {self.method!r}", type(self.options), options, self.select, self.criterion)
        except TypeError as error:  # pydantic names the place of a ValueError only
            raise ValueError(str(error)) from None
        return self

    @property
    def fixed_options(self) -> dict[str, Any]:
        """Options with their defaults, without those that are to be selected."""
        return {name: value for name, value in self.options if name not in self.select}

    @property
    def identify_options(self) -> dict[str, Any]:
        """All options that `ankleloop.identify` takes, the candidates of a selection among them."""
        selection = {"select": self.select, "criterion": self.criterion} if self.select else {}
        return {**self.fixed_options, **selection}


def union_of_methods() -> Any:
    """One model of `MethodSettings` for each set of options; the name of the method tells them apart."""
    names: dict[type[Options], list[str]] = {}
    for name, entry in METHODS.items():
        names.setdefault(entry.options, []).append(name)
    method, field = (MethodSettings.model_fields[name].description or "" for name in ("method", "options"))
    models: list[Any] = [
        create_model(
            options.__name__.replace("Options", "Settings"),
            __base__=MethodSettings,
            __doc__=f"A method with {options.__name__}.",
            method=(Literal[tuple(members)], option(description=method)),  # type: ignore[arg-type] # of the registry
            options=(options, option(description=field, default_factory=options)),
        )
        for options, members in names.items()
    ]
    return Annotated[reduce(or_, models), Field(discriminator="method")]
