"""Files that a command writes are refused with the options of the command."""

import click
import pytest

from ankleloop.command_line.outputs import check_outputs

REMEDY = "--overwrite replaces it."


def refusal(*paths, **options):
    """What the command says about files that it does not write."""
    with pytest.raises(click.UsageError) as caught:
        check_outputs(paths, REMEDY, **options)
    return caught.value.message


@pytest.mark.parametrize("overwrite", [False, True])
def test_options_that_do_not_help_are_not_named(tmp_path, overwrite):
    recording = tmp_path / "a.csv"
    recording.write_text("irreplaceable")
    text = refusal(recording, overwrite=overwrite, inputs=iter([recording]))
    assert "the file is being read" in text
    assert "overwrite" not in text
    assert "there is no folder" in refusal(tmp_path / "nowhere" / "a.csv", overwrite=overwrite)
