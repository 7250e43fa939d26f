"""`python -m ankleloop`, and the command of that name: the command line, where its packages are installed."""

import sys


def main() -> int:
    """Run a command."""
    try:
        from ankleloop_lab.command_line.main import main as run_command
    except ModuleNotFoundError as error:
        print(
            f'The command line needs more packages ({error}): pip install "ankleloop[lab]"',
            file=sys.stderr,
        )
        return 3
    return run_command()


if __name__ == "__main__":
    sys.exit(main())
