"""What tests that go through all methods ask of each, so that a new method is tested without a word about it."""

from ankleloop import METHODS
from ankleloop_lab.command_line.reading import list_choices


def basis_options(method, *bases):
    """Options for each of some bases that a method has; of one that has no option `basis` its defaults."""
    fields = METHODS[method].options.model_fields
    if "basis" not in fields:
        return [{}]
    return [{"basis": basis} for basis in bases if basis in list_choices(fields["basis"])]


def list_one_pass():
    """Methods that estimate the two paths one after the other, once, with their default options."""
    return {name for name, method in METHODS.items() if method.validity.one_pass == {}}
