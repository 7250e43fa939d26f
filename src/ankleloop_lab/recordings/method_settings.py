"""A method of a study or a command: its label, its options, and those that are to be selected."""

from __future__ import annotations

from typing import Annotated, Any, Literal, Self

from pydantic import Field, create_model, model_validator

from ankleloop.methods.selection import check_selection
from ankleloop.options import Options, option
from ankleloop_lab.checking import Values


class MethodSettings(Options):
    """A method of a study: its name, its label and its options."""

    method: str = option(description="identification method")
    label: str | None = option(None, "name in tables and legends; null for the key")
    options: Options = option(
        description="options of the method; those left out have their defaults"
    )
    select: dict[str, Annotated[list[Any], Field(min_length=1)]] = option(
        {},
        "options to select on data that were not fitted, each with its candidates from simple to complex",
    )
    criterion: Literal["instrumental", "cross-validation"] | None = option(
        None,
        "criterion of that selection; null for instrumental with a reference, cross-validation without",
    )

    @model_validator(mode="after")
    def _check_candidates(self) -> Self:
        options = self.options.model_dump(exclude_unset=True)
        try:
            check_selection(
                f"method {self.method!r}", type(self.options), options, self.select, self.criterion
            )
        except TypeError as error:  # pydantic names the place of a ValueError only
            raise ValueError(str(error)) from None
        return self

    @property
    def fixed_options(self) -> Values:
        """Options with their defaults, without those that are to be selected, and a rate only if it is given."""
        options = {name: value for name, value in self.options if name not in self.select}
        if "identification_rate" not in self.options.model_fields_set:
            options.pop("identification_rate", None)  # that of a trial follows from its own
        return options

    @property
    def identify_options(self) -> Values:
        """All options that `ankleloop.identify` takes, the candidates of a selection among them."""
        selection = {"select": self.select, "criterion": self.criterion} if self.select else {}
        return {**self.fixed_options, **selection}

    @property
    def analysed(self) -> Values:
        """The method as `ankleloop_lab.recordings.analysis.analyse` takes it."""
        return {**self.model_dump(exclude={"options"}), "options": self.fixed_options}


def settings_of(options: type[Options], *names: str) -> type[MethodSettings]:
    """Settings of the methods of some names, which have these options."""
    fields = MethodSettings.model_fields
    chosen = option(description=fields["options"].description or "", default_factory=options)
    return create_model(
        options.__name__.replace("Options", "Settings"),
        __base__=MethodSettings,
        __doc__=f"A method with {options.__name__}.",
        method=(Literal[names], fields["method"]),  # type: ignore[arg-type]
        options=(options, chosen),
    )
