"""The examples of the public names, as the reference shows them."""

import doctest

import pytest

import ankleloop

PUBLIC = {
    name: getattr(ankleloop, name)
    for name in ankleloop.__all__
    if name not in ("METHODS", "subspace")
}
PUBLIC |= {
    f"subspace.{name}": getattr(ankleloop.subspace, name) for name in ankleloop.subspace.__all__
}
EXAMPLES = [
    test
    for name, member in PUBLIC.items()
    for test in doctest.DocTestFinder().find(member, name)
    if test.examples
]


@pytest.mark.parametrize("test", EXAMPLES, ids=lambda test: test.name)
def test_example(test, monkeypatch):
    monkeypatch.setattr("ankleloop_lab.experiments.perturbation.GENERATIONS", 8)  # a shorter search
    runner = doctest.DocTestRunner(optionflags=doctest.IGNORE_EXCEPTION_DETAIL)
    assert runner.run(test, clear_globs=False).failed == 0
