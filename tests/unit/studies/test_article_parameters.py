"""The article has the settings of every point of its studies, so that it can choose points by their values."""

from ankleloop.replication.captions import typical_point
from ankleloop.studies.results import article_parameters, article_studies
from ankleloop.studies.study import read_studies


def test_the_article_finds_table1_by_its_settings(config):
    checked, studies = read_studies(config)
    article = article_studies(checked, studies)
    files = {study.name: {"table": f"{study.name}.csv", "figures": []} for study in article}
    parameters = article_parameters(article, files, verification="ledger.csv", economy="economy.csv", diagrams=[])
    table1 = parameters["studies"]["table1"]
    reordered = dict(reversed(table1["points"].items()))
    for points in (table1["points"], reordered):
        assert points[typical_point(points, table1["varied"])]["reflex_gain"] == 13.0
    assert table1["table"] == "table1.csv"
    assert parameters["verification"] == "ledger.csv"
    assert list(parameters["studies"]) == [study.name for study in article]
