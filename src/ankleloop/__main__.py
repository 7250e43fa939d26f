"""`python -m ankleloop`: the command line."""

import sys

from ankleloop.command_line.main import main

if __name__ == "__main__":
    sys.exit(main())
