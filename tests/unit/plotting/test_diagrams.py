import pytest

from ankleloop.plotting.diagrams import closed_loop_diagram, parallel_cascade_diagram


def texts(figure):
    return [text for text in figure.axes[0].texts if text.get_text()]


@pytest.mark.parametrize("draw", [parallel_cascade_diagram, closed_loop_diagram])
def test_texts_do_not_overlap_and_stay_inside_the_figure(draw):
    figure = draw()
    figure.canvas.draw()
    boxes = [text.get_window_extent() for text in texts(figure)]
    border = figure.bbox
    for number, box in enumerate(boxes):
        assert border.x0 <= box.x0
        assert box.x1 <= border.x1
        assert border.y0 <= box.y0
        assert box.y1 <= border.y1
        assert not any(box.overlaps(other) for other in boxes[number + 1 :])
