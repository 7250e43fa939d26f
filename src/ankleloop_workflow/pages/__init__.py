"""Pages of studies and of the whole run."""

from jinja2 import PackageLoader

from ankleloop_lab.pages.rendering import ENVIRONMENT

TEMPLATES = ENVIRONMENT.overlay(loader=PackageLoader(__name__))
