"""`rig model`: its kinds of study."""

import argparse

from daq.cli.model.studies import add_studies
from daq.cli.model.sweep import add_sweep
from daq.cli.model.thesis import add_thesis

_EPILOG = """\
RANGE is FIRST:LAST:COUNT (FIRST:LAST:COUNT:log for equal ratios), or values
with commas. RIG.TOML may be a rotor's own file; without it the thesis's GJ90C
is taken. Every study prints a table; --json gives it to programs, -o FILE.svg
or FILE.png draws it.
"""


def add_model_commands(parser: argparse.ArgumentParser) -> None:
    """Add the kinds of study to the command's parser."""
    parser.epilog = _EPILOG
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    studies = parser.add_subparsers(dest="kind", required=True, metavar="STUDY")

    def add(name: str, text: str) -> argparse.ArgumentParser:
        return studies.add_parser(name, help=text, description=text)

    add_studies(add)
    add_sweep(add)
    add_thesis(add)
